//! System time: what every node of a system takes for now, and how sure it is (seed 002, 2.2.3).
//!
//! The page has two records and an index. Its writer fills the record that the index does not name, then turns the
//! index: readers always find a whole record, also when the writer died at any line. System time is nanoseconds since
//! 1970. Within an *epoch* it only moves forward; a step is a new epoch, which readers can see. Timeouts and leases
//! never use it: they are measured by the monotonic clock.

mod keeper;

pub use keeper::TimeKeeper;

use crate::cell::SeqLatch;
use crate::clock::{monotonic_ns, realtime_ns, slept_ns, slept_ns_min};
use crate::memory::files::{Directory, allocate};
use crate::memory::mapping::{Mapping, Shared, Use};
use crate::node::directory::Node;
use crate::step::step;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// The file of the page.
const FILE: &str = "time";
/// A reader tries again so often when the writer wrote twice meanwhile: the writer writes at most some thousand times a
/// second, a reading takes less than a microsecond.
const READ_TRIES: usize = 8;
/// The error bound of a node that does not know the time: 292 years.
pub const ERROR_UNKNOWN_NS: u64 = i64::MAX as u64;
const BILLION: i128 = 1_000_000_000;
/// A computer's clock that lies so far from system time was set since system time began: a day.
pub const CLOCK_SET_NS: u64 = 86_400_000_000_000;
/// Two readings of how long a computer has slept are off by less.
const SLEPT_NS_MIN: u64 = 5_000_000;

/// Where system time comes from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u64)]
pub enum TimeSource {
    /// This computer's own clocks.
    Local = 1,
    /// A simulation, which may run faster or slower than the world.
    Simulation = 2,
    /// A log that is played.
    Log = 3,
    /// The master of the system's time, by way of the node's router.
    Master = 4,
}

impl TimeSource {
    fn from_code(code: u64) -> Option<Self> {
        [Self::Local, Self::Simulation, Self::Log, Self::Master].into_iter().find(|source| *source as u64 == code)
    }

    /// One word for tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Local => "local",
            Self::Simulation => "simulation",
            Self::Log => "log",
            Self::Master => "master",
        }
    }
}

/// How system time follows from the monotonic clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TimeRecord {
    /// Raised with every step.
    pub epoch: u64,
    /// Where it comes from.
    pub source: TimeSource,
    /// Monotonic clock at which this record begins, ns.
    pub monotonic_ns: u64,
    /// System time then, ns since 1970.
    pub system_ns: u64,
    /// System nanoseconds in a billion monotonic ones; 1 000 000 000 is the pace of this computer's clock.
    pub pace_ppb: u64,
    /// How far off it was at most when the record was written, ns.
    pub error_ns: u64,
    /// How much that grows, ns a second.
    pub drift_ns_s: u64,
}

impl TimeRecord {
    /// Whether anybody has told this node the time: the player of a log, or the master. Until then it is in an epoch of
    /// its own, and its bound says that nobody knows it.
    pub fn is_known(&self) -> bool {
        self.error_ns < ERROR_UNKNOWN_NS
    }

    /// The same if the computer has slept for so long since it was written: its clocks count how long it slept, some of
    /// them in seconds, so nobody knows how far off its master's time is.
    #[must_use]
    pub fn after_sleep(self, slept_ns: u64) -> Self {
        let is_known = self.source != TimeSource::Master || slept_ns < SLEPT_NS_MIN;
        if is_known { self } else { Self { error_ns: ERROR_UNKNOWN_NS, drift_ns_s: 0, ..self } }
    }

    /// How far the computer's clock was set away from system time, ns; positive: it is ahead. `wall_ns`: a reading of
    /// that clock ([`realtime_ns`]) at this moment of the monotonic clock. None: they lie less than a day apart, or
    /// this is no time of clocks, or nobody knows it.
    pub fn clock_set_by(&self, monotonic_ns: u64, wall_ns: u64) -> Option<i64> {
        let is_of_clocks = matches!(self.source, TimeSource::Local | TimeSource::Master) && self.is_known();
        let by_ns = i128::from(wall_ns) - i128::from(self.at(monotonic_ns).ns);
        let is_set = is_of_clocks && by_ns.unsigned_abs() >= u128::from(CLOCK_SET_NS);
        is_set.then(|| by_ns.clamp(i64::MIN.into(), i64::MAX.into()) as i64)
    }

