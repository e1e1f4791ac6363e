//! What may happen in the model, and its bounds.

use super::super::wormhole::state::{CALLERS, Run, TICK_NS, WINDOW_MAX};
use super::super::{Driver, Settings};

/// Times and numbers of the model; times in ticks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) horizon: u8,
    pub(super) wait: u8,
    pub(super) failures_before_restart: u8,
    pub(super) failures_max: u8,
    pub(super) window: u8,
    /// How late the caller looks at most.
    pub(super) late: u8,
}

/// Small enough for each run of the tests, with each rule at work: the window has room for the misses before a restart,
/// and outlasts the wait.
pub(super) const SMALL: Bounds =
    Bounds { horizon: 3, wait: 4, failures_before_restart: 2, failures_max: 5, window: 7, late: 1 };
/// For the long run.
const LARGE: Bounds = Bounds { horizon: 4, wait: 6, failures_before_restart: 3, failures_max: 6, window: 12, late: 2 };

/// Names the bounds: `large` for the long run.
const BOUNDS_VARIABLE: &str = "ROHRPOST_MODEL_BOUNDS";

impl Bounds {
    pub(super) fn chosen() -> Self {
        let is_large = std::env::var(BOUNDS_VARIABLE).is_ok_and(|bounds| bounds == "large");
        if is_large && rohrpost_planted::made().is_none() { LARGE } else { SMALL }
    }

    pub(super) fn settings(&self) -> Settings {
        let ns = |ticks: u8| u64::from(ticks) * TICK_NS;
        assert!(usize::from(self.window) <= WINDOW_MAX);
        Settings {
            horizon_ns: ns(self.horizon),
            wait_ns: ns(self.wait),
            failures_before_restart: self.failures_before_restart.into(),
            failures_max: self.failures_max.into(),
            window_ns: ns(self.window),
        }
    }
}

/// A promise, as it comes; times in ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sent {
    pub(super) driver: Driver,
    pub(super) run: Run,
    /// Has the number of the last one.
    pub(super) repeats: bool,
    pub(super) duration: u8,
    pub(super) age: u8,
    pub(super) is_finite: bool,
}

/// Longer than any horizon.
const FOR_EVER: u8 = 100;

/// All promises of a driver that differ in what the core asks for.
pub(super) fn promises_of(driver: Driver, bounds: &Bounds) -> impl Iterator<Item = Sent> {
    let sent = move |run, duration, age| Sent { driver, run, repeats: false, duration, age, is_finite: true };
    let times = [(1, 0), (2, 0), (FOR_EVER, 0), (2, 1), (1, 1), (FOR_EVER, bounds.horizon)];
    let orderly = [Run::Same, Run::Newer].into_iter();
    let orderly = orderly.flat_map(move |run| times.map(|(duration, age)| sent(run, duration, age)));
    let second = Sent { repeats: true, ..sent(Run::Same, 2, 0) };
    let not_finite = Sent { is_finite: false, ..sent(Run::Same, 2, 0) };
    orderly.chain([sent(Run::Older, 2, 0), second, not_finite])
}

/// One step of anybody.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    /// Time passes.
    Tick,
    /// The caller looks.
    Look,
    Promise(Sent),
    Sight(bool),
    Drive(Driver),
    Reset,
    Halt(usize),
    Resume(usize),
    ResumeAll,
    /// The wormhole dies, and starts anew.
    Die,
    /// What the wormhole told is told; the world goes on.
    Settle,
}

impl Action {
    /// Whether the wormhole looks at its deadlines first.
    pub(super) fn lets_time_pass(&self) -> bool {
        matches!(self, Self::Look | Self::Promise(_) | Self::Sight(_) | Self::Drive(_))
    }
}
