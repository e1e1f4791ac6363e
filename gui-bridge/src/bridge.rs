//! The bridge as a module: subscribes to what configuration names, and draws it.
//!
//! What to draw is decided by the type that a module's description tells, not by its class: a scan is a scan whoever sends
//! it. Types that are not known here are drawn by their description.

use crate::{Connection, DrawError, Level, Scene, Sink};
use rohrpost::common::OutputLevel;
use rohrpost::config::Show;
use rohrpost::interface::{Interface, Proxy};
use rohrpost::interfaces::{CollectorInterface, CollectorProxy};
use rohrpost::mailbox::{ModuleState, Node};
use rohrpost::output::OutputLine;
use rohrpost::survey::Survey;
use rohrpost::types::{LaserScan, OccupancyGrid, Odometry, Pose};
use rohrpost::value::{Data, decode};
use rohrpost::{Context, Module, ModuleError, Name, Rate, Received, Subscription};
use serde::Deserialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// States and charts are drawn so often.
const SURVEY_PERIOD: Duration = Duration::from_millis(500);
/// A module whose description is wanted answers within this time, or is asked again at the next survey.
const PATIENCE: Duration = Duration::from_millis(300);

/// What the configuration says of the bridge.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Settings {
    /// File to write, from the configuration file's folder.
    file: Option<PathBuf>,
    /// `window` opens the Rerun viewer, if it is installed; else the address of one that runs (`rerun+http://…/proxy`).
    viewer: Option<String>,
}

/// What to do with the values of one subscription.
#[derive(Clone, Copy)]
enum Kind {
    Scan,
    Odometry,
    Pose,
    Grid,
    Line,
    Unknown,
}

/// One thing that is drawn.
struct Drawn {
    from: Name,
    module: String,
    data: String,
    rate: Rate,
    /// None until its module has described it.
    way: Option<Way>,
    /// Its module has said that it has no such data.
    refused: bool,
}

struct Way {
    subscription: Subscription<()>,
    kind: Kind,
    item: rohrpost::description::DataItem,
}

/// Draws what a robot does.
pub struct Bridge {
    sink: Sink,
    drawn: Vec<Drawn>,
    /// None while switched off.
    scene: Option<Scene>,
    node: Arc<Node>,
    node_name: String,
    last: Option<Survey>,
}

impl Module for Bridge {
    type Settings = Settings;
    type Interfaces = ();

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let installation = context.installation();
        let sink = match (&settings.viewer, &settings.file) {
            (Some(viewer), _) if viewer == "window" => Sink::Window,
            (Some(address), _) => Sink::Viewer(address.clone()),
            (None, Some(file)) => Sink::File(installation.resolve(file)),
            (None, None) => return Err(ModuleError::new("draw where? set `file` or `viewer` in its settings")),
        };
        let text = |name| installation.classes.format(name);
        let mut drawn: Vec<Drawn> = installation.gui.show.iter().map(|show| wanted(show, text(show.from))).collect();
        // What modules say is always worth seeing.
        if let Some(class) = installation.classes.id(CollectorInterface::CLASS) {
            let from = Name::new(installation.system.id, class.0, 0, 0);
            if installation.module(from).is_some() {
                let (module, data) = (text(from), "line".to_owned());
                drawn.push(Drawn { from, module, data, rate: Rate::Each, way: None, refused: false });
            }
        }
        let me = installation.module(context.me()).ok_or_else(|| ModuleError::new("it is not in the configuration"))?;
        let node_name = me.node.clone();
        let node = context.link().borrow().participant().node().clone();
        context.set_period(SURVEY_PERIOD);
        Ok(Self { sink, drawn, scene: None, node, node_name, last: None })
    }

    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = context.now().ns;
        self.scene = Some(Scene::open(&context.installation().name, &self.sink, now_ns)?);
        self.subscribe(context);
        Ok(())
    }

    fn off(&mut self, _: &mut Context) {
        let Some(scene) = self.scene.take() else { return };
        if let Err(error) = scene.close() {
            tracing::warn!("{error}");
        }
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.subscribe(context);
        let now_ns = context.now().ns;
        let survey = Survey::new(&self.node, context.installation(), &self.node_name)?;
        let Some(scene) = &mut self.scene else { return Ok(()) };
        if scene.connection(Duration::ZERO) == Connection::Lost {
            // Rerun never connects again by itself; a new start does.
            return Err(ModuleError::new("the viewer has gone; switch this module off and on to connect again"));
        }
        scene.set_time(now_ns);
        states(scene, &survey, context)?;
        if let Some(last) = &self.last {
            charts(scene, &survey, last, context)?;
        }
        self.last = Some(survey);
        Ok(())
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some(scene) = &mut self.scene else { return Ok(()) };
        let is_it = |drawn: &&Drawn| drawn.way.as_ref().is_some_and(|way| data.is_of(&way.subscription));
        let Some(drawn) = self.drawn.iter().find(is_it) else { return Ok(()) };
        let carrier = self.drawn.iter().find(|d| matches!(&d.way, Some(Way { kind: Kind::Odometry, .. })));
        scene.set_time(data.head.stamp_ns);
        let drawer = Drawer { carrier: carrier.map_or("", |carrier| &carrier.module), context };
        match drawer.draw(scene, drawn, data.value) {
            Ok(()) => Ok(()),
            Err(DrawError::Rerun(error)) => Err(error.into()),
            Err(error) => {
                tracing::warn!("{error}");
                Ok(())
            }
        }
    }
}