    /// System time at this moment of the monotonic clock. Another process wrote the record: whatever it says, this is a
    /// time.
    pub fn at(&self, monotonic_ns: u64) -> SystemTime {
        let since = i128::from(monotonic_ns) - i128::from(self.monotonic_ns);
        let system = i128::from(self.system_ns) + since.saturating_mul(self.pace_ppb.into()) / BILLION;
        let age_ns = monotonic_ns.saturating_sub(self.monotonic_ns);
        let drift = u128::from(age_ns) * u128::from(self.drift_ns_s) / BILLION as u128;
        SystemTime {
            ns: u64::try_from(system.max(0)).unwrap_or(u64::MAX),
            epoch: self.epoch,
            error: Duration::from_nanos(self.error_ns.saturating_add(drift as u64)),
            age: Duration::from_nanos(age_ns),
        }
    }
}

/// What the writer of a node's time saw last of the computer's clocks: its next incarnation sees what they did while
/// nobody watched.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Watched {
    /// The clock of the page, [`monotonic_ns`].
    pub local_ns: u64,
    /// One that nobody slews, ns.
    pub unslewed_ns: u64,
    /// How long the two readings lay apart at most, ns.
    pub apart_ns: u64,
    /// For how long the computer had slept, ns.
    pub slept_ns: u64,
    /// How much faster than its oscillator the first clock was, ns a second; none if that was not known yet.
    pub rate_ppb: Option<i64>,
    /// Until when the clock is not to be believed, by itself; a time that has passed if it is.
    pub unsteady_until_ns: u64,
}

/// System time as one reader computed it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SystemTime {
    /// Nanoseconds since 1970.
    pub ns: u64,
    /// Times of different epochs cannot be subtracted.
    pub epoch: u64,
    /// How far off it is at most.
    pub error: Duration,
    /// How long ago its source was last heard; of a clock that is its own source, since when it is.
    pub age: Duration,
}

#[repr(C, align(64))]
struct SharedRecord {
    epoch: AtomicU64,
    source: AtomicU64,
    monotonic_ns: AtomicU64,
    system_ns: AtomicU64,
    pace_ppb: AtomicU64,
    error_ns: AtomicU64,
    drift_ns_s: AtomicU64,
    slept_ns: AtomicU64,
}

/// A record, and for how long the computer had slept when it was written, ns.
#[derive(Clone, Copy)]
struct Written {
    record: TimeRecord,
    slept_ns: u64,
}

impl Written {
    fn now(record: TimeRecord) -> Self {
        Self { record, slept_ns: slept_ns() }
    }

    /// What it says when the computer has slept for so long.
    fn read(self, slept_ns: u64) -> TimeRecord {
        self.record.after_sleep(slept_ns.saturating_sub(self.slept_ns))
    }
}

/// The file `time`.
#[repr(C)]
pub(crate) struct TimePage {
    /// Records written so far; the last is in place `index % 2`. 0: none yet.
    index: SeqLatch,
    writer_pid: AtomicU32,
    padding: AtomicU32,
    /// The fields of [`Watched`]; 0: none. If a writer dies while it writes them, they are inconsistent, and its next
    /// incarnation treats the clock as not steady.
    watched: [AtomicU64; 6],
    records: [SharedRecord; 2],
}

// SAFETY: made of atomics alone.
unsafe impl Shared for TimePage {}

const _: () = assert!(size_of::<TimePage>() == 192 && std::mem::offset_of!(TimePage, records) == 64);
const _: () = assert!(std::mem::offset_of!(TimePage, watched) == 16);
const _: () = assert!(std::mem::offset_of!(SharedRecord, slept_ns) == 56);

