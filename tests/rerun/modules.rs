//! The modules of a robot that measures itself: a source of beats and drawable data, and a sink that measures delays.
//!
//! Launch starts this test program with the one test [`module`] to run.

use super::load::on_one_processor;
use rohrpost::serde::Deserialize;
use rohrpost::types::{Image, ImageFormat, LaserScan, OccupancyGrid, Odometry, Pose, Twist};
use rohrpost::{Context, Module, ModuleError, Rate, Received, Subscription};
use rohrpost_mailbox::monotonic_ns;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

pub(crate) const BEAT: Duration = Duration::from_millis(5);
/// A picture has 108 KiB.
const PICTURE_SIDE_PX: u32 = 192;
/// Rows of data that are sent in a beat while there is a flood.
const FLOOD: u64 = 8;

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    let Some(name) = std::env::var_os("ROHRPOST_MODULE") else { return };
    let is_source = name.to_string_lossy().starts_with("source");
    let run = || if is_source { rohrpost::run::<Source>() } else { rohrpost::run::<Sink>() };
    let code = on_one_processor(run);
    std::process::exit(i32::from(code != std::process::ExitCode::SUCCESS));
}

/// An event, as an entity of its own in a drawing.
#[rohrpost::data]
#[derive(Clone, Debug)]
pub(crate) enum Mark {
    /// The beginning.
    Begun(u64),
    /// The viewer was frozen for a while.
    Frozen(u64),
    /// The viewer was killed and another one started.
    Killed(u64),
    /// The same in a flood.
    Flooded(u64),
}

/// Delays of beats.
#[rohrpost::data]
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Times {
    /// Beats since the last question.
    pub(crate) beats: u64,
    /// From the time when a beat was due to its receipt, ns; the median.
    pub(crate) p50_ns: u64,
    /// Beats lost since the start.
    pub(crate) lost: u64,
}

/// Sends.
#[rohrpost::interface(class = "source")]
pub(crate) trait Sending {
    /// Sends a mark.
    #[command(16)]
    fn mark(&mut self, mark: Mark);

    /// Begins or ends a flood of other data.
    #[command(17)]
    fn flood(&mut self, on: bool);

    /// When the beat was due, on the monotonic clock.
    #[data(1)]
    fn beat() -> u64;

    #[data(2)]
    fn scan() -> LaserScan;

    #[data(3)]
    fn odometry() -> Odometry;

    #[data(4)]
    fn map() -> OccupancyGrid;

    #[data(5)]
    fn marks() -> Mark;

    #[data(6)]
    fn noise() -> Vec<u64>;

    /// Larger than a package.
    #[stream(7)]
    fn picture() -> Image;
}

/// Receives.
#[rohrpost::interface(class = "sink")]
pub(crate) trait Receiving {
    /// Figures since the last question.
    #[command(16)]
    fn take(&mut self) -> Times;
}

#[derive(Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields, rename_all = "kebab-case")]
struct SourceSettings {
    /// Ask the viewer at this port before each beat, as a robot must never do: it shows that the test can fail.
    ask_viewer: Option<u16>,
}

struct Source {
    settings: SourceSettings,
    /// On the monotonic clock, which ticks go by too.
    began_ns: Option<u64>,
    beats: u64,
    mark: Option<Mark>,
    flood: bool,
}

impl Module for Source {
    type Settings = SourceSettings;
    type Interfaces = SendingInterface;

