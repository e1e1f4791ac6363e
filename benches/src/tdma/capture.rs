//! What crosses the bridge, and when: the kernel stamps each frame as it comes in by the port of its sender.

use super::filter;
use super::plan::PORT;
use super::stage::Stage;
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, Gate, Shared, Zeroable, check_children};
use rohrpost_mailbox::{Name, Type};
use rohrpost_routers::frame::Frame;
use rohrpost_routers::lab;
use rohrpost_routers::time::message::TimeMessage;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Most frames, and most packages of declared flows, of one turn.
const FRAMES_MAX: usize = 1 << 20;
const ARRIVALS_MAX: usize = 1 << 17;
/// Longest wait for a frame.
const PATIENCE: Duration = Duration::from_millis(20);
/// Type of packages that hold their time of publication.
pub const STAMPED: Type = Type::data(7);
/// Their last bytes: monotonic ns.
pub const STAMP_BYTES: usize = 8;

/// Kind of a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum FrameKind {
    /// Packages, or a fragment of one.
    Packages,
    /// A master's synchronisation.
    Sync,
    /// A backup's synchronisation in place of a silent master's.
    Replacement,
    /// Other messages between routers.
    Said,
}

/// A frame of a router.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Crossed {
    /// When it came to the bridge, monotonic ns.
    pub at_ns: u64,
    /// Node that sent it.
    pub from: u8,
    /// Its kind.
    pub what: FrameKind,
}

/// A package that holds its time of publication.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Arrived {
    /// When its last fragment came to the bridge, monotonic ns.
    pub at_ns: u64,
    /// When it was published, monotonic ns.
    pub published_ns: u64,
    /// Class of its sender.
    pub class: u8,
    /// Node that sent it.
    pub from: u8,
}

#[repr(C)]
struct CaptureMemory {
    gate: Gate,
    frames: AtomicU64,
    arrivals: AtomicU64,
    /// Time; sender and kind.
    frame: [[AtomicU64; 2]; FRAMES_MAX],
    /// Time of arrival; time of publication; sender.
    arrival: [[AtomicU64; 3]; ARRIVALS_MAX],
}

// SAFETY: atomics only.
unsafe impl Zeroable for CaptureMemory {}

/// Captures, in a process of its own, until it is dropped.
pub struct Capture {
    seen: Shared<CaptureMemory>,
    /// One process.
    watcher: Vec<Child>,
}

impl Capture {
    /// Begins.
    ///
    /// # Errors
    /// When the system allows no capture.
    pub fn start(stage: &Stage) -> Result<Self, Failure> {
        let seen = Shared::<CaptureMemory>::new()?;
        let mut watcher = vec![Child::start(|| {
            stage.enter_bridge()?;
            let mut capture = lab::Capture::of(filter::open([PORT, PORT + 1])?);
            seen.gate.meet(2)?;
            loop {
                capture.wait(PATIENCE);
                capture.drain(|crossing| note(&seen, crossing.at_ns, crossing.datagram));
            }
        })?];
        seen.gate.meet_children(&mut watcher)?;
        Ok(Self { seen, watcher })
    }

    /// Number of frames so far; later ones follow them.
    pub fn len(&self) -> usize {
        self.seen.frames.load(Ordering::Acquire) as usize
    }

    /// Whether there are none yet.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The frames from the given one on.
    pub fn since(&self, first: usize) -> Vec<Crossed> {
        let frames = self.seen.frame.get(first..self.len()).unwrap_or_default();
        frames.iter().filter_map(crossed).collect()
    }

    /// The stamped packages that came so far.
    pub fn arrivals(&self) -> Vec<Arrived> {
        let count = self.seen.arrivals.load(Ordering::Acquire) as usize;
        self.seen.arrival[..count].iter().map(arrived).collect()
    }

    /// Fails if it does not run any more, or had no room.
    ///
    /// # Errors
    /// The reason.
    pub fn check(&mut self) -> Result<(), Failure> {
        if self.len() == FRAMES_MAX || self.seen.arrivals.load(Ordering::Acquire) as usize == ARRIVALS_MAX {
            return Err(Failure::Failed("more crossed the bridge than there is room for".into()));
        }
        check_children(&mut self.watcher)
    }
}

fn crossed(words: &[AtomicU64; 2]) -> Option<Crossed> {
    let [at_ns, what] = words.each_ref().map(|word| word.load(Ordering::Relaxed));
    let [from, what, ..] = what.to_le_bytes();
    let all = [FrameKind::Packages, FrameKind::Sync, FrameKind::Replacement, FrameKind::Said];
    let what = all.into_iter().find(|known| *known as u8 == what)?;
    Some(Crossed { at_ns, from, what })
}

fn arrived(words: &[AtomicU64; 3]) -> Arrived {
    let [at_ns, published_ns, sender] = words.each_ref().map(|word| word.load(Ordering::Relaxed));
    let [from, class, ..] = sender.to_le_bytes();
    Arrived { at_ns, published_ns, class, from }
}

impl CaptureMemory {
    fn frame(&self, frame: &Crossed) {
        let what = u64::from_le_bytes([frame.from, frame.what as u8, 0, 0, 0, 0, 0, 0]);
        append(&self.frames, &self.frame, [frame.at_ns, what]);
    }

    fn arrival(&self, arrival: &Arrived) {
        let sender = u64::from_le_bytes([arrival.from, arrival.class, 0, 0, 0, 0, 0, 0]);
        append(&self.arrivals, &self.arrival, [arrival.at_ns, arrival.published_ns, sender]);
    }
}

/// Appends one if there is room; otherwise [`Capture::check`] reports it.
fn append<const WORDS: usize>(count: &AtomicU64, all: &[[AtomicU64; WORDS]], words: [u64; WORDS]) {
    let at = count.load(Ordering::Relaxed);
    let Some(free) = all.get(at as usize) else { return };
    free.iter().zip(words).for_each(|(free, word)| free.store(word, Ordering::Relaxed));
    // ORDERING: publishes the words; pairs with `len` and `arrivals`.
    count.store(at + 1, Ordering::Release);
}

/// Records a datagram, and the stamped packages in it.
fn note(seen: &CaptureMemory, at_ns: u64, datagram: &[u8]) {
    let Ok((head, frame)) = Frame::parse(datagram) else { return };
    let from = head.from;
    let what = match frame {
        Frame::Packages(packages) => {
            for (package, body) in packages.filter(|(package, _)| package.kind == STAMPED) {
                arrive(seen, at_ns, from, package.from, body);
            }
            FrameKind::Packages
        }
        Frame::Fragment(part) => {
            // Fragments leave in order.
            if part.head.kind == STAMPED && part.index + 1 == part.count {
                arrive(seen, at_ns, from, part.head.from, part.bytes);
            }
            FrameKind::Packages
        }
        Frame::Time(rest) => match TimeMessage::parse(head.kind, rest) {
            Ok(TimeMessage::Sync(sync)) if sync.replacement => FrameKind::Replacement,
            Ok(TimeMessage::Sync(_)) => FrameKind::Sync,
            _ => FrameKind::Said,
        },
        Frame::Alive(_) | Frame::Refusal(_) | Frame::Replica(_) => FrameKind::Said,
    };
    seen.frame(&Crossed { at_ns, from, what });
}

fn arrive(seen: &CaptureMemory, at_ns: u64, from: u8, sender: Name, end: &[u8]) {
    if let Some((_, published)) = end.split_last_chunk() {
        let (published_ns, class) = (u64::from_le_bytes(*published), sender.class().0);
        seen.arrival(&Arrived { at_ns, published_ns, class, from });
    }
}
