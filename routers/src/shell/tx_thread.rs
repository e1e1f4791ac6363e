//! The thread that reads the router's mailbox and sends what is real time to other nodes. It hands the rest to the
//! thread of [`rest`](super::rest).
//!
//! ```text
//!  transit mailbox ─┬▶ accept ─┬─ at once: head of the frame + body without a copy ─▶ one sendmsg
//!                   │          └─ queue ─▶ poll ─▶ datagram ─▶ socket of the peer      mailbox checked between any two
//!                   └▶ not real time: a batch, if there is an empty one; else it stays in the mailbox, without a ring.
//!                      With a claimed priority above the permitted one it is lost to its quota
//! ```

use super::handover::Giver;
use super::sending::Sending;
use super::threads::{Awake, Shared};
use crate::outbound::Package;
use crate::settings::Settings;
use rohrpost_mailbox::{Priority, Receiver, monotonic_ns, wait_above, wait_any};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Packages taken from the mailbox before the wire has its turn: enough to fill a datagram with small ones.
const BURST: usize = 64;

/// State of the sending thread.
pub(super) struct TxThread {
    pub(super) shared: Arc<Shared>,
    pub(super) transit: Receiver,
    pub(super) sending: Sending,
    pub(super) settings: Arc<Settings>,
    /// To the thread that sends what is not real time; none where there is none.
    pub(super) rest: Option<Giver>,
}

impl TxThread {
    /// Runs until the router ends.
    pub(super) fn run(mut self) {
        let mut awake = Awake::default();
        while !self.shared.ends() {
            let more = self.take();
            let now_ns = monotonic_ns();
            match self.sending.step(now_ns) {
                None => {}
                // All accepted packages have left, or are lost.
                Some(_) if more && self.sending.stats.waiting_bytes.get() == 0 => {}
                Some(until_ns) if more => awake.slept(self.rest(now_ns, until_ns)),
                Some(until_ns) => {
                    let delivery_ns = self.sending.wire.deliver(now_ns);
                    let waits = self.sending.waits() || delivery_ns < u64::MAX;
                    awake.slept(self.sleep(now_ns, until_ns.min(delivery_ns), waits));
                }
            }
            awake.pause_if_long(now_ns);
        }
    }

    /// Takes packages from the mailbox, most important first; returns whether there may be more. With plenty in the
    /// queue it takes one: the most important of all that came since. A flood taken in faster than it leaves would only
    /// be lost to its quota there, and cost processor time that modules need; in the mailbox the least important is
    /// displaced anyway.
    fn take(&mut self) -> bool {
        let more = self.take_some();
        if let Some(rest) = &mut self.rest {
            rest.finish();
        }
        more
    }

    fn take_some(&mut self) -> bool {
        let real_time_from = self.settings.real_time_from;
        for taken in 0..BURST {
            if self.lacks_room() && self.transit.waits().1.is_none_or(|first| u16::from(first.0) < real_time_from) {
                return false;
            }
            let Some(waiting) = self.transit.try_receive() else { return false };
            let (head, published_ns, body) = (waiting.head(), waiting.published_ns(), waiting.body());
            let package = Package { head: *head, published_ns, body };
            if let Some(rest) = &mut self.rest
                && self.settings.is_rest(head)
            {
                if rest.takes() {
                    rest.give(head, published_ns, body);
                } else {
                    // It claims to be real time, and so lies above what is. There it cannot stay, and it is not sent as
                    // real time.
                    self.sending.displace(&package);
                }
                continue;
            }
            let alone = taken == 0 && !waiting.is_followed();
            self.sending.accept(&package, alone);
            if self.sending.outbound.has_plenty() {
                break;
            }
        }
        true
    }

    /// Whether what is not real time must stay in the mailbox.
    fn lacks_room(&mut self) -> bool {
        self.rest.as_mut().is_some_and(|rest| !rest.takes())
    }

    /// The rate limit holds the wire, and the mailbox has more. Only a package that may leave before all queued ones is
    /// worth a wake-up.
    fn rest(&mut self, now_ns: u64, until_ns: u64) -> Duration {
        let until_ns = until_ns.min(self.sending.wire.deliver(now_ns));
        let deadline = Instant::now() + Duration::from_nanos(until_ns.saturating_sub(now_ns));
        wait_above(&mut self.transit, self.sending.outbound.waits_up_to(), Some(deadline), || self.shared.ends())
    }

    /// Sleeps until a package comes that it can take, or until then. If something `waits` to leave, that is exact, and
    /// costs a timer of the kernel; else the receiving thread rings, within its own period.
    fn sleep(&mut self, now_ns: u64, until_ns: u64, waits: bool) -> Duration {
        let deadline = waits.then(|| Instant::now() + Duration::from_nanos(until_ns.saturating_sub(now_ns)));
        // Before the look at the mailbox: a thread that rings because of this time changes the bell that is slept on.
        self.shared.departures_due_ns.store(until_ns, Ordering::Release);
        let Self { shared, transit, rest, settings, .. } = self;
        let Some(rest) = rest.as_mut().filter(|rest| !rest.has_room()) else {
            return wait_any(&mut [transit], deadline, || shared.ends());
        };
        rest.wants_room();
        let below = Priority(settings.real_time_from.saturating_sub(1).try_into().unwrap_or(u8::MAX));
        wait_above(transit, below, deadline, || shared.ends() || rest.has_room())
    }
}
