//! The bridge as a module: hears what the configuration names, and draws it.
//!
//! Its one thread never waits for Rerun: it turns packages into rows of the scene, and the store takes them at once. So
//! its mailboxes are soon empty, whatever a viewer does. If they were not, the bridge would lose packages, and never a
//! sender that waits.

use crate::nodes::Nodes;
use crate::sink::CloseError;
use crate::store::DrawingCounts;
use crate::subjects::{Intake, NEWEST, Subjects};
use crate::supervisor::{self, StreamSupervisor, Turn};
use crate::team::Floor;
use crate::view::Views;
use crate::{RATE_HZ, RATE_HZ_MIN, Scene, Sink, scene, views};
use rohrpost::interface::{Interface, Proxy};
use rohrpost::interfaces::{CollectorInterface, CollectorProxy};
use rohrpost::{Context, Module, ModuleError, Name, Received};
use rohrpost_config::{MailboxSpec, ROUTER};
use rohrpost_launch::survey::{Standing, Survey};
use rohrpost_mailbox::{Latency, ModuleState, Node, OverflowPolicy, Shape, TimeSource};
use serde::Deserialize;
use std::marker::PhantomData;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// States and charts are drawn so often.
const SURVEY_PERIOD: Duration = Duration::from_millis(500);
/// What comes of other nodes and systems, page by page, is taken so often; large streams are looked at no more often.
const COLLECT_PERIOD: Duration = Duration::from_millis(25);
/// Data with a newest value that may wait while the bridge is stopped. Of more data, the least important are lost.
const NEWEST_SLOTS: u16 = 64;
/// The collector answers within this time, or its earlier lines are not drawn.
const PATIENCE: Duration = Duration::from_millis(300);
const MIB: u64 = 1024 * 1024;
/// A smaller file would hold little but what each begins with.
const FILE_MIB_MIN: u64 = 8;

/// What the configuration says of the bridge.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Settings {
    /// File to write, from the configuration file's folder.
    file: Option<PathBuf>,
    /// When the file is this large, at least [`FILE_MIB_MIN`], it becomes `NAME.old.rrd`, and a new one is begun.
    #[serde(default = "file_max_mib")]
    file_max_mib: u64,
    /// `window` opens the Rerun viewer, if it is installed; else the address of one that runs or will run
    /// (`rerun+http://…/proxy`).
    viewer: Option<String>,
    /// No entity is drawn more often; [`RATE_HZ_MIN`] to 1000, or 0, which is no limit.
    #[serde(default = "rate_hz")]
    rate_hz: f64,
    /// The map that the robots of a team share, from the configuration file's folder.
    map: Option<PathBuf>,
    /// Side of the map's cells, metres, if the map does not say it.
    cell_m: Option<f64>,
}

fn file_max_mib() -> u64 {
    512
}

fn rate_hz() -> f64 {
    RATE_HZ
}

/// Draws what happens.
#[rohrpost::interface(class = "gui")]
pub trait Drawing {
    /// What became of all that was to be drawn since it was switched on.
    #[command(16, idempotent)]
    fn counts(&mut self) -> DrawingCounts;
}

/// Draws what a robot does, with a user's views `V` before its own.
pub struct Bridge<V> {
    sink: Sink,
    rate_hz: f64,
    subjects: Subjects,
    /// None while switched off.
    scene: Option<Scene>,
    /// The scene was opened before the log began that is the node's time.
    awaits_time: bool,
    /// Drawings that were switched off and are being ended.
    ending: Vec<StreamSupervisor>,
    turn: Turn,
    /// The module that collects lines, once it is known.
    collector: Option<Name>,
    /// Lines were said that the scene does not know.
    lines_wanted: bool,
    node: Arc<Node>,
    node_name: String,
    nodes: Nodes,
    /// When states and charts are drawn next.
    survey_at: Instant,
    views: PhantomData<V>,
}

