//! A drawing in Rerun: opened once, told the time, then told what happens.

use crate::sink::{self, Connection, OpenError, Sink};
use crate::{blueprint, charts::Charts, generic::Texts, states::States, world::World};
use rerun::{ApplicationId, AsComponents, EntityPath, EntityPathPart, RecordingStream, TimeCell};
use std::{marker::PhantomData, rc::Rc, time::Duration};

/// The timeline of system time: nanoseconds since 1970, as all nodes of an installation agree on it.
pub(crate) const SYSTEM_TIME: &str = "system_time";
/// The timeline that begins with the scene.
pub(crate) const ROBOT_TIME: &str = "robot_time";

/// Why something could not be drawn. The scene goes on; only this one thing is missing.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// A map says that it has other cells than it brings.
    #[error("map of {module}: {columns} x {rows} cells announced, {cells} there; its sender is at fault")]
    Shape {
        /// Who sent it.
        module: String,
        /// Cells in a row, as announced.
        columns: u32,
        /// Rows, as announced.
        rows: u32,
        /// Cells that came.
        cells: usize,
    },
    /// A map's place or its cells' size are not finite, or its cells have no size.
    #[error("map of {0}: its origin or its resolution is not a usable number; its sender is at fault")]
    Place(String),
    /// A map came in more tiles than a scene keeps.
    #[error("map of {0}: more than {max} tiles; send larger ones", max = crate::TILES_MAX)]
    Tiles(String),
    /// Rerun could not take it: a bug in this crate.
    #[error("Rerun refused a row: {0}")]
    Rerun(#[from] rerun::RecordingStreamError),
}

/// Why the last of a drawing may be missing.
#[derive(Debug, thiserror::Error)]
pub enum CloseError {
    /// The sink did not take all: the disk is full, or the viewer went away.
    #[error("the end of the drawing did not arrive: {0}")]
    Flush(#[from] rerun::sink::SinkFlushError),
    /// Rerun could not take the layout: a bug in this crate.
    #[error("Rerun refused the layout: {0}")]
    Layout(#[from] rerun::RecordingStreamError),
}

/// A drawing of one installation.
///
/// It stays in the thread that opened it: Rerun keeps the present time of a stream for each thread.
///
/// ```
/// use rohrpost_gui_bridge::{Scene, Sink};
/// use rohrpost::types::Pose;
///
/// let file = std::env::temp_dir().join(format!("scene-doc-{}.rrd", std::process::id()));
/// let mut scene = Scene::open("lab", &Sink::File(file.clone()), 1_700_000_000_000_000_000)?;
/// scene.set_time(1_700_000_001_000_000_000);
/// scene.pose("slam.0", &Pose { x_m: 1.0, ..Pose::default() })?;
/// scene.close()?; // or drop it: then nobody hears that the disk is full
/// # std::fs::remove_file(file)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Scene {
    stream: RecordingStream,
    start_ns: u64,
    one_thread: PhantomData<Rc<()>>,
    pub(crate) world: World,
    pub(crate) states: States,
    pub(crate) charts: Charts,
    pub(crate) texts: Texts,
}

impl Scene {
    /// Opens a drawing of `installation` in `sink`; robot time 0 is `system_time_ns`.
    pub fn open(installation: &str, sink: &Sink, system_time_ns: u64) -> Result<Self, OpenError> {
        // Viewers keep a layout for each application: what somebody arranged for one installation stays with it.
        let application = ApplicationId::new_or_unknown(format!("rohrpost-{installation}"));
        Self::over(sink::open(application, sink)?, system_time_ns)
    }

    /// The same over a stream that is open.
    pub(crate) fn over(stream: RecordingStream, system_time_ns: u64) -> Result<Self, OpenError> {
        // When and in which order the bridge got to a package says nothing about the robot.
        stream.set_log_time_enabled(false);
        stream.set_log_tick_enabled(false);
        blueprint::send(&stream)?;
        let mut scene = Self {
            stream,
            start_ns: system_time_ns,
            one_thread: PhantomData,
            world: World::default(),
            states: States::default(),
            charts: Charts::default(),
            texts: Texts::default(),
        };
        scene.set_time(system_time_ns);
        scene.prepare_world()?;
        Ok(scene)
    }

    /// What is drawn from now on happens at this system time.
    pub fn set_time(&mut self, system_time_ns: u64) {
        let since_start = i128::from(system_time_ns) - i128::from(self.start_ns);
        // i64::MIN is Rerun's "no time"; 292 years are enough on either side.
        let bounded = |ns: i128| ns.clamp(-i128::from(i64::MAX), i128::from(i64::MAX)) as i64;
        let system = TimeCell::from_timestamp_nanos_since_epoch(bounded(i128::from(system_time_ns)));
        self.stream.set_time(SYSTEM_TIME, system);
        self.stream.set_time(ROBOT_TIME, TimeCell::from_duration_nanos(bounded(since_start)));
    }

    /// How the scene stands with its sink. Waits `patience` at most; ask about once a second.
    pub fn connection(&self, patience: Duration) -> Connection {
        sink::connection(&self.stream, patience)
    }

    /// Sends what waits, and waits until it has arrived; a viewer that was never there costs 5 s.
    pub fn flush(&self, patience: Duration) -> Result<(), rerun::sink::SinkFlushError> {
        self.stream.flush_with_timeout(patience)
    }

    /// Writes all and closes the drawing; a file gets its footer.
    ///
    /// It also gets the layout once more, at its end: a view takes its bounds from what is loaded when it first appears
    /// and the views of the layout at the beginning may have seen but a part of it.
    pub fn close(self) -> Result<(), CloseError> {
        blueprint::send(&self.stream)?;
        Ok(self.flush(Duration::from_secs(10))?)
    }

    /// Draws at the present time.
    pub(crate) fn log(&self, entity: EntityPath, what: &dyn AsComponents) -> Result<(), DrawError> {
        Ok(self.stream.log(entity, what)?)
    }

    /// Draws for all times.
    pub(crate) fn log_static(&self, entity: EntityPath, what: &dyn AsComponents) -> Result<(), DrawError> {
        Ok(self.stream.log_static(entity, what)?)
    }
}

/// An entity by its parts, which may hold any character.
pub(crate) fn entity(parts: &[&str]) -> EntityPath {
    EntityPath::new(parts.iter().map(|part| EntityPathPart::new(*part)).collect())
}
