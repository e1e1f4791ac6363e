//! The built-in module `logd`: records what `[record]` of the configuration names into files (`rohrpost-recording`).
//!
//! ```text
//! records of streams, in place ──┐
//! data, lines of output ─────────┴─▶ Taps: chosen, losses counted ─▶ Writer: memory ─▶ its thread ─▶ NODE-0001.mcap, …
//!
//! files that an earlier run left open ─▶ leftovers: a thread ─▶ NODE-0001.recovered.mcap
//! ```
//!
//! The module's thread copies each value once, from the ring or the mailbox into memory, and never waits for the disk.

mod health;
mod leftovers;
mod sampler;
mod taps;

use crate::router::NoSettings;
use crate::version;
use health::Health;
use rohrpost::interfaces::{ChannelPage, RecordedMessages, Recorder, RecorderInterface, RecordingState};
use rohrpost::{Context, Module, ModuleError, Received, Start, StartError};
use rohrpost_config::{Installation, Recording};
use rohrpost_mailbox::TimeSource;
use rohrpost_recording::{DrawnBeside, Options, Rotation, Session, Status, Writer};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};
use taps::Taps;

/// What begins to run is looked for so often, and problems of the disk are told within this time.
const PERIOD: Duration = Duration::from_millis(200);
/// Bytes of channels in a page, so that it fits in any reply mailbox.
const PAGE_BYTES: usize = 2500;
/// Most bytes that a channel has besides its topic: the topic's length, and two counts.
const NUMBERS_BYTES: usize = 2 + 10 + 10;

pub(super) fn run(start: Start) -> Result<(), StartError> {
    rohrpost_modules::runtime::run_started::<Logd>(start)
}

struct Logd {
    options: Options,
    session: Session,
    taps: Taps,
    /// None while it is switched off.
    writer: Option<Writer>,
    health: Health,
}

impl Module for Logd {
    type Settings = NoSettings;
    type Interfaces = RecorderInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let installation = context.installation();
        let recording = installation.record.as_ref();
        let recording = recording.ok_or_else(|| ModuleError::new("the configuration has no [record]"))?;
        let node = installation.node_of(context.me());
        let node = node.ok_or_else(|| ModuleError::new("it is not in the configuration"))?.to_owned();
        make(&recording.directory);
        // Before there is a file of this run.
        leftovers::recover(&recording.directory, &node, recording.leave_free)?;
        let options = options(recording, installation, &node);
        let session = session(installation, &node);
        let taps = Taps::new(installation, recording.clone(), context.me(), &node);
        // It serves the computer's disk: also while the robot's time stands still.
        context.use_computer_clock();
        context.set_period(PERIOD);
        Ok(Self { options, session, taps, writer: None, health: Health::default() })
    }

    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let mut writer = Writer::start(self.options.clone(), self.session.clone())?;
        self.health = Health::default();
        self.taps.begin(&mut writer);
        self.taps.find(context, &mut writer)?;
        self.writer = Some(writer);
        Ok(())
    }

    /// Ends the recording: its file is closed whole.
    fn off(&mut self, _: &mut Context) {
        let Some(writer) = self.writer.take() else { return };
        let (Status { written, lost, files_closed, files_torn, .. }, told) = writer.finish();
        tracing::info!("recorded {written} messages, {lost} lost, in {} files", files_closed + files_torn);
        if let Err(error) = told {
            tracing::error!("the recording could not be ended: {error}");
        }
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        self.taps.find(context, writer)?;
        let status = writer.status();
        // It cannot work without its thread; launch restarts it.
        assert!(status.is_running, "the thread that writes has ended");
        self.health.tell(&status, Instant::now());
        context.publish_now(RecorderInterface::STATE, &state(&status))?;
        Ok(())
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        if let Some(writer) = self.writer.as_mut().filter(|_| has_begun(context)) {
            self.taps.take(writer, &context.now(), data);
        }
        Ok(())
    }
}

impl Recorder for Logd {
    fn recording(&mut self) -> RecordingState {
        self.writer.as_ref().map(|writer| state(&writer.status())).unwrap_or_default()
    }

    fn channels(&mut self, from: u32) -> ChannelPage {
        let channels = self.writer.as_ref().map(|writer| writer.status().channels).unwrap_or_default();
        let mut bytes = 0;
        let total = channels.len() as u32;
        let fits = |channel: &RecordedMessages| {
            bytes += channel.topic.len() + NUMBERS_BYTES;
            bytes <= PAGE_BYTES
        };
        let rest = channels.into_iter().skip(from as usize);
        let rest = rest.map(|its| RecordedMessages { topic: its.topic, written: its.written, lost: its.lost });
        ChannelPage { total, channels: rest.take_while(fits).collect() }
    }
}

/// Whether there is a time at which something can arrive: that of a log begins with its player.
fn has_begun(context: &Context) -> bool {
    context.clock().record().is_none_or(|record| record.source != TimeSource::Log || record.is_known())
}

/// Makes the folder itself, and none above it: those may be where a disk is to be mounted.
fn make(directory: &Path) {
    // Whatever is wrong with it, the writer tells as soon as it needs it.
    let _ = std::fs::create_dir(directory);
}

fn options(recording: &Recording, installation: &Installation, node: &str) -> Options {
    let classes = || installation.classes.iter().map(|entry| (entry.class.0, entry.name.clone())).collect();
    let drawn = |rate_hz: f64| DrawnBeside { period_ns: (1e9 / rate_hz) as u64, classes: classes() };
    Options {
        drawn: recording.drawn.map(drawn),
        rotation: Rotation { bytes_max: recording.rotate_size, age_max: recording.rotate_after },
        flush: recording.flush,
        sync: recording.sync,
        leave_bytes: recording.leave_free,
        ..Options::new(&recording.directory, node)
    }
}

fn session(installation: &Installation, node: &str) -> Session {
    let file_name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut configuration = BTreeMap::from([(file_name(&installation.shown), installation.text.clone())]);
    // Without such a file there is nothing to say of it; that it cannot be read, was said at the start.
    let saved = installation.parameters.as_ref().and_then(|path| Some((path, std::fs::read_to_string(path).ok()?)));
    configuration.extend(saved.map(|(path, text)| (file_name(path), text)));
    let versions = BTreeMap::from([("rohrpost".to_owned(), version::text().to_owned())]);
    Session { node: node.into(), versions, configuration }
}

fn state(status: &Status) -> RecordingState {
    RecordingState {
        file: status.file.as_ref().map(|path| path.display().to_string()),
        problem: status.problem.as_ref().map(|problem| problem.error.to_string()),
        channels: status.channels.len() as u32,
        written: status.written,
        synced: status.synced,
        unsure: status.unsure,
        lost: status.lost,
        waiting: status.waiting,
        bytes: status.bytes,
        files_closed: status.files_closed,
        files_torn: status.files_torn,
    }
}