    fn new(settings: SourceSettings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(BEAT);
        Ok(Self { settings, began_ns: None, beats: 0, mark: None, flood: false })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let Some(began_ns) = self.began_ns else {
            // Beats are due from here on: the first tick was late, and would set the grid of all others.
            self.began_ns = Some(monotonic_ns());
            context.set_period(BEAT);
            return Ok(());
        };
        let beat_ns = BEAT.as_nanos() as u64;
        let due_ns = began_ns + (monotonic_ns() - began_ns) / beat_ns * beat_ns;
        if let Some(port) = self.settings.ask_viewer {
            ask(port);
        }
        context.publish_now(SendingInterface::BEAT, &due_ns)?;
        self.beats += 1;
        let turn = self.beats as f32 * 0.01;
        if self.beats.is_multiple_of(5) {
            let ranges_m = (0..361).map(|beam| 3.0 + (turn + beam as f32 * 0.1).sin()).collect();
            let scan = LaserScan { start_rad: -1.5, step_rad: 0.01, range_max_m: 8.0, ranges_m, pose: None };
            context.publish_now(SendingInterface::SCAN, &scan)?;
            let pose = Pose { x_m: f64::from(turn.cos()), y_m: f64::from(turn.sin()), heading_rad: f64::from(turn) };
            context.publish_now(SendingInterface::ODOMETRY, &Odometry { pose, twist: Twist::default() })?;
            let (now_ns, image) = (context.now().ns, Image::empty(PICTURE_SIDE_PX, PICTURE_SIDE_PX, ImageFormat::Rgb8));
            let mut open = context.begin(SendingInterface::PICTURE, now_ns)?;
            open.fill(&image, image.raw_bytes() as usize)?.fill(self.beats as u8);
            open.finish()?;
        }
        if self.beats.is_multiple_of(20) {
            context.publish_now(SendingInterface::MAP, &patch(self.beats / 20))?;
        }
        if let Some(mark) = self.mark.take() {
            context.publish_now(SendingInterface::MARKS, &mark)?;
        }
        for _ in 0..if self.flood { FLOOD } else { 0 } {
            context.publish_now(SendingInterface::NOISE, &vec![self.beats; 60])?;
        }
        Ok(())
    }
}

/// One of 64 patches of a map, in turn.
fn patch(number: u64) -> OccupancyGrid {
    let (column, row) = (number % 8, number / 8 % 8);
    let origin = Pose { x_m: column as f64 * 3.2, y_m: row as f64 * 3.2, heading_rad: 0.0 };
    let cells = (0..64 * 64).map(|cell| if (cell + number).is_multiple_of(7) { 100 } else { 0 }).collect();
    OccupancyGrid { origin, resolution_m: 0.05, columns: 64, rows: 64, cells }
}

/// A call as a module would make it, with a module's timeout.
fn ask(port: u16) {
    let Ok(mut viewer) = TcpStream::connect(("127.0.0.1", port)) else { return };
    let _ = viewer.set_read_timeout(Some(4 * BEAT));
    let _ = viewer.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n");
    let _ = viewer.read(&mut [0; 9]);
}

impl Sending for Source {
    fn mark(&mut self, mark: Mark) {
        self.mark = Some(mark);
    }

    fn flood(&mut self, on: bool) {
        self.flood = on;
    }
}

#[derive(Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields)]
struct SinkSettings {}

struct Sink {
    beat: Subscription<u64>,
    late_ns: Vec<u64>,
    expected: u32,
    lost: u64,
}

impl Module for Sink {
    type Settings = SinkSettings;
    type Interfaces = ReceivingInterface;

    fn new(_: SinkSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let beat = context.subscribe(SendingInterface::BEAT, "source.0", Rate::Each)?;
        Ok(Self { beat, late_ns: Vec::new(), expected: 0, lost: 0 })
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        if let Some(due_ns) = data.read(&self.beat)? {
            self.late_ns.push(monotonic_ns() - due_ns);
            self.lost += u64::from(data.head.sequence.wrapping_sub(self.expected));
            self.expected = data.head.sequence + 1;
        }
        Ok(())
    }
}

impl Receiving for Sink {
    fn take(&mut self) -> Times {
        self.late_ns.sort_unstable();
        let p50_ns = self.late_ns.get(self.late_ns.len() / 2).copied().unwrap_or(0);
        let beats = self.late_ns.len() as u64;
        self.late_ns.clear();
        Times { beats, p50_ns, lost: self.lost }
    }
}
