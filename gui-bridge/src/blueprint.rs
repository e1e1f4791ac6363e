//! The layout that a viewer opens with.
//!
//! ```text
//!   ┌──────────────────────────┬───────────────┐
//!   │ World │ tabs of views    │ packages /s   │
//!   │                          ├───────────────┤
//!   │                          │ latency       │
//!   │                          ├───────────────┤
//!   ├──────────────────────────┤ losses        │
//!   │ Modules          │ now   ├───────────────┤
//!   │                  │       │ Output        │
//!   └──────────────────────────┴───────────────┘
//! ```

use crate::palette;
use crate::timelines::ROBOT_TIME;
use rerun::blueprint::components::{BackgroundKind, Corner2D, PanelState, PlayState};
use rerun::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Spatial2DView,
    StateTimelineView, Tabs, TextDocumentView, TextLogView, TimePanel, TimeSeriesView, Vertical,
};
use rerun::external::re_log_types::StoreId;
use rerun::external::re_sdk_types::blueprint::archetypes::{Background, PlotLegend, TextLogColumns};
use rerun::external::re_sdk_types::blueprint::datatypes::{TextLogColumn, TextLogColumnKind};
use rerun::log::LogMsg;
use rerun::sink::CallbackSink;
use rerun::{ApplicationId, AsComponents, EntityPath, RecordingStream, RecordingStreamBuilder, RecordingStreamResult};

use std::sync::{Arc, Mutex, PoisonError};

/// A tab beside the world: what one view draws.
#[derive(Clone)]
pub struct Tab {
    name: String,
    panel: Panel,
}

#[derive(Clone)]
enum Panel {
    Plane(Vec<String>),
    Curves(String),
    CurvesAndLines(String),
    Own(Arc<dyn Fn() -> ContainerLike + Send + Sync>),
}

impl Tab {
    /// The world from above, with these entities only, such as `/world/scan/**`.
    pub fn plane(name: &str, contents: &[&str]) -> Self {
        Self { name: name.into(), panel: Panel::Plane(contents.iter().map(|entity| (*entity).into()).collect()) }
    }

    /// Curves of all numbers below an entity.
    pub fn curves(name: &str, origin: &str) -> Self {
        Self { name: name.into(), panel: Panel::Curves(origin.into()) }
    }

    /// The same, with all lines of text below.
    pub fn curves_and_lines(name: &str, origin: &str) -> Self {
        Self { name: name.into(), panel: Panel::CurvesAndLines(origin.into()) }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Anything that Rerun's blueprints offer, see [`rerun::blueprint`]. Give the view the same name.
    pub fn own<T: Into<ContainerLike>>(name: &str, view: impl Fn() -> T + Send + Sync + 'static) -> Self {
        Self { name: name.into(), panel: Panel::Own(Arc::new(move || view().into())) }
    }
}

/// What a viewer shows: the world, the states, the traffic and the output always, and a tab for each view.
#[derive(Clone, Default)]
pub struct Layout {
    tabs: Vec<Tab>,
}

impl Layout {
    /// With these tabs.
    pub fn new(tabs: Vec<Tab>) -> Self {
        Self { tabs }
    }
}

/// A property of a view that Rerun's builders have no method for.
struct Property {
    entity: EntityPath,
    what: Box<dyn AsComponents>,
}

/// Views, and what has to be said of them besides.
#[derive(Default)]
struct Draft {
    properties: Vec<Property>,
}

impl Draft {
    fn property(
        &mut self,
        view: impl Into<ContainerLike>,
        name: &str,
        what: impl AsComponents + 'static,
    ) -> ContainerLike {
        let view = view.into();
        if let ContainerLike::View(view) = &view {
            let entity = format!("{}/{name}", view.blueprint_path()).into();
            self.properties.push(Property { entity, what: Box::new(what) });
        }
        view
    }

    fn plane(&mut self, name: &str, contents: &[String]) -> ContainerLike {
        let [red, green, blue] = palette::GROUND;
        let ground = Background::new(BackgroundKind::SolidColor).with_color([red, green, blue, 255]);
        // The view's origin lies above `world`, which has a transform that turns y up.
        let view = Spatial2DView::new(name).with_origin("/").with_contents(contents.iter().map(String::as_str));
        self.property(view, "Background", ground)
    }

    /// A chart of all classes. A class has one colour in all of them, so one legend does.
    fn chart(&mut self, name: &str, origin: &str, legend: bool) -> ContainerLike {
        let legend = PlotLegend::new().with_corner(Corner2D::LeftTop).with_visible(legend);
        self.property(TimeSeriesView::new(name).with_origin(origin), "PlotLegend", legend)
    }

