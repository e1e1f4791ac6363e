//! The layout that a viewer opens with: without sensors that give pictures or points, with them, and of a team.
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
//!
//!   ┌──────────────────────┬─────────┬─────────┐
//!   │ World │ tabs of      │ picture │ packages│
//!   │         views        │         ├─────────┤
//!   │                      ├─────────┤ latency │
//!   │                      │ Points  ├─────────┤
//!   │                      │         │ losses  │
//!   ├───────────────┬──────┴┬────────┴─────────┤
//!   │ Modules       │ now   │ Output           │
//!   └───────────────┴───────┴──────────────────┘
//!
//!   ┌──────────────────────────┬───────────────┐
//!   │ Team │ World │ tabs of   │ Modes         │
//!   │      │       │ views,    ├───────────────┤
//!   │                 Traffic  │ Groups        │
//!   ├──────────────────────────┤               │
//!   │ Output │ Modules │ now   ├───────────────┤
//!   │                          │ Key           │
//!   └──────────────────────────┴───────────────┘
//! ```

use crate::palette;
use crate::timelines::ROBOT_TIME;
use rerun::blueprint::components::{BackgroundKind, Corner2D, PanelState, PlayState};
use rerun::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Spatial2DView,
    Spatial3DView, StateTimelineView, Tabs, TextDocumentView, TextLogView, TimePanel, TimeSeriesView, Vertical,
};
use rerun::external::re_log_types::StoreId;
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, EyeControls3D, LineGrid3D, PlotLegend, TextLogColumns,
};
use rerun::external::re_sdk_types::blueprint::datatypes::{TextLogColumn, TextLogColumnKind};
use rerun::log::LogMsg;
use rerun::sink::CallbackSink;
use rerun::{ApplicationId, AsComponents, EntityPath, RecordingStream, RecordingStreamBuilder, RecordingStreamResult};

use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};

/// Where the eye of [`Tab::space`] is, and what it looks at: metres ahead, to the left and up. So it sees what a sensor
/// sees, and a little of it from the side.
const EYE_M: [f32; 3] = [-1.4, 0.8, 1.6];
/// See [`EYE_M`].
const EYE_TARGET_M: [f32; 3] = [3.0, 0.0, 0.2];

/// Cells of the column beside the world: in more of them nothing is large enough to be seen.
const CELLS_MAX: usize = 3;

/// What one view draws: a tab in the place of the world, or in a column beside it, see [`Tab::beside`].
#[derive(Clone)]
pub struct Tab {
    name: String,
    panel: Panel,
    place: TabPlace,
}

/// Where a tab is.
#[derive(Clone, Copy, PartialEq)]
enum TabPlace {
    /// In the place of the world, and before it.
    First,
    /// In the place of the world.
    World,
    Beside,
}

#[derive(Clone)]
enum Panel {
    Plane(Vec<String>),
    Space {
        origin: EntityPath,
        contents: Vec<String>,
        /// Where the eye is, and what it looks at; none: as the viewer thinks best.
        eye_m: Option<[[f32; 3]; 2]>,
    },
    Curves(String),
    CurvesAndLines(String),
    Own(Arc<dyn Fn() -> ContainerLike + Send + Sync>),
    /// The first, and below it curves of this name and origin.
    Over(Box<Panel>, String, EntityPath),
}

impl Tab {
    fn new(name: &str, panel: Panel) -> Self {
        Self { name: name.into(), panel, place: TabPlace::World }
    }

    /// The world from above, with these entities only, such as `/world/scan/**`.
    pub fn plane(name: &str, contents: &[&str]) -> Self {
        Self::new(name, Panel::Plane(contents.iter().map(|entity| (*entity).into()).collect()))
    }

    /// These entities in space, seen from behind the sensor `origin`: in its frame, with x ahead, y to the left and z
    /// up.
    pub fn space(name: &str, origin: impl Into<EntityPath>, contents: &[&str]) -> Self {
        let contents = contents.iter().map(|entity| (*entity).into()).collect();
        Self::new(name, Panel::Space { origin: origin.into(), contents, eye_m: Some([EYE_M, EYE_TARGET_M]) })
    }