impl<V: Views> Module for Bridge<V> {
    type Settings = Settings;
    type Interfaces = DrawingInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let installation = context.installation();
        let Settings { file, file_max_mib, viewer, rate_hz, map, cell_m } = settings;
        let sink = match (viewer, file) {
            (Some(viewer), _) if viewer == "window" => Sink::Window,
            (Some(address), _) => Sink::Viewer(address),
            (None, Some(file)) => {
                Sink::File { path: installation.resolve(&file), bytes_max: file_max_mib.saturating_mul(MIB) }
            }
            (None, None) => return Err(ModuleError::new("draw where? set `file` or `viewer` in its settings")),
        };
        if rate_hz != 0.0 && !(RATE_HZ_MIN..=1000.0).contains(&rate_hz) {
            let text = format!("`rate-hz` is {rate_hz}; use {RATE_HZ_MIN} to 1000, or 0 for no limit");
            return Err(ModuleError::new(text));
        }
        if file_max_mib < FILE_MIB_MIN {
            let text = format!("`file-max-mib` is {file_max_mib}; use {FILE_MIB_MIN} or more");
            return Err(ModuleError::new(text));
        }
        let floor = map.map(|map| Floor::read(&installation.resolve(&map), cell_m)).transpose();
        let floor = floor.map_err(|why| ModuleError::new(format!("`map`: {why}")))?;
        let me = installation.module(context.me()).ok_or_else(|| ModuleError::new("it is not in the configuration"))?;
        let node_name = me.node.clone();
        let newest = newest(&me.mailboxes.data);
        let node = context.link().borrow().participant().node().clone();
        let intake = Intake { body_bytes_max: newest.body_bytes_max.into(), period: scene::period(rate_hz) };
        context.open_mailbox(NEWEST, newest)?;
        let subjects = Subjects::new(V::make(), floor, context, intake);
        let nodes = Nodes::new(node.clone(), &node_name, context.installation());
        // People look at it also while the robot's time stands still.
        context.use_computer_clock();
        let installation = context.installation();
        let are_of_others = installation.gui.show.iter().any(|show| show.from.system() != installation.system.id);
        context.set_period(if nodes.are_several() || are_of_others { COLLECT_PERIOD } else { SURVEY_PERIOD });
        Ok(Self {
            sink,
            rate_hz,
            subjects,
            scene: None,
            awaits_time: false,
            ending: Vec::new(),
            turn: Turn::default(),
            collector: None,
            lines_wanted: false,
            node,
            node_name,
            nodes,
            survey_at: Instant::now(),
            views: PhantomData,
        })
    }

    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = context.now().ns;
        self.awaits_time = !has_time(context);
        let name = &context.installation().name;
        let scene = Scene::open_in_turn(name, self.sink.clone(), self.rate_hz, now_ns, self.turn.clone())?;
        self.scene.insert(scene).arrange(self.subjects.layout());
        // The new drawing knows nothing of what the last one knew.
        self.subjects.want_repair();
        self.lines_wanted = true;
        self.nodes.look(context)?;
        let survey = self.nodes.survey(context.installation());
        self.find(context, &survey)
    }

    fn off(&mut self, _: &mut Context) {
        self.ending.retain(|supervisor| !supervisor.has_ended());
        self.ending.extend(self.scene.take().and_then(Scene::leave));
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.look_whether_time_began(context);
        self.nodes.collect(context);
        self.subjects.collect(context);
        if let Some(scene) = &mut self.scene {
            self.subjects.look(scene, context);
        }
        let now = Instant::now();
        if now < self.survey_at {
            return Ok(());
        }
        self.survey_at = now + SURVEY_PERIOD - COLLECT_PERIOD;
        self.nodes.look(context)?;
        let survey = self.nodes.survey(context.installation());
        self.find(context, &survey)?;
        self.subjects.repair(context);
        let now_ns = context.now().ns;
        let Some(scene) = &mut self.scene else { return Ok(()) };
        if let Some(why) = scene.failure() {
            return Err(ModuleError::new(why));
        }
        scene.set_time(now_ns);
        states(scene, &survey, context);
        charts(scene, &self.nodes, context);
        Ok(())
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        self.look_whether_time_began(context);
        if let Some(scene) = &mut self.scene {
            self.subjects.draw(scene, context, data);
        }
        Ok(())
    }
}

impl<V: Views> Drawing for Bridge<V> {
    fn counts(&mut self) -> DrawingCounts {
        self.scene.as_ref().map(Scene::counts).unwrap_or_default()
    }
}