    /// Lines of output. Each names its module itself: the column of entities is too narrow to be read.
    fn lines(&mut self, name: &str, origin: &str) -> ContainerLike {
        let columns = [TextLogColumnKind::LogLevel, TextLogColumnKind::Body]
            .map(|kind| TextLogColumn { kind, visible: true.into() });
        let columns = TextLogColumns::new().with_text_log_columns(columns);
        self.property(TextLogView::new(name).with_origin(origin), "TextLogColumns", columns)
    }

    fn tab(&mut self, Tab { name, panel }: &Tab) -> ContainerLike {
        match panel {
            Panel::Plane(contents) => self.plane(name, contents),
            Panel::Curves(origin) => self.chart(name, origin, true),
            Panel::CurvesAndLines(origin) => Vertical::new([
                self.chart(&format!("{name}: numbers"), origin, true),
                self.lines(&format!("{name}: text"), origin),
            ])
            .with_name(name.as_str())
            .into(),
            Panel::Own(view) => view(),
        }
    }

    fn all(&mut self, layout: &Layout) -> Blueprint {
        let world = self.plane("World", &["/world/**".into()]);
        let tabs: Vec<ContainerLike> =
            std::iter::once(world).chain(layout.tabs.iter().map(|tab| self.tab(tab))).collect();
        let left = Vertical::new([
            Tabs::new(tabs).into(),
            Horizontal::new([
                StateTimelineView::new("Modules").with_origin("modules").into(),
                TextDocumentView::new("Modules now").with_origin(EntityPath::from(vec!["modules now".into()])).into(),
            ])
            .with_column_shares([3.0, 1.0])
            .into(),
        ])
        .with_row_shares([7.0, 3.0]);
        let right = Vertical::new([
            self.chart("Packages per second, by class", "packages", true),
            self.chart("Latency, µs: 99 of 100 packages, and median (dim)", "latency", false),
            self.chart("Packages lost since start", "losses", false),
            self.lines("Output", "output"),
        ])
        .with_row_shares([4.0, 5.0, 3.0, 4.0]);
        Blueprint::new(Horizontal::new([left.into(), right.into()]).with_column_shares([3.0, 2.0]))
            .with_auto_views(false)
            .with_auto_layout(false)
            .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
            .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
            .with_time_panel(
                TimePanel::new()
                    .with_state(PanelState::Collapsed)
                    .with_timeline(ROBOT_TIME)
                    .with_play_state(PlayState::Following),
            )
    }
}

/// Sends the layout and makes it the active one. As a mere default it would lose against the layout that a viewer
/// guesses when rows come before it does, and against what it has kept from an earlier run.
pub(crate) fn send(stream: &RecordingStream, layout: &Layout) -> RecordingStreamResult<()> {
    let mut views = Draft::default();
    let blueprint = views.all(layout);
    let application = stream.store_info().map_or_else(ApplicationId::unknown, |info| info.application_id().clone());
    let mut messages = written(RecordingStreamBuilder::new(application), |draft| {
        blueprint.send(draft, BlueprintActivation { make_active: true, make_default: true })
    })?;
    messages.retain(|message| message.store_id().is_blueprint());
    let Some(last) = messages.pop() else { return Ok(()) };
    let more = properties(last.store_id(), &views.properties)?;
    // The last message makes the blueprint take effect, so it has to be whole by then.
    for message in messages.into_iter().chain(more).chain([last]) {
        stream.record_msg(message);
    }
    Ok(())
}

fn properties(blueprint: &StoreId, properties: &[Property]) -> RecordingStreamResult<Vec<LogMsg>> {
    let mut messages = written(RecordingStreamBuilder::from_store_id(blueprint).blueprint(), |stream| {
        // Viewers read a blueprint at this time.
        stream.set_time_sequence("blueprint", 0);
        properties.iter().try_for_each(|Property { entity, what }| stream.log(entity.clone(), what.as_ref()))
    })?;
    messages.retain(|message| matches!(message, LogMsg::ArrowMsg(..)));
    Ok(messages)
}

/// What `write` writes to a stream of its own. (Rerun's own memory stream holds itself: it and its threads never end.)
fn written(
    builder: RecordingStreamBuilder,
    write: impl FnOnce(&RecordingStream) -> RecordingStreamResult<()>,
) -> RecordingStreamResult<Vec<LogMsg>> {
    let stream = builder.buffered()?;
    let messages = Arc::new(Mutex::new(Vec::new()));
    let list = messages.clone();
    let collect = move |more: &[LogMsg]| list.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(more);
    stream.set_sink(Box::new(CallbackSink::new(collect)));
    write(&stream)?;
    // Dropping it waits until its threads have written all and have ended.
    drop(stream);
    Ok(std::mem::take(&mut *messages.lock().unwrap_or_else(PoisonError::into_inner)))
}