    /// All below an entity in space, seen from this place to that one. With it there is room for timelines beside the
    /// world, and charts are a tab.
    pub(crate) fn floor(name: &str, origin: &str, eye_m: Option<[[f32; 3]; 2]>) -> Self {
        let contents = vec![format!("{origin}/**")];
        let panel = Panel::Space { origin: origin.into(), contents, eye_m };
        Self { place: TabPlace::First, ..Self::new(name, panel) }
    }

    /// Curves of all numbers below an entity.
    pub fn curves(name: &str, origin: &str) -> Self {
        Self::new(name, Panel::Curves(origin.into()))
    }

    /// The same, with all lines of text below.
    pub fn curves_and_lines(name: &str, origin: &str) -> Self {
        Self::new(name, Panel::CurvesAndLines(origin.into()))
    }

    /// Anything that Rerun's blueprints offer, see [`rerun::blueprint`]. Give the view the same name.
    pub fn own<T: Into<ContainerLike>>(name: &str, view: impl Fn() -> T + Send + Sync + 'static) -> Self {
        Self::new(name, Panel::Own(Arc::new(move || view().into())))
    }

    /// The same under another name, with curves of all numbers below an entity under it.
    #[must_use]
    pub(crate) fn over_curves(self, name: String, curves: String, origin: EntityPath) -> Self {
        Self { name, panel: Panel::Over(Box::new(self.panel), curves, origin), ..self }
    }

    /// The same in the column beside the world, where it is seen at once. Of more than three there, the first share the
    /// uppermost cell, as its tabs.
    #[must_use]
    pub fn beside(self) -> Self {
        Self { place: TabPlace::Beside, ..self }
    }
}

/// What a viewer shows: the world, the states, the traffic and the output always, and the tabs of all views.
#[derive(Clone, Default)]
pub struct Layout {
    tabs: Vec<Tab>,
}

impl Layout {
    /// With these tabs; of those with one name, the first.
    pub fn new(mut tabs: Vec<Tab>) -> Self {
        let mut names = HashSet::new();
        tabs.retain(|tab| names.insert(tab.name.clone()));
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
        // The view's origin lies above `world`, which has a transform that turns y up.
        let view = Spatial2DView::new(name).with_origin("/").with_contents(contents.iter().map(String::as_str));
        self.property(view, "Background", ground())
    }

    fn space(
        &mut self,
        name: &str,
        origin: &EntityPath,
        contents: &[String],
        eye_m: Option<[[f32; 3]; 2]>,
    ) -> ContainerLike {
        let view = Spatial3DView::new(name).with_origin(origin.clone());
        let view = view.with_contents(contents.iter().map(String::as_str));
        let up = EyeControls3D::new().with_eye_up([0.0, 0.0, 1.0]);
        let eye = match eye_m {
            Some([place, target]) => up.with_position(place).with_look_target(target),
            None => up,
        };
        let view = self.property(view, "Background", ground());
        let view = self.property(view, "EyeControls3D", eye);
        // Its plane would be at the sensor's height, which is no floor.
        self.property(view, "LineGrid3D", LineGrid3D::new().with_visible(false))
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

    fn tab(&mut self, Tab { name, panel, .. }: &Tab) -> ContainerLike {
        self.panel(name, panel)
    }

    fn panel(&mut self, name: &str, panel: &Panel) -> ContainerLike {
        match panel {
            Panel::Plane(contents) => self.plane(name, contents),
            Panel::Space { origin, contents, eye_m } => self.space(name, origin, contents, *eye_m),
            Panel::Curves(origin) => self.chart(name, origin, true),
            Panel::CurvesAndLines(origin) => Vertical::new([
                self.chart(&format!("{name}: numbers"), origin, true),
                self.lines(&format!("{name}: text"), origin),
            ])
            .with_name(name)
            .into(),
            Panel::Own(view) => view(),
            Panel::Over(panel, curves, origin) => {
                Vertical::new([self.panel(name, panel), self.chart(curves, &origin.to_string(), false)])
                    .with_row_shares([3.0, 1.0])
                    .with_name(name)
                    .into()
            }
        }
    }

    fn tabs<'a>(&mut self, tabs: impl IntoIterator<Item = &'a Tab>) -> Vec<ContainerLike> {
        tabs.into_iter().map(|tab| self.tab(tab)).collect()
    }

