//! The clock by which a robot takes part in its team.

use rohrpost_modules::runtime::{Context, ModuleClock};

/// The robot's clock in its team: system time when the module began, and since then the computer's clock, which no step
/// of system time makes wait or jump.
pub(crate) struct OwnClock {
    clock: ModuleClock,
    ahead_ns: u64,
}

impl OwnClock {
    pub(crate) fn begin(context: &Context) -> Self {
        let clock = context.clock().clone();
        let ahead_ns = clock.now().ns.saturating_sub(clock.monotonic_ns());
        Self { clock, ahead_ns }
    }

    pub(crate) fn now_ns(&self) -> u64 {
        self.clock.monotonic_ns().saturating_add(self.ahead_ns)
    }
}