fn wanted(show: &Show, module: String) -> Drawn {
    Drawn {
        from: show.from,
        module,
        data: show.data.clone(),
        rate: Rate::hz(show.rate.unwrap_or(0.0)),
        way: None,
        refused: false,
    }
}

/// What a value needs besides itself to be drawn.
struct Drawer<'a> {
    /// Whose pose carries scanners that do not know their own.
    carrier: &'a str,
    context: &'a Context,
}

impl Drawer<'_> {
    fn draw(&self, scene: &mut Scene, drawn: &Drawn, bytes: &[u8]) -> Result<(), DrawError> {
        let Some(way) = &drawn.way else { return Ok(()) };
        let module = &drawn.module;
        match way.kind {
            Kind::Scan => read(drawn, bytes, |scan: LaserScan| {
                scan.pose.iter().try_for_each(|pose| scene.pose(module, pose))?;
                scene.scan(module, &scan, self.carrier, &Pose::default())
            }),
            Kind::Odometry => read(drawn, bytes, |odometry: Odometry| scene.odometry(module, &odometry)),
            Kind::Pose => read(drawn, bytes, |pose: Pose| scene.pose(module, &pose)),
            Kind::Grid => read(drawn, bytes, |grid: OccupancyGrid| scene.grid(module, &grid)),
            Kind::Line => read(drawn, bytes, |line: OutputLine| {
                scene.set_time(line.time_ns);
                let module = self.context.installation().classes.format(line.module());
                scene.output_line(&module, level(line.level), &line.text)
            }),
            Kind::Unknown => match decode(&way.item.ty, bytes) {
                Ok(value) => scene.generic(module, &drawn.data, &value),
                Err(error) => {
                    tracing::warn!("{} of {module} is not what its description says: {error}", drawn.data);
                    Ok(())
                }
            },
        }
    }
}

fn read<T: Data>(drawn: &Drawn, bytes: &[u8], draw: impl FnOnce(T) -> Result<(), DrawError>) -> Result<(), DrawError> {
    match rohrpost::macro_support::from_bytes(bytes) {
        Ok(value) => draw(value),
        Err(error) => {
            tracing::warn!("{} of {} cannot be read: {error}", drawn.data, drawn.module);
            Ok(())
        }
    }
}

fn level(level: OutputLevel) -> Level {
    match level {
        OutputLevel::Error => Level::Error,
        OutputLevel::Warn => Level::Warning,
        OutputLevel::Info => Level::Info,
        OutputLevel::Debug | OutputLevel::Trace => Level::Debug,
    }
}

