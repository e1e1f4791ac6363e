//! When a module's periodic work is due: its ticks, and the periods of the data that it publishes.
//!
//! | the node's time | periods are measured by | a wait ends at the latest |
//! | --- | --- | --- |
//! | `local`, `master` | the computer's monotonic clock | when something is due |
//! | `simulation`, `log` | the node's time | after [`LOOK_NS`] |
//!
//! Simulated or replayed time may change its pace, stand still or step while a module sleeps, and nothing wakes a
//! sleeper then: so the module looks again. Such a step is a new epoch: what was left of a period before it is left
//! after it, and nothing counts as missed. Timeouts, leases and supervision use the monotonic clock everywhere.

use rohrpost_config::{Installation, TimeSource};
use rohrpost_mailbox::{SystemClock, monotonic_ns};
use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

/// Where time is simulated or replayed, a module with something due looks at its clock again after so long: a change of
/// pace is noticed so late at most. 50 looks a second cost next to nothing.
const LOOK_NS: u64 = 20_000_000;
/// Shorter periods leave no time for anything else; longer ones are never.
const PERIOD_MIN: Duration = Duration::from_micros(10);
const PERIOD_MAX: Duration = Duration::from_secs(86_400);
const BILLION: u64 = 1_000_000_000;

/// A moment by both clocks.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct WorkMoment {
    /// For leases and timeouts: the computer's monotonic clock.
    pub(crate) monotonic_ns: u64,
    /// For ticks and periods of data.
    pub(crate) work_ns: u64,
}

/// The clock of ticks and periods has stepped.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct ClockStep {
    /// What it said last before.
    pub(crate) from_ns: u64,
    /// What it says now.
    pub(crate) to_ns: u64,
}

impl ClockStep {
    /// When it is due after the step: as much of the period is left as before.
    pub(crate) fn moved(self, due_ns: u64, period_ns: u64) -> u64 {
        self.to_ns.saturating_add(due_ns.saturating_sub(self.from_ns).min(period_ns))
    }
}

/// The ticks that a module asked for.
struct Ticks {
    period_ns: u64,
    due_ns: u64,
}

/// Asks for one tick at a moment. See [`super::Context::wake_up`].
#[derive(Clone, Debug, Default)]
pub struct WakeUp {
    at_ns: Rc<Cell<Option<u64>>>,
}

impl WakeUp {
    /// At this moment of the monotonic clock, ns, in place of the one asked for before; none: only the ticks of the
    /// period. A moment of the past is now.
    pub fn at(&self, monotonic_ns: Option<u64>) {
        self.at_ns.set(monotonic_ns);
    }
}

/// The clock of a module's ticks and periods, and its ticks.
pub(crate) struct Schedule {
    /// The node's time, where it is simulated or replayed.
    node: Option<SystemClock>,
    /// Epoch and time that it said last.
    seen: (u64, u64),
    ticks: Option<Ticks>,
    wake_up: WakeUp,
}

impl Schedule {
    pub(crate) fn new(installation: &Installation, clock: &SystemClock) -> Self {
        let node = match installation.time {
            TimeSource::Local | TimeSource::Master { .. } => None,
            TimeSource::Simulation { .. } | TimeSource::Log => Some(clock.clone()),
        };
        let seen = node.as_ref().map_or((0, 0), seen);
        Self { node, seen, ticks: None, wake_up: WakeUp::default() }
    }

    /// From now on periods are measured by the computer's clock, whatever the node's time does.
    pub(crate) fn use_computer_clock(&mut self) {
        self.node = None;
        self.restart();
    }

    /// Ticks once in this time, the first one now.
    pub(crate) fn set_period(&mut self, period: Duration) {
        let period_ns = period.clamp(PERIOD_MIN, PERIOD_MAX).as_nanos() as u64;
        self.ticks = Some(Ticks { period_ns, due_ns: self.moment().work_ns });
    }

    pub(crate) fn wake_up(&self) -> WakeUp {
        self.wake_up.clone()
    }

    /// When one tick was asked for, monotonic ns.
    pub(crate) fn wake_up_ns(&self) -> Option<u64> {
        self.wake_up.at_ns.get()
    }

