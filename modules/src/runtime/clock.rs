//! The clock that a module reads.

use crate::journal::{ModuleJournal, Question, Tag};
use rohrpost_mailbox::{SystemClock, SystemTime, TimeRecord, TimeSource};
use std::time::Duration;

/// A module's view of system time: each reading is noted in its journal, if it has one, and given back in an exact
/// replay. What another thread reads cannot be given back: an exact replay ends there.
///
/// ```
/// use rohrpost_modules::runtime::{Context, ModuleClock};
///
/// struct Stopwatch {
///     clock: ModuleClock,
///     began_ns: u64,
/// }
///
/// impl Stopwatch {
///     fn new(context: &Context) -> Self {
///         Self { clock: context.clock().clone(), began_ns: context.now().ns }
///     }
///
///     fn passed_ns(&self) -> u64 {
///         self.clock.now().ns.saturating_sub(self.began_ns)
///     }
/// }
/// ```
#[derive(Clone)]
pub struct ModuleClock {
    clock: SystemClock,
    journal: ModuleJournal,
}

/// A reading, as a journal has it.
type NotedTime = (u64, u64, Duration, Duration);
/// What a clock goes by.
type NotedTimeRecord = (u64, u8, u64, u64, u64, u64, u64);

impl ModuleClock {
    pub(crate) fn new(clock: SystemClock, journal: ModuleJournal) -> Self {
        Self { clock, journal }
    }

    /// The node's clock, for what no module sees.
    pub(crate) fn unseen(&self) -> &SystemClock {
        &self.clock
    }

    pub(in crate::runtime) fn journal(&self) -> &ModuleJournal {
        &self.journal
    }

    /// System time now. No system call, lock or heap.
    pub fn now(&self) -> SystemTime {
        let ask = || -> NotedTime {
            let SystemTime { ns, epoch, error, age } = self.clock.now();
            (ns, epoch, error, age)
        };
        let (ns, epoch, error, age) = self.journal.answer(Tag::Time, Question::Plain, ask);
        SystemTime { ns, epoch, error, age }
    }

    /// The computer's monotonic clock, ns from some origin: for deadlines, which no step of system time moves.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn in_half_a_second_ns(context: &Context) -> u64 {
    ///     context.clock().monotonic_ns() + 500_000_000
    /// }
    /// ```
    pub fn monotonic_ns(&self) -> u64 {
        self.journal.answer(Tag::Monotonic, Question::Plain, rohrpost_mailbox::monotonic_ns)
    }

    /// What the node's time goes by; none without a time page.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn pace(context: &Context) -> f64 {
    ///     context.clock().record().map_or(1.0, |record| record.pace_ppb as f64 / 1e9)
    /// }
    /// ```
    pub fn record(&self) -> Option<TimeRecord> {
        let ask = || self.clock.record().map(noted);
        let noted: Option<NotedTimeRecord> = self.journal.answer(Tag::TimeRecord, Question::Plain, ask);
        noted.and_then(recorded)
    }
}

const SOURCES: [TimeSource; 4] = [TimeSource::Local, TimeSource::Simulation, TimeSource::Log, TimeSource::Master];

fn noted(record: TimeRecord) -> NotedTimeRecord {
    let TimeRecord { epoch, source, monotonic_ns, system_ns, pace_ppb, error_ns, drift_ns_s } = record;
    (epoch, source as u8, monotonic_ns, system_ns, pace_ppb, error_ns, drift_ns_s)
}

fn recorded(
    (epoch, source, monotonic_ns, system_ns, pace_ppb, error_ns, drift_ns_s): NotedTimeRecord,
) -> Option<TimeRecord> {
    let source = SOURCES.into_iter().find(|known| *known as u8 == source)?;
    Some(TimeRecord { epoch, source, monotonic_ns, system_ns, pace_ppb, error_ns, drift_ns_s })
}

/// What a computer's clock that was set is called.
///
/// ```
/// use rohrpost_modules::runtime::clock_was_set;
///
/// let days = |days: i64| clock_was_set(days * 86_400_000_000_000);
/// assert_eq!(days(2), "this computer's clock is 2.0 days ahead of system time");
/// assert_eq!(days(-400), "this computer's clock is 400 days behind system time");
/// ```
pub fn clock_was_set(by_ns: i64) -> String {
    let (days, side) = (by_ns.unsigned_abs() as f64 / 86_400e9, if by_ns < 0 { "behind" } else { "ahead of" });
    let digits = usize::from(days < 100.0);
    format!("this computer's clock is {days:.digits$} days {side} system time")
}