impl Bridge {
    /// Asks for the descriptions that are missing, and subscribes to what they tell.
    fn subscribe(&mut self, context: &mut Context) {
        for drawn in self.drawn.iter_mut().filter(|drawn| drawn.way.is_none() && !drawn.refused) {
            let description = match rohrpost::describe(&mut context.link().borrow_mut(), drawn.from, PATIENCE) {
                Ok(description) => description,
                Err(error) => {
                    tracing::debug!("{} does not describe itself yet: {error}", drawn.module);
                    continue;
                }
            };
            let Some(item) = description.data_item(&drawn.data).cloned() else {
                drawn.refused = true;
                let names: Vec<&str> = description.data.iter().map(|item| item.name.as_str()).collect();
                let (module, data) = (&drawn.module, &drawn.data);
                tracing::warn!("{module} has no data `{data}` to draw; it has: {}", names.join(", "));
                continue;
            };
            if let (Kind::Line, Some(scene)) = (kind_of(&item), &mut self.scene) {
                earlier_lines(scene, drawn.from, context);
            }
            let subscription = context.subscribe_untyped(drawn.from, item.number, description.hash(), drawn.rate);
            drawn.way = Some(Way { subscription, kind: kind_of(&item), item });
        }
    }
}

/// Draws what was said before the bridge began to listen; a line that comes twice does no harm.
fn earlier_lines(scene: &mut Scene, collector: Name, context: &Context) {
    let proxy = CollectorProxy::new(context.link(), collector).with_timeout(PATIENCE);
    let mut next = 0;
    while let Ok(page) = proxy.lines_from(next) {
        for line in &page.lines {
            scene.set_time(line.time_ns);
            let module = context.installation().classes.format(line.module());
            // What cannot be drawn is missing from a picture; nothing else depends on it.
            let _ = scene.output_line(&module, level(line.level), &line.text);
        }
        next = page.first + page.lines.len() as u64;
        if page.lines.is_empty() || next >= page.next {
            break;
        }
    }
}

fn kind_of(item: &rohrpost::description::DataItem) -> Kind {
    let known = [
        (LaserScan::schema(), Kind::Scan),
        (Odometry::schema(), Kind::Odometry),
        (Pose::schema(), Kind::Pose),
        (OccupancyGrid::schema(), Kind::Grid),
        (OutputLine::schema(), Kind::Line),
    ];
    known.into_iter().find(|(schema, _)| *schema == item.ty).map_or(Kind::Unknown, |(_, kind)| kind)
}

fn states(scene: &mut Scene, survey: &Survey, context: &Context) -> Result<(), DrawError> {
    for module in &survey.modules {
        let name = context.installation().classes.format(module.name);
        let state = match &module.process {
            Some(process) => process.state.map_or("starting", ModuleState::name),
            None => "dead",
        };
        scene.module_state(&name, state, "")?;
    }
    Ok(())
}

fn charts(scene: &mut Scene, survey: &Survey, last: &Survey, context: &Context) -> Result<(), DrawError> {
    let seconds = survey.at.duration_since(last.at).as_secs_f64();
    for class in &survey.classes {
        let name = class.class.and_then(|id| context.installation().classes.name(id)).unwrap_or("others");
        let before = last.classes.iter().find(|earlier| earlier.class == class.class);
        let received = class.received - before.map_or(0, |before| before.received.min(class.received));
        scene.traffic(name, received as f64 / seconds, class.lost_in_all())?;
        let waited = before.map_or(class.latency.clone(), |before| class.latency.since(&before.latency));
        let us = |share| waited.quantile(share).map(|time| time.as_secs_f64() * 1e6);
        if let (Some(p50_us), Some(p99_us)) = (us(0.5), us(0.99)) {
            scene.latency(name, p50_us, p99_us)?;
        }
    }
    Ok(())
}
