//! The built-in module `logd`: records what `[record]` of the configuration names into files (`rohrpost-recording`).
//!
//! ```text
//! records of streams, in place ──┐
//! data, lines of output ─────────┴─▶ Taps: chosen, losses counted ─▶ Writer: memory ─▶ its thread ─▶ NODE-0001.mcap, …
//!
//! files that an earlier run left open ─▶ leftovers: a thread ─▶ NODE-0001.recovered.mcap
//!
//! log control: by the interface, by TCP ─▶ orders ─▶ Writer, at their place among the messages
//! ```
//!
//! The module's thread copies each value once, from the ring or the mailbox into memory, and never waits for the disk.

mod blame;
mod control;
mod earlier;
mod folder;
mod health;
mod leftovers;
mod obey;
mod sampler;
mod tap;
mod taps;

use control::{ControlServer, Orders, Told};
use earlier::EarlierFiles;
use health::Health;
use rohrpost::interfaces::{ChannelPage, LostBy, RecordedMessages, Recorder, RecorderInterface, RecordingState};
use rohrpost::output::errno_of;
use rohrpost::{Context, Module, ModuleClock, ModuleError, Ready, Received, Start, StartError};
use rohrpost_config::{Installation, Recording};
use rohrpost_mailbox::TimeSource;
use rohrpost_modules::NoSettings;
use rohrpost_recording::{
    ControlAnswer, ControlCommand, DrawnBeside, Earlier, LossCause, Losses, Options, Rotation, Session, Status, Writer,
};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use taps::Taps;

/// What begins to run is looked for so often, and problems of the disk are told within this time.
const PERIOD: Duration = Duration::from_millis(200);
/// Bytes of channels in a page, so that it fits in any reply mailbox.
const PAGE_BYTES: usize = 2500;
/// Most bytes that a channel has besides its topic: the topic's length, two counts, and one for each cause of losses.
const NUMBERS_BYTES: usize = 2 + 10 + 10 + LossCause::ALL.len() * 10;

/// Runs the recorder of a node, until it is told to end.
///
/// # Errors
/// See [`StartError`].
pub fn run(start: Start) -> Result<(), StartError> {
    rohrpost_modules::runtime::run_started::<Logd>(start)
}

struct Logd {
    options: Options,
    session: Session,
    taps: Taps,
    /// None while nothing is recorded.
    writer: Option<Writer>,
    /// One that takes no more, and still writes.
    ending: Option<Writer>,
    /// How the one before ended.
    ended: ControlAnswer,
    /// What came last before the next recording, while nothing is recorded.
    earlier: Option<Earlier>,
    health: Health,
    /// Log control leads to folders below it.
    root: PathBuf,
    /// Permissions of those that it makes: the node's.
    folder_mode: u32,
    clock: ModuleClock,
    orders: Orders,
    control: ControlServer,
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
        let folder_mode = installation.node(&node).map_or(0o700, |node| node.mode);
        // Those above it may be where a disk is to be mounted. What is wrong the writer tells as soon as it needs it.
        let _ = folder::make(&recording.directory, folder_mode);
        // Before there is a file of this run.
        leftovers::recover(&recording.directory, &node, recording.leave_free)?;
        let options = Options { mode: folder_mode & 0o666, ..options(recording, installation, &node) };
        let session = session(installation, &node);
        let earlier = EarlierFiles::find(&recording.directory, &node);
        let taps = Taps::new(installation, recording.clone(), (context.me(), &node), earlier);
        if let Some(note) = recording.control_note() {
            tracing::warn!("{note}");
        }
        let (root, control) = (recording.directory.clone(), ControlServer::new(recording.control));
        // It serves the computer's disk: also while the robot's time stands still.
        context.use_computer_clock();
        context.set_period(PERIOD);
        context.take_all_at_end();
        Ok(Self {
            options,
            session,
            taps,
            writer: None,
            ending: None,
            ended: ControlAnswer::ok(),
            earlier: None,
            health: Health::default(),
            root,
            folder_mode,
            clock: context.clock().clone(),
            orders: Orders::default(),
            control,
        })
    }

    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.begin()?;
        self.find(context)?;
        self.control.open(context, Instant::now());
        Ok(())
    }

    /// Ends the recording: its file is closed whole.
    fn off(&mut self, context: &mut Context) {
        self.control.close(context);
        for writer in self.ending.take().into_iter().chain(self.writer.take()) {
            self.finish(writer);
        }
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.taps.begin_pace();
        self.find(context)?;
        let status = self.writer.as_ref().map(Writer::status);
        if let Some(status) = &status {
            // It cannot work without its thread; launch restarts it.
            assert!(status.is_running, "the thread that writes has ended");
            self.health.tell(status, Instant::now());
        }
        context.complain(match &status {
            None => "records nothing: log control has switched it off",
            Some(_) => self.health.complaint(),
        });
        context.publish_now(RecorderInterface::STATE, &status.as_ref().map(state).unwrap_or_default())?;
        self.control.open(context, Instant::now());
        self.look_at_orders();
        self.serve(context);
        Ok(())
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        match self.writer.as_mut() {
            Some(writer) if has_begun(context.clock()) => self.taps.take(writer, context, data),
            _ => self.taps.pass_over(self.earlier.as_mut(), &context.now(), data),
        }
        Ok(())
    }

    fn ready(&mut self, context: &mut Context, ready: Ready) -> Result<(), ModuleError> {
        self.control.ready(context, ready, Instant::now());
        self.serve(context);
        Ok(())
    }
}

