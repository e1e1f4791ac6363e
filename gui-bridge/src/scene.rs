//! A drawing in Rerun: opened once, told the time, then told what happens. Nothing here waits for Rerun.

use crate::blueprint::Layout;
use crate::sink::{CloseError, OpenError, Sink};
use crate::state::{Charts, Lane, ModuleStates, Texts, World};
use crate::store::{DrawingCounts, Row, Store};
use crate::supervisor::{self, StreamSupervisor, Turn};
use crate::team::known::TeamWorld;
use crate::team::look::Look;
use crate::timelines::{ROBOT_TIME, SYSTEM_TIME};
use rerun::{ApplicationId, AsComponents, EntityPath, EntityPathPart, TimeCell, TimePoint};
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// An entity is drawn at most so often a second, unless somebody says otherwise.
pub const RATE_HZ: f64 = 20.0;

/// The lowest limit: once in a hundred seconds.
pub const RATE_HZ_MIN: f64 = 0.01;

/// Where a scene's rows go: the store, or a test's list.
pub(crate) trait RowSink {
    fn put(&self, entity: EntityPath, row: Row);
    fn line(&self, entity: EntityPath, row: Row);
    fn arrange(&self, layout: Layout);
}

impl RowSink for Store {
    fn put(&self, entity: EntityPath, row: Row) {
        Store::put(self, entity, row);
    }

    fn line(&self, entity: EntityPath, row: Row) {
        Store::line(self, entity, row);
    }

    fn arrange(&self, layout: Layout) {
        Store::arrange(self, layout);
    }
}

/// A drawing of one installation.
///
/// Drawing never waits: what comes faster than the sink takes it, or than an entity's rate, is replaced by what comes
/// next.
///
/// ```
/// use rohrpost_gui_bridge::{RATE_HZ, Scene, Sink};
/// use rohrpost::types::Pose;
///
/// let file = std::env::temp_dir().join(format!("scene-doc-{}.rrd", std::process::id()));
/// let mut scene = Scene::open("lab", Sink::file(&file), RATE_HZ, 1_700_000_000_000_000_000)?;
/// scene.set_time(1_700_000_001_000_000_000);
/// scene.pose("slam.0", &Pose { x_m: 1.0, ..Pose::default() });
/// scene.close()?; // or drop it: then nobody hears that the disk is full
/// # std::fs::remove_file(file)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Scene {
    rows: Arc<dyn RowSink>,
    /// None in tests.
    drawing: Option<(Arc<Store>, StreamSupervisor)>,
    start_ns: u64,
    /// When what is drawn happens, and the same for Rerun.
    pub(crate) time_ns: u64,
    time: TimePoint,
    pub(crate) world: World,
    pub(crate) states: ModuleStates,
    pub(crate) charts: Charts,
    pub(crate) texts: Texts,
    pub(crate) team: TeamWorld,
    /// Robots of a team as they are drawn.
    pub(crate) looks: HashMap<u8, Look>,
    pub(crate) lanes: HashMap<EntityPath, Lane>,
}

impl Scene {
    /// Opens a drawing of `installation` in `sink`; robot time 0 is `system_time_ns`. No entity is drawn more often
    /// than `rate_hz`; 0 is no limit, and what is less than [`RATE_HZ_MIN`] is taken for that. Neither a viewer need be
    /// there yet, nor a disk: [`Scene::failure`] tells of a file that cannot be made.
    ///
    /// # Errors
    /// When the address is none.
    pub fn open(installation: &str, sink: Sink, rate_hz: f64, system_time_ns: u64) -> Result<Self, OpenError> {
        Self::open_in_turn(installation, sink, rate_hz, system_time_ns, Turn::default())
    }

    /// The same, after all others that had that turn.
    pub(crate) fn open_in_turn(
        installation: &str,
        sink: Sink,
        rate_hz: f64,
        system_time_ns: u64,
        turn: Turn,
    ) -> Result<Self, OpenError> {
        // Viewers keep a layout for each application: what somebody arranged for one installation stays with it.
        let application = ApplicationId::new_or_unknown(format!("rohrpost-{installation}"));
        let store = Arc::new(Store::new(period(rate_hz)));
        let supervisor = StreamSupervisor::begin(sink, application, store.clone(), turn)?;
        let mut scene = Self::over(store.clone(), system_time_ns);
        scene.drawing = Some((store, supervisor));
        Ok(scene)
    }

