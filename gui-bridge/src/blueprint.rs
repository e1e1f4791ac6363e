//! The layout that a viewer opens with.
//!
//! ```text
//!   ┌──────────────────────────┬───────────────┐
//!   │ World │ Other data       │ packages /s   │
//!   │                          ├───────────────┤
//!   │                          │ latency       │
//!   │                          ├───────────────┤
//!   ├──────────────────────────┤ losses        │
//!   │ Modules          │ now   ├───────────────┤
//!   │                  │       │ Output        │
//!   └──────────────────────────┴───────────────┘
//! ```

use crate::palette;
use crate::scene::ROBOT_TIME;
use rerun::blueprint::components::{BackgroundKind, Corner2D, PanelState, PlayState};
use rerun::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Horizontal, SelectionPanel, Spatial2DView,
    StateTimelineView, Tabs, TextDocumentView, TextLogView, TimePanel, TimeSeriesView, Vertical,
};
use rerun::external::re_log_types::StoreId;
use rerun::external::re_sdk_types::blueprint::archetypes::{Background, PlotLegend, TextLogColumns};
use rerun::external::re_sdk_types::blueprint::datatypes::{TextLogColumn, TextLogColumnKind};
use rerun::log::LogMsg;
use rerun::{ApplicationId, AsComponents, EntityPath, RecordingStream, RecordingStreamBuilder, RecordingStreamResult};

/// A property of a view that Rerun's builders have no method for.
struct Property {
    entity: EntityPath,
    what: Box<dyn AsComponents>,
}

/// Views, and what has to be said of them besides.
#[derive(Default)]
struct Layout {
    properties: Vec<Property>,
}

impl Layout {
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

    fn world(&mut self) -> ContainerLike {
        let [red, green, blue] = palette::GROUND;
        let ground = Background::new(BackgroundKind::SolidColor).with_color([red, green, blue, 255]);
        // The view's origin lies above `world`, whose own transform turns y up.
        let view = Spatial2DView::new("World").with_origin("/").with_contents(["/world/**"]);
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

    fn all(&mut self) -> Blueprint {
        let other = Vertical::new([
            TimeSeriesView::new("Other data: numbers").with_origin("data").into(),
            self.lines("Other data: text", "data"),
        ])
        .with_name("Other data");
        let left = Vertical::new([
            Tabs::new([self.world(), other.into()]).into(),
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

/// Sends the layout and makes it the active one. As a mere default it would lose against the layout that a viewer guesses
/// when rows come before it does, and against what it has kept from an earlier run.
pub(crate) fn send(stream: &RecordingStream) -> RecordingStreamResult<()> {
    let mut layout = Layout::default();
    let blueprint = layout.all();
    let application = stream.store_info().map_or_else(ApplicationId::unknown, |info| info.application_id().clone());
    let (draft, written) = RecordingStreamBuilder::new(application).memory()?;
    blueprint.send(&draft, BlueprintActivation { make_active: true, make_default: true })?;
    let mut messages = written.take();
    messages.retain(|message| message.store_id().is_blueprint());
    let Some(last) = messages.pop() else { return Ok(()) };
    let more = properties(last.store_id(), &layout.properties)?;
    // The last message makes the blueprint take effect, so it has to be whole by then.
    for message in messages.into_iter().chain(more).chain([last]) {
        stream.record_msg(message);
    }
    Ok(())
}

fn properties(blueprint: &StoreId, properties: &[Property]) -> RecordingStreamResult<Vec<LogMsg>> {
    let (stream, written) = RecordingStreamBuilder::from_store_id(blueprint).blueprint().memory()?;
    // Viewers read a blueprint at this time.
    stream.set_time_sequence("blueprint", 0);
    for Property { entity, what } in properties {
        stream.log(entity.clone(), what.as_ref())?;
    }
    let mut messages = written.take();
    messages.retain(|message| matches!(message, LogMsg::ArrowMsg(..)));
    Ok(messages)
}