impl Logd {
    /// A recording begins.
    fn begin(&mut self) -> Result<(), rohrpost_recording::StartError> {
        let mut writer = Writer::start_behind(self.earlier.take(), self.options.clone(), self.session.clone())?;
        self.health = Health::default();
        self.taps.begin(&mut writer);
        self.writer = Some(writer);
        Ok(())
    }

    /// Waits until all is written. How it ended is for log control, the newest messages are for the next recording.
    fn finish(&mut self, mut writer: Writer) {
        let mut earlier = self.earlier.take().unwrap_or_else(|| writer.passed_over());
        if let Some(newest) = writer.take_newest() {
            earlier.fill(newest);
        }
        self.earlier = Some(earlier);
        let (Status { written, lost, losses, files_closed, files_torn, .. }, told) = writer.finish();
        let files = files_closed + files_torn;
        let why = if lost > 0 { format!(" ({})", losses.text()) } else { String::new() };
        tracing::info!("recorded {written} messages, {lost} lost{why}, in {files} files");
        self.ended = match told {
            Ok(()) => ControlAnswer::ok().with("written", written).with("lost", lost).with("files", files),
            Err(error) => {
                tracing::error!(errno = errno_of(&error), "the recording could not be ended: {error}");
                ControlAnswer::err(&format!("the recording is off, but could not be ended: {error}"))
            }
        };
    }

    fn find(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        let has_begun = has_begun(context.clock());
        self.taps.find(context, writer, has_begun)
    }

    /// Obeys what connections say, as far as it goes without waiting.
    fn serve(&mut self, context: &mut Context) {
        let now = Instant::now();
        self.control.tell(|order| self.orders.take_answer(order), now);
        while let Some((client, command)) = self.control.next_command() {
            match command.map_or_else(|error| Told::Now(ControlAnswer::err(&error)), |command| self.obey(command)) {
                Told::Now(answer) => self.control.answer(client, &answer, now),
                Told::Later(order) => {
                    self.control.wait_for(client, order);
                    self.control.tell(|order| self.orders.take_answer(order), now);
                }
            }
        }
        self.control.watch(context, now);
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
        let rest = rest.map(|its| RecordedMessages {
            topic: its.topic,
            written: its.written,
            lost: its.lost,
            lost_by: by_cause(&its.losses),
        });
        ChannelPage { total, channels: rest.take_while(fits).collect() }
    }

    fn order(&mut self, line: String) -> u32 {
        let command = line.parse::<ControlCommand>();
        match command.map_or_else(|error| Told::Now(ControlAnswer::err(&error)), |command| self.obey(command)) {
            Told::Now(answer) => self.orders.add_answered(answer),
            Told::Later(order) => order,
        }
    }

    fn answer(&mut self, order: u32) -> Option<String> {
        self.orders.answer(order).map(|answer| answer.line().to_owned())
    }
}

/// Whether there is a time at which something can arrive: that of a log begins with its player.
fn has_begun(clock: &ModuleClock) -> bool {
    clock.record().is_none_or(|record| record.source != TimeSource::Log || record.is_known())
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
        root: Some(recording.directory.clone()),
        ..Options::new(&recording.directory, node)
    }
}

fn session(installation: &Installation, node: &str) -> Session {
    let file_name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut configuration = BTreeMap::from([(file_name(&installation.shown), installation.text.clone())]);
    // Without such a file there is nothing to say of it; that it cannot be read, was said at the start.
    let saved = installation.parameters.as_ref().and_then(|path| Some((path, std::fs::read_to_string(path).ok()?)));
    configuration.extend(saved.map(|(path, text)| (file_name(path), text)));
    let versions = BTreeMap::from([("rohrpost".to_owned(), rohrpost::common::versions())]);
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
        lost_by: by_cause(&status.losses),
        waiting: status.waiting,
        bytes: status.bytes,
        files_closed: status.files_closed,
        files_torn: status.files_torn,
    }
}

fn by_cause(losses: &Losses) -> LostBy {
    let [way, away, recorder, processor, disk, long] = LossCause::ALL.map(|cause| losses[cause]);
    LostBy { way, away, recorder, processor, disk, long }
}