    /// Whether it is time for the one tick that was asked for; then it is over.
    fn take_wake_up(&self, now: WorkMoment) -> bool {
        let is_due = self.wake_up_ns().is_some_and(|at_ns| at_ns <= now.monotonic_ns);
        if is_due {
            self.wake_up.at(None);
        }
        is_due
    }

    /// The next tick is now.
    pub(crate) fn restart(&mut self) {
        let now_ns = self.moment().work_ns;
        if let Some(ticks) = &mut self.ticks {
            ticks.due_ns = now_ns;
        }
    }

    /// What both clocks say.
    pub(crate) fn moment(&self) -> WorkMoment {
        let monotonic_ns = monotonic_ns();
        let work_ns = self.node.as_ref().map_or(monotonic_ns, |clock| clock.now().ns);
        WorkMoment { monotonic_ns, work_ns }
    }

    /// Looks at the clocks; if that of periods has stepped since, ticks are moved, and the rest is to be.
    pub(crate) fn look(&mut self) -> (WorkMoment, Option<ClockStep>) {
        let monotonic_ns = monotonic_ns();
        let Some(clock) = &self.node else { return (WorkMoment { monotonic_ns, work_ns: monotonic_ns }, None) };
        let (epoch, work_ns) = seen(clock);
        (WorkMoment { monotonic_ns, work_ns }, self.see(epoch, work_ns))
    }

    /// Within an epoch time does not go back; a writer that lets it go back must not stop the ticks for ever.
    fn see(&mut self, epoch: u64, now_ns: u64) -> Option<ClockStep> {
        let (last_epoch, from_ns) = std::mem::replace(&mut self.seen, (epoch, now_ns));
        if epoch == last_epoch && now_ns >= from_ns {
            return None;
        }
        let step = ClockStep { from_ns, to_ns: now_ns };
        if let Some(ticks) = &mut self.ticks {
            ticks.due_ns = step.moved(ticks.due_ns, ticks.period_ns);
        }
        Some(step)
    }

    /// Whether it is time for a tick. Time must have passed the moment at which it is due: while time stands still
    /// there is none, whatever was switched on meanwhile.
    pub(crate) fn take_tick(&mut self, now: WorkMoment) -> bool {
        let woken = self.take_wake_up(now);
        let Some(ticks) = self.ticks.as_mut().filter(|ticks| ticks.due_ns < now.work_ns) else { return woken };
        // Ticks that were slept through are not made up for; the grid stays where it was.
        let passed = (now.work_ns - ticks.due_ns) / ticks.period_ns;
        ticks.due_ns = ticks.due_ns.saturating_add((passed + 1).saturating_mul(ticks.period_ns));
        true
    }

    /// When the next tick is due, by the clock of periods.
    pub(crate) fn tick_ns(&self) -> Option<u64> {
        self.ticks.as_ref().map(|ticks| ticks.due_ns)
    }

    /// How long to wait from `now_ns` (monotonic) for something that is due then by the clock of periods, ns.
    pub(crate) fn wait_ns(&self, now_ns: u64, due_ns: u64) -> u64 {
        let Some(clock) = &self.node else { return due_ns.saturating_sub(now_ns) };
        let pace_ppb = clock.record().map_or(BILLION, |record| record.pace_ppb);
        // Until it has passed.
        let left_ns = due_ns.saturating_add(1).saturating_sub(clock.at(now_ns).ns);
        paced_ns(left_ns, pace_ppb).min(LOOK_NS)
    }
}

fn seen(clock: &SystemClock) -> (u64, u64) {
    let now = clock.now();
    (now.epoch, now.ns)
}

/// How long it takes, by the monotonic clock, until so much time has passed at this pace.
fn paced_ns(left_ns: u64, pace_ppb: u64) -> u64 {
    if pace_ppb == 0 {
        return u64::MAX;
    }
    let billionths = u128::from(left_ns) * u128::from(BILLION);
    u64::try_from(billionths.div_ceil(pace_ppb.into())).unwrap_or(u64::MAX)
}

#[cfg(test)]
#[path = "schedule_tests.rs"]
mod tests;