impl SharedRecord {
    fn load(&self) -> Option<Written> {
        let load = |field: &AtomicU64| field.load(Ordering::Relaxed);
        let record = TimeRecord {
            epoch: load(&self.epoch),
            source: TimeSource::from_code(load(&self.source))?,
            monotonic_ns: load(&self.monotonic_ns),
            system_ns: load(&self.system_ns),
            pace_ppb: load(&self.pace_ppb),
            error_ns: load(&self.error_ns),
            drift_ns_s: load(&self.drift_ns_s),
        };
        Some(Written { record, slept_ns: load(&self.slept_ns) })
    }

    fn store(&self, Written { record, slept_ns }: &Written) {
        let store = |field: &AtomicU64, value| {
            field.store(value, Ordering::Relaxed);
            step!("time: field");
        };
        store(&self.epoch, record.epoch);
        store(&self.source, record.source as u64);
        store(&self.monotonic_ns, record.monotonic_ns);
        store(&self.system_ns, record.system_ns);
        store(&self.pace_ppb, record.pace_ppb);
        store(&self.error_ns, record.error_ns);
        store(&self.drift_ns_s, record.drift_ns_s);
        store(&self.slept_ns, *slept_ns);
    }
}

impl TimePage {
    fn read(&self) -> Option<Written> {
        self.read_while(|| ()).map(|(written, ())| written)
    }

    /// The record, and what `meanwhile` said while it was the valid one.
    fn read_while<T>(&self, meanwhile: impl Fn() -> T) -> Option<(Written, T)> {
        let (record, said) = self.index.read(READ_TRIES, |place| (self.records[place].load(), meanwhile()))?;
        Some((record?, said))
    }

    /// Writes the record that the index does not name.
    fn fill(&self, written: &Written) {
        self.index.fill(|place| self.records[place].store(written));
    }
}

fn map(node: &Directory, create: bool) -> std::io::Result<Mapping> {
    let file = if create { node.open_or_make(FILE)? } else { node.open_to_read(FILE)? };
    let bytes = size_of::<TimePage>();
    if create && file.metadata()?.len() < bytes as u64 {
        allocate(&file, bytes)?;
    }
    Mapping::new(&file, bytes, if create { Use::Share } else { Use::Look })
}

/// Reads a node's system time; without a time page, this computer's wall clock is taken.
#[derive(Clone)]
pub struct SystemClock {
    mapping: Option<Arc<Mapping>>,
}

impl SystemClock {
    /// Opens the node's time page, if there is one.
    pub fn open(node: &Node) -> Self {
        Self { mapping: map(node.directory(), false).ok().map(Arc::new) }
    }

    /// System time now. No system call, lock or heap.
    pub fn now(&self) -> SystemTime {
        // The clock is read while the record is valid. By an older record it could be later, and by a newer one
        // earlier, than what the next reading says.
        match self.mapping.as_ref().and_then(|mapping| mapping.at::<TimePage>(0).read_while(monotonic_ns)) {
            Some((written, now)) => written.read(slept_ns_min(now)).at(now),
            None => self.at(monotonic_ns()),
        }
    }

    /// System time at a moment of the monotonic clock.
    pub fn at(&self, monotonic: u64) -> SystemTime {
        match self.record() {
            Some(record) => record.at(monotonic),
            None => {
                let behind = monotonic_ns().saturating_sub(monotonic);
                let ns = realtime_ns().saturating_sub(behind);
                SystemTime { ns, epoch: 0, error: Duration::ZERO, age: Duration::ZERO }
            }
        }
    }

    /// What the page says; none without one. If the computer has slept since it was written, nobody knows how far off
    /// that is.
    pub fn record(&self) -> Option<TimeRecord> {
        let written = self.mapping.as_ref()?.at::<TimePage>(0).read()?;
        Some(written.read(slept_ns_min(monotonic_ns())))
    }
}