impl<V> Drop for Bridge<V> {
    /// The process is about to end, and the drawings with it.
    fn drop(&mut self) {
        let deadline = Instant::now() + supervisor::LAST;
        for supervisor in self.ending.drain(..) {
            if let Err(error @ CloseError::Stuck) = supervisor.close_by(deadline) {
                tracing::warn!("{error}");
            }
        }
        // The module's own runner has said all that it had to say before.
        rohrpost::output::flush();
    }
}

/// Whether the log has begun that is the node's time; of any other time, true.
fn has_time(context: &Context) -> bool {
    context.clock().record().is_none_or(|record| record.source != TimeSource::Log || record.is_known())
}

impl<V> Bridge<V> {
    /// What is drawn of a log begins at robot time 0.
    fn look_whether_time_began(&mut self, context: &Context) {
        if !self.awaits_time || !has_time(context) {
            return;
        }
        self.awaits_time = false;
        if let Some(scene) = &mut self.scene {
            scene.begin_at(context.now().ns);
        }
    }

    /// Looks for what has begun to run since the last time.
    fn find(&mut self, context: &mut Context, survey: &Survey) -> Result<(), ModuleError> {
        let collector = context.installation().classes.id(CollectorInterface::CLASS);
        let system = context.installation().system.id;
        // One that starts or hangs would be waited for in vain. What runs in another system is not known here.
        let runs = |name: Name| {
            if name.system() != system {
                return true;
            }
            let process = survey.module(name).and_then(|module| module.process.as_ref());
            process.is_some_and(|process| matches!(process.state, Some(ModuleState::On | ModuleState::Off)))
        };
        let more = self.subjects.find(context, &self.node, &self.node_name, runs, |name| {
            if Some(name.class()) == collector {
                self.collector = Some(name);
            }
        })?;
        if more && self.subjects.have_rings() {
            context.set_period(COLLECT_PERIOD);
        }
        let Some(scene) = self.scene.as_mut() else { return Ok(()) };
        if more {
            scene.arrange(self.subjects.layout());
        }
        if let Some(collector) = self.collector.filter(|name| self.lines_wanted && runs(*name)) {
            self.lines_wanted = false;
            earlier_lines(scene, collector, context);
        }
        Ok(())
    }
}

/// The mailbox beside the data mailbox, as that is configured: what fits in one fits in the other.
fn newest(data: &MailboxSpec) -> Shape {
    Shape {
        slots: NEWEST_SLOTS,
        body_bytes_max: u16::try_from(data.size).unwrap_or(u16::MAX),
        full: OverflowPolicy::Latest,
        max_age: data.max_age,
        ..Shape::default()
    }
}

/// Draws what was said before the bridge began to listen; a line that comes twice does no harm.
fn earlier_lines(scene: &mut Scene, collector: Name, context: &Context) {
    let proxy = CollectorProxy::new(context.link(), collector).with_timeout(PATIENCE);
    let (mut next, mut end) = (0, None);
    while let Ok(page) = proxy.lines_from(next) {
        for line in &page.lines {
            views::draw_line(scene, context.installation(), line);
        }
        next = page.first + page.lines.len() as u64;
        // What is said meanwhile comes by itself; to follow it here might have no end.
        if page.lines.is_empty() || next >= *end.get_or_insert(page.next) {
            break;
        }
    }
}

fn states(scene: &mut Scene, survey: &Survey, context: &Context) {
    for module in &survey.modules {
        let name = context.installation().classes.format(module.name);
        let state = module.standing();
        let why = if state == Standing::On { String::new() } else { module.last_error(context.installation()) };
        scene.module_state(&name, state, &why);
    }
}

fn charts(scene: &mut Scene, nodes: &Nodes, context: &Context) {
    let installation = context.installation();
    for (class, figures) in nodes.figures(installation.classes.id(ROUTER)) {
        let name = class.and_then(|id| installation.classes.name(id)).unwrap_or("others");
        scene.traffic(name, figures.received_per_s, figures.lost);
        let us = |waited: &Latency, share| waited.quantile(share).map(|time| time.as_secs_f64() * 1e6);
        let (p50_us, p99_us) = (us(&figures.at_end, 0.5), us(&figures.at_end, 0.99));
        if let (Some(p50_us), Some(p99_us)) = (p50_us, p99_us) {
            scene.latency(name, p50_us, p99_us);
        }
        if installation.nodes.len() > 1 {
            scene.hops(name, us(&figures.in_transit, 0.99), p99_us);
        }
    }
}