    fn charts(&mut self) -> [ContainerLike; 3] {
        [
            self.chart("Packages per second, by class", "packages", true),
            self.chart("Latency, µs: p99, and median (dim)", "latency", false),
            self.chart("Packages lost since start", "losses", false),
        ]
    }

    fn without_sensors(&mut self, world: Tabs) -> Horizontal {
        let states = Horizontal::new(states()).with_column_shares([3.0, 1.0]);
        let left = Vertical::new([world.into(), states.into()]).with_row_shares([7.0, 3.0]);
        let [packages, latency, losses] = self.charts();
        let right = Vertical::new([packages, latency, losses, self.lines("Output", "output")])
            .with_row_shares([4.0, 5.0, 3.0, 4.0]);
        Horizontal::new([left.into(), right.into()]).with_column_shares([3.0, 2.0])
    }

    fn with_sensors(&mut self, world: Tabs, beside: &[&Tab]) -> Vertical {
        let upper = Horizontal::new([world.into(), self.column(beside).into(), self.traffic().into()])
            .with_column_shares([5.0, 3.0, 3.0]);
        let [all, now] = states();
        let lower = Horizontal::new([all, now, self.lines("Output", "output")]).with_column_shares([4.0, 2.0, 5.0]);
        Vertical::new([upper.into(), lower.into()]).with_row_shares([7.0, 3.0])
    }

    fn with_team(&mut self, mut world: Vec<ContainerLike>, beside: &[&Tab]) -> Horizontal {
        world.push(self.traffic().with_name("Traffic").into());
        let [all, now] = states();
        let below = Tabs::new([self.lines("Output", "output"), all, now]);
        let left = Vertical::new([Tabs::new(world).into(), below.into()]).with_row_shares([4.0, 1.0]);
        Horizontal::new([left.into(), self.column(beside).into()]).with_column_shares([7.0, 4.0])
    }

    fn traffic(&mut self) -> Vertical {
        Vertical::new(self.charts()).with_row_shares([4.0, 5.0, 3.0])
    }

    fn column(&mut self, beside: &[&Tab]) -> Vertical {
        let (first, others) = beside.split_at((beside.len() + 1).saturating_sub(CELLS_MAX).max(1));
        let mut cells: Vec<ContainerLike> = vec![Tabs::new(self.tabs(first.iter().copied())).into()];
        cells.extend(self.tabs(others.iter().copied()));
        Vertical::new(cells)
    }

    fn all(&mut self, layout: &Layout) -> Blueprint {
        let of = |place: TabPlace| layout.tabs.iter().filter(move |tab| tab.place == place);
        let mut world = self.tabs(of(TabPlace::First));
        let has_team = !world.is_empty();
        world.push(self.plane("World", &["/world/**".into()]));
        world.extend(self.tabs(of(TabPlace::World)));
        let beside: Vec<&Tab> = of(TabPlace::Beside).collect();
        let root: ContainerLike = match &beside[..] {
            beside if has_team => self.with_team(world, beside).into(),
            [] => self.without_sensors(Tabs::new(world)).into(),
            beside => self.with_sensors(Tabs::new(world), beside).into(),
        };
        Blueprint::new(root)
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

fn ground() -> Background {
    let [red, green, blue] = palette::GROUND;
    Background::new(BackgroundKind::SolidColor).with_color([red, green, blue, 255])
}

/// The modules' states over time, and now.
fn states() -> [ContainerLike; 2] {
    [
        StateTimelineView::new("Modules").with_origin("modules").into(),
        TextDocumentView::new("Modules now").with_origin(EntityPath::from(vec!["modules now".into()])).into(),
    ]
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

#[cfg(test)]
mod tests;
