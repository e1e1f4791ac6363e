//! The thread that reads the router's mailbox and sends what is real time to other nodes. It hands the rest to the
//! thread of [`rest`](super::rest). What it takes and sends, and when, says the [driver](crate::driver).

use super::sending::Sending;
use super::threads::{Awake, Shared};
use crate::driver::{FreeDriver, FreeStep, Handover, Inlet, Wakes};
use crate::outbound::Package;
use rohrpost_mailbox::{Priority, Receiver, wait_above, wait_any};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// State of the sending thread.
pub(super) struct TxThread {
    pub(super) shared: Arc<Shared>,
    pub(super) driver: FreeDriver,
    pub(super) inlet: TransitInlet,
}

/// What the driver has of the system.
pub(super) struct TransitInlet {
    pub(super) transit: Receiver,
    pub(super) sending: Sending,
}

impl Inlet for TransitInlet {
    type Outlet = Sending;

    fn outlet(&mut self) -> &mut Sending {
        &mut self.sending
    }

    fn first(&mut self) -> Option<Priority> {
        self.transit.waits().1
    }

    fn take<T>(&mut self, what: impl FnOnce(&mut Sending, &Package<'_>, &dyn Fn() -> bool) -> T) -> Option<T> {
        let waiting = self.transit.try_receive()?;
        let package = Package { head: *waiting.head(), published_ns: waiting.published_ns(), body: waiting.body() };
        Some(what(&mut self.sending, &package, &|| !waiting.is_followed()))
    }
}

impl TxThread {
    /// Runs until the router ends.
    pub(super) fn run(mut self) {
        let mut awake = Awake::default();
        while !self.shared.ends() {
            let step = self.driver.poll(&mut self.inlet);
            let now_ns = self.driver.polled_ns();
            if let FreeStep::Sleep { until_ns, is_exact, wakes } = step {
                awake.slept(self.sleep(now_ns, until_ns, is_exact, wakes));
            }
            awake.pause_if_long(now_ns);
        }
    }

    /// Sleeps until then. If that must be exact, it costs a timer of the kernel; else the receiving thread rings,
    /// within its own period.
    fn sleep(&mut self, now_ns: u64, until_ns: u64, is_exact: bool, wakes: Wakes) -> Duration {
        let deadline = is_exact.then(|| Instant::now() + Duration::from_nanos(until_ns.saturating_sub(now_ns)));
        // Before the look at the mailbox: a thread that rings because of this time changes the bell that is slept on.
        self.shared.departures_due_ns.store(until_ns, Ordering::Release);
        let Self { shared, inlet: TransitInlet { transit, sending }, .. } = self;
        match wakes {
            Wakes::Any => wait_any(&mut [transit], deadline, || shared.ends()),
            Wakes::Above(priority) => wait_above(transit, priority, deadline, || shared.ends()),
            Wakes::AboveOrRoom(priority) => {
                let has_room = || sending.rest.as_ref().is_some_and(Handover::has_room);
                wait_above(transit, priority, deadline, || shared.ends() || has_room())
            }
        }
    }
}
