//! System time: what every node of a system takes for now, and how sure it is (seed 002, 2.2.3).
//!
//! The page has two records and an index. Its writer fills the record that the index does not name, then turns the
//! index: readers always find a whole record, also when the writer died at any line. System time is nanoseconds since
//! 1970. Within an *epoch* it only moves forward; a step is a new epoch, which readers can see. Timeouts and leases
//! never use it: they are measured by the monotonic clock.

use crate::cell::SeqLatch;
use crate::clock::{monotonic_ns, realtime_ns, slept_ns, slept_ns_min};
use crate::files::{allocate, open_shared};
use crate::memory::{Mapping, Shared, Use};
use crate::node::{Node, NodeError};
use crate::step::step;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// A reader tries again so often when the writer wrote twice meanwhile: the writer writes at most some thousand times a
/// second, a reading takes less than a microsecond.
const READ_TRIES: usize = 8;
/// A slower pace begins so far ahead: longer than writing a record takes. A writer that was held up tries again, so
/// often.
const SLOWER_LEAD_NS: u64 = 1_000_000;
const WRITE_TRIES: usize = 8;
/// The error bound of a node that does not know the time: 292 years.
pub const ERROR_UNKNOWN_NS: u64 = i64::MAX as u64;
const BILLION: i128 = 1_000_000_000;
/// Stands for a rate that is not known.
const NO_RATE: u64 = i64::MIN.cast_unsigned();
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
    /// The same if the computer has slept for so long since it was written: its clocks count how long it slept, some of
    /// them in seconds, so nobody knows how far off its master's time is.
    #[must_use]
    pub fn after_sleep(self, slept_ns: u64) -> Self {
        let is_known = self.source != TimeSource::Master || slept_ns < SLEPT_NS_MIN;
        if is_known { self } else { Self { error_ns: ERROR_UNKNOWN_NS, drift_ns_s: 0, ..self } }
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

fn map(node: &Path, create: bool) -> std::io::Result<Mapping> {
    let file = open_shared(&node.join("time"), create)?;
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
        Self { mapping: map(node.path(), false).ok().map(Arc::new) }
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

/// Writes a node's system time. There is one: the launch of the node, or the router that hears the master.
pub struct TimeKeeper {
    mapping: Mapping,
    /// What this incarnation has noted last.
    watched: Option<Watched>,
}

impl TimeKeeper {
    /// Opens the page, making it if need be, and begins a new epoch at this system time.
    ///
    /// # Errors
    /// When the page cannot be made.
    pub fn begin(node: &Arc<Node>, source: TimeSource, system_ns: u64, pace: f64) -> Result<Self, NodeError> {
        let failed = |error| NodeError::of(&node.path().join("time"), error);
        let keeper = Self { mapping: map(node.path(), true).map_err(failed)?, watched: None };
        let page: &TimePage = keeper.mapping.at(0);
        page.writer_pid.store(std::process::id(), Ordering::Relaxed);
        let epoch = page.read().map_or(1, |last| last.record.epoch.saturating_add(1));
        page.fill(&Written::now(TimeRecord {
            epoch,
            source,
            monotonic_ns: monotonic_ns(),
            system_ns,
            pace_ppb: (pace.clamp(0.0, 1000.0) * 1e9) as u64,
            error_ns: 0,
            drift_ns_s: 0,
        }));
        page.index.publish();
        Ok(keeper)
    }

    /// Opens the page of a node that is to have the master's time. What it has of it stays. Else there is the wall
    /// clock, with a bound that says that nobody knows, until the node's router has heard a master.
    ///
    /// # Errors
    /// When the page cannot be made.
    pub fn await_master(node: &Arc<Node>) -> Result<Self, NodeError> {
        let mut keeper = Self::resume(node)?;
        let last = keeper.record();
        if last.is_none_or(|last| last.source != TimeSource::Master) {
            keeper.write(&TimeRecord {
                epoch: last.map_or(0, |last| last.epoch.saturating_add(1)),
                source: TimeSource::Master,
                monotonic_ns: monotonic_ns(),
                system_ns: realtime_ns(),
                pace_ppb: BILLION as u64,
                error_ns: ERROR_UNKNOWN_NS,
                drift_ns_s: 0,
            });
        }
        Ok(keeper)
    }

    /// Opens the page, making it if need be, and leaves what it says: a restarted writer goes on from there.
    ///
    /// # Errors
    /// When the page cannot be made.
    pub fn resume(node: &Arc<Node>) -> Result<Self, NodeError> {
        let failed = |error| NodeError::of(&node.path().join("time"), error);
        let keeper = Self { mapping: map(node.path(), true).map_err(failed)?, watched: None };
        let page: &TimePage = keeper.mapping.at(0);
        page.writer_pid.store(std::process::id(), Ordering::Relaxed);
        Ok(keeper)
    }

    /// What the page says; none if nobody wrote it yet. If the computer has slept since, nobody knows how far off that
    /// is.
    pub fn record(&self) -> Option<TimeRecord> {
        let page: &TimePage = self.mapping.at(0);
        Some(page.read()?.read(slept_ns()))
    }

    /// What was seen last of this computer's clocks, if anything was.
    pub fn watched(&self) -> Option<Watched> {
        let page: &TimePage = self.mapping.at(0);
        let [local_ns, unslewed_ns, apart_ns, slept_ns, rate, unsteady_until_ns] =
            page.watched.each_ref().map(|field| field.load(Ordering::Relaxed));
        let rate_ppb = (rate != NO_RATE).then_some(rate.cast_signed());
        (local_ns > 0).then_some(Watched { local_ns, unslewed_ns, apart_ns, slept_ns, rate_ppb, unsteady_until_ns })
    }

    /// Notes what was seen, for the next incarnation of the writer. Records that are written from then on are of this
    /// moment: if the computer sleeps before one is written, its readers see that.
    pub fn note_watched(&mut self, watched: &Watched) {
        if self.watched.replace(*watched) == Some(*watched) {
            return;
        }
        let Watched { local_ns, unslewed_ns, apart_ns, slept_ns, rate_ppb, unsteady_until_ns } = *watched;
        let rate = rate_ppb.map_or(NO_RATE, i64::cast_unsigned);
        let page: &TimePage = self.mapping.at(0);
        let all = [local_ns, unslewed_ns, apart_ns, slept_ns, rate, unsteady_until_ns];
        for (field, value) in page.watched.iter().zip(all) {
            field.store(value, Ordering::Relaxed);
        }
    }

    /// Makes this the page's record. False, and the page stays as it was, if time would go back within its epoch just
    /// now: because the record is of a slower pace, and this thread was held up until it was too late for it.
    pub fn write(&mut self, record: &TimeRecord) -> bool {
        let page: &TimePage = self.mapping.at(0);
        let last = page.read().map(|last| last.record).filter(|last| last.epoch == record.epoch);
        page.fill(&Written { record: *record, slept_ns: self.watched.map_or_else(slept_ns, |seen| seen.slept_ns) });
        // From here to the turn are nanoseconds, as in `set_pace`.
        let now_ns = monotonic_ns();
        let goes_on = last.is_none_or(|last| last.at(now_ns).ns <= record.at(now_ns).ns);
        if goes_on {
            page.index.publish();
        }
        goes_on
    }

    /// Goes on in the same epoch with another pace, never back. False when the pace stays as it was: this thread was
    /// held up each time it tried.
    pub fn set_pace(&mut self, pace: f64) -> bool {
        let page: &TimePage = self.mapping.at(0);
        let Some(Written { record: last, slept_ns }) = page.read() else { return false };
        let pace_ppb = (pace.clamp(0.0, 1000.0) * 1e9) as u64;
        // Until the index turns, readers go by the old pace. So that the new record is never behind what they read till
        // then, a slower pace begins a little in the future.
        let lead_ns = if pace_ppb < last.pace_ppb { SLOWER_LEAD_NS } else { 0 };
        for _ in 0..WRITE_TRIES {
            let begin_ns = monotonic_ns() + lead_ns;
            let system_ns = last.at(begin_ns).ns;
            let record = TimeRecord { monotonic_ns: begin_ns, system_ns, pace_ppb, ..last };
            page.fill(&Written { record, slept_ns });
            // From here to the turn are nanoseconds; a thread held up just there for longer than the lead would be
            // late.
            if lead_ns == 0 || monotonic_ns() < begin_ns {
                page.index.publish();
                return true;
            }
        }
        false
    }
}
