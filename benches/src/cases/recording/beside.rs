//! How long a package is on its way between two modules while a third process records, and while none does.

use super::recorder;
use super::workload::Workload;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    Cell, Child, End, Failure, Link, Meetings, OrFail, Pause, Scratch, Shared, Zeroable, given_away, interrupted,
    require_asleep, time_two_processes,
};
use rohrpost_bench_local::ours::{How, Mailboxes};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_recording::Message;
use std::path::Path;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Of the packages: a speed.
const BYTES: usize = 64;
/// Before each round trip: the other end goes to sleep meanwhile, so that all find it so.
const PAUSE: Duration = Duration::from_micros(100);
/// What is recorded meanwhile: 50 MB in a second, as scans of 62 kB.
const RECORDED_BYTES: usize = 62_000;
const RECORDED_PERIOD: Duration = Duration::from_micros(1240);
/// So many before the packages, so that the first chunks are written.
const RECORDED_FIRST: usize = 100;
/// The longest turn, with all that may halt it.
const PATIENCE: Duration = Duration::from_secs(120);

/// What the recording process and the others tell each other.
#[repr(C)]
struct RecordingTurn {
    /// It records.
    runs: AtomicU32,
    /// It has recorded enough.
    stops: AtomicU32,
}

// SAFETY: atomics only.
unsafe impl Zeroable for RecordingTurn {}

/// A pair of modules beside a recorder.
pub(super) fn case() -> Case {
    Case::new("pair beside 50 MB/s recorded", BYTES, "us", pair_beside)
}

fn pair_beside(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let cell = Cell { pause: Pause::Asleep(PAUSE), ..Cell::hop(BYTES, settings.count(Cell::HOP_MESSAGES)) };
    let contenders = [
        Contender::sampled("rohrpost", || while_recorded(|| pair(&cell))),
        Contender::sampled("without recorder", || pair(&cell)).beside(None, at_most(1.1)),
    ];
    Ok(compare(settings, subject, &contenders))
}

/// How often each end received, and gave its processor away meanwhile.
#[repr(C)]
struct PairTurn {
    received: [AtomicU64; 2],
    slept: [AtomicU64; 2],
}

// SAFETY: atomics only.
unsafe impl Zeroable for PairTurn {}

/// An end that tells at its end how often it slept.
struct CountedEnd<'a> {
    link: Mailboxes,
    end: usize,
    turn: &'a PairTurn,
    /// Given away before it received anything.
    before: Option<u64>,
}

impl<'a> CountedEnd<'a> {
    fn open(node: &Path, end: End, turn: &'a PairTurn, meetings: &mut Meetings) -> Result<Self, Failure> {
        let link = Mailboxes::open(node, end, BYTES, How::Blocking, meetings)?;
        Ok(Self { link, end: end.index(), turn, before: None })
    }
}

impl Link for CountedEnd<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.link.send(message)
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        if self.before.is_none() {
            self.before = Some(given_away(own_pid())?);
        }
        self.turn.received[self.end].fetch_add(1, Ordering::Relaxed);
        self.link.receive(message)
    }
}

impl Drop for CountedEnd<'_> {
    fn drop(&mut self) {
        let now = given_away(own_pid()).unwrap_or_default();
        self.turn.slept[self.end].store(now.saturating_sub(self.before.unwrap_or(now)), Ordering::Relaxed);
    }
}

fn own_pid() -> i32 {
    nix::unistd::getpid().as_raw()
}

/// One turn of the packages.
fn pair(cell: &Cell) -> Result<Vec<f64>, Failure> {
    let (scratch, turn) = (Scratch::new()?, Shared::<PairTurn>::new()?);
    let node = scratch.directory().join("node");
    let samples = time_two_processes(cell, |end, meetings| CountedEnd::open(&node, end, &turn, meetings))?;
    let [received, slept] =
        [&turn.received, &turn.slept].map(|counts| [0, 1].map(|end: usize| counts[end].load(Ordering::Relaxed)));
    // The first one also pauses before each.
    for (name, end, sleeps) in [("the first end", 0, 2), ("the second end", 1, 1)] {
        require_asleep(name, received[end] * sleeps, slept[end])?;
    }
    Ok(samples)
}

/// Does it while a process of its own records.
fn while_recorded(turn: impl FnOnce() -> Result<Vec<f64>, Failure>) -> Result<Vec<f64>, Failure> {
    let folder = Scratch::new()?;
    let shared = Shared::<RecordingTurn>::new()?;
    let mut recorder = Child::start(|| record(&folder.directory(), &shared))?;
    while shared.runs.load(Ordering::Relaxed) == 0 && !recorder.has_ended()? && !interrupted() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let samples = turn();
    shared.stops.store(1, Ordering::Relaxed);
    // That it could not record says more than figures without it.
    recorder.finish(Instant::now() + PATIENCE)?;
    samples
}

/// Records at its rate until it is told to stop.
fn record(folder: &Path, shared: &RecordingTurn) -> Result<(), Failure> {
    let workload = Workload { bytes: RECORDED_BYTES, messages: usize::MAX };
    workload.prepare();
    let (mut writer, channel) = recorder::begin(folder)?;
    let mut due = Instant::now();
    for (sequence, data) in workload.all() {
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        due += RECORDED_PERIOD;
        let now_ns = u64::from(sequence) * RECORDED_PERIOD.as_nanos() as u64;
        let message = Message { arrival_ns: now_ns, stamp_ns: now_ns, epoch: 1, sequence, data };
        if let Err(error) = writer.write(channel, &message) {
            return Err(Failure::Skipped(format!("this computer does not record 50 MB/s: {error}")));
        }
        if sequence as usize == RECORDED_FIRST {
            shared.runs.store(1, Ordering::Relaxed);
        }
        if shared.stops.load(Ordering::Relaxed) != 0 {
            break;
        }
    }
    writer.finish().1.or_fail("closing the recording")
}