    /// The same over anything that takes rows.
    pub(crate) fn over(rows: Arc<dyn RowSink>, system_time_ns: u64) -> Self {
        let mut scene = Self {
            rows,
            drawing: None,
            start_ns: system_time_ns,
            time_ns: 0,
            time: TimePoint::default(),
            world: World::default(),
            states: ModuleStates::default(),
            charts: Charts::default(),
            texts: Texts::default(),
            team: TeamWorld::default(),
            looks: HashMap::new(),
            lanes: HashMap::new(),
        };
        scene.set_time(system_time_ns);
        scene.arrange(Layout::default());
        scene.prepare_world();
        scene
    }

    /// Robot time 0 is this system time: of a robot that had none before, since its log had not begun.
    pub(crate) fn begin_at(&mut self, system_time_ns: u64) {
        self.start_ns = system_time_ns;
        self.set_time(system_time_ns);
    }

    /// What is drawn from now on happens at this system time.
    pub fn set_time(&mut self, system_time_ns: u64) {
        self.time_ns = system_time_ns;
        let since_start = i128::from(system_time_ns) - i128::from(self.start_ns);
        // i64::MIN is Rerun's "no time"; 292 years are enough on either side.
        let bounded = |ns: i128| ns.clamp(-i128::from(i64::MAX), i128::from(i64::MAX)) as i64;
        let system = TimeCell::from_timestamp_nanos_since_epoch(bounded(i128::from(system_time_ns)));
        self.time.insert_cell(SYSTEM_TIME, system);
        self.time.insert_cell(ROBOT_TIME, TimeCell::from_duration_nanos(bounded(since_start)));
    }

    /// Why nothing is drawn any more, if so. A viewer that is away is no such reason: it is waited for.
    pub fn failure(&self) -> Option<String> {
        self.drawing.as_ref().and_then(|(_, supervisor)| supervisor.failure())
    }

    /// What became of all that was drawn.
    pub fn counts(&self) -> DrawingCounts {
        self.drawing.as_ref().map(|(store, _)| store.counts()).unwrap_or_default()
    }

    /// Waits until Rerun has taken all that was drawn, at most so long; tells whether it has. For programs that draw
    /// what is not happening now, and want all of it: a module never needs this.
    pub fn settle(&self, patience: Duration) -> bool {
        let Some((store, _)) = &self.drawing else { return true };
        let deadline = Instant::now() + patience;
        while !store.is_empty() {
            if Instant::now() >= deadline {
                return false;
            }
            std::thread::sleep(Duration::from_micros(200));
        }
        true
    }

    /// How the viewer arranges it.
    pub fn arrange(&mut self, layout: Layout) {
        self.rows.arrange(layout);
    }

    /// Draws what waits, within some seconds, and closes the drawing; a file gets its footer.
    ///
    /// # Errors
    /// When the last of it did not arrive.
    pub fn close(mut self) -> Result<(), CloseError> {
        self.drawing.take().map_or(Ok(()), |(_, supervisor)| supervisor.close_by(Instant::now() + supervisor::LAST))
    }

    /// Ends it without waiting: its supervisor draws what waits, and ends by itself.
    pub(crate) fn leave(mut self) -> Option<StreamSupervisor> {
        let (_, supervisor) = self.drawing.take()?;
        supervisor.leave();
        Some(supervisor)
    }

    /// Draws at the present time: any of Rerun's archetypes.
    pub fn log(&mut self, entity: EntityPath, what: &dyn AsComponents) {
        self.rows.put(entity, Row { time: Some(self.time.clone()), components: what.as_serialized_batches() });
    }

    /// Draws for all times.
    pub fn log_static(&mut self, entity: EntityPath, what: &dyn AsComponents) {
        self.rows.put(entity, Row { time: None, components: what.as_serialized_batches() });
    }

    /// Draws what happens now and is no state: the next one does not replace it. For small things, such as lines of
    /// text: what has more than [`crate::LINE_BYTES_MAX`] is dropped and counted.
    pub fn log_event(&mut self, entity: EntityPath, what: &dyn AsComponents) {
        self.rows.line(entity, Row { time: Some(self.time.clone()), components: what.as_serialized_batches() });
    }
}

/// Least time between two rows of an entity; 0 is no limit.
pub(crate) fn period(rate_hz: f64) -> Duration {
    let limit = rate_hz > 0.0;
    if limit { Duration::from_secs_f64(1.0 / rate_hz.max(RATE_HZ_MIN)) } else { Duration::ZERO }
}

impl Drop for Scene {
    fn drop(&mut self) {
        if let Some((_, supervisor)) = self.drawing.take() {
            // A caller that needs the result calls `close`.
            let _ = supervisor.close_by(Instant::now() + supervisor::LAST);
        }
    }
}

/// An entity by its parts, which may hold any character.
pub fn entity(parts: &[&str]) -> EntityPath {
    EntityPath::new(parts.iter().map(|part| EntityPathPart::new(*part)).collect())
}
