//! Sends what is real time as packages come: what to take from the mailbox, and until when to sleep.
//!
//! ```text
//!  transit mailbox ─┬▶ accept ─┬─ at once: head of the frame + body without a copy ─▶ socket of the peer
//!                   │          └─ queue ─▶ poll ─▶ datagram ─▶ socket of the peer      mailbox checked between any two
//!                   └▶ not real time: a batch, if there is an empty one; else it stays in the mailbox, without a ring.
//!                      With a claimed priority above the permitted one it is lost to its quota
//! ```

use super::outlet::{Outlet, Transmitter};
use crate::outbound::Package;
use crate::settings::Settings;
use rohrpost_mailbox::Priority;
use std::sync::Arc;

/// Packages taken from the mailbox before the wire has its turn: enough to fill a datagram with small ones.
const BURST: usize = 64;

/// The router's mailbox, and where packages go from there.
pub trait Inlet {
    /// Clock, queue and sockets.
    type Outlet: Outlet;
    /// The same, without a package.
    fn outlet(&mut self) -> &mut Self::Outlet;
    /// How important the first package is; none: there is none.
    fn first(&mut self) -> Option<Priority>;
    /// Lends out the most important package, with what looks whether it is alone in the mailbox. None: there is none.
    fn take<T>(&mut self, what: impl FnOnce(&mut Self::Outlet, &Package<'_>, &dyn Fn() -> bool) -> T) -> Option<T>;
}

/// What to do until it is polled again.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FreeStep {
    /// Poll it at once.
    Again,
    /// Sleep until then, monotonic ns, or until something `wakes` it.
    Sleep {
        /// Until when.
        until_ns: u64,
        /// Something waits for that moment. Else a tenth of a second later is as good, and a timer is not worthwhile.
        is_exact: bool,
        /// What ends the sleep before.
        wakes: Wakes,
    },
}

/// What ends a sleep.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Wakes {
    /// Any package in the mailbox.
    Any,
    /// A package more important than this.
    Above(Priority),
    /// The same, and room at the thread that sends what is not real time.
    AboveOrRoom(Priority),
}

/// Sends what is real time as packages come, where there are no time slots.
pub struct FreeDriver {
    settings: Arc<Settings>,
    transmitter: Transmitter,
    polled_ns: u64,
}

impl FreeDriver {
    /// Makes the driver of a starting router.
    pub fn new(settings: &Arc<Settings>) -> Self {
        Self { settings: settings.clone(), transmitter: Transmitter::new(settings), polled_ns: 0 }
    }

    /// When it was polled last, monotonic ns.
    pub fn polled_ns(&self) -> u64 {
        self.polled_ns
    }

    /// Does what is due, one datagram at most beside those that leave at once.
    pub fn poll(&mut self, on: &mut impl Inlet) -> FreeStep {
        let has_more = self.take(on);
        let outlet = on.outlet();
        let now_ns = outlet.monotonic_ns();
        self.polled_ns = now_ns;
        let Some(until_ns) = self.transmitter.step(outlet, now_ns) else { return FreeStep::Again };
        let waits = outlet.queue().0.waits();
        if has_more && !waits {
            // All accepted packages have left, or are lost.
            return FreeStep::Again;
        }
        let delivers_ns = outlet.deliver(now_ns);
        let until_ns = until_ns.min(delivers_ns);
        if has_more {
            // The rate limit holds the wire. Only a package that may leave before all queued ones is worth a wake-up.
            let wakes = Wakes::Above(outlet.queue().0.waits_up_to());
            return FreeStep::Sleep { until_ns, is_exact: true, wakes };
        }
        let is_exact = waits || outlet.blocked().0 != 0 || delivers_ns < u64::MAX;
        FreeStep::Sleep { until_ns, is_exact, wakes: self.wakes(outlet) }
    }

    /// Takes packages from the mailbox, most important first; returns whether there may be more. With plenty in the
    /// queue it takes one: the most important of all that came since. A flood taken in faster than it leaves would only
    /// be lost to its quota there, and cost processor time that modules need; in the mailbox the least important is
    /// displaced anyway.
    fn take(&mut self, on: &mut impl Inlet) -> bool {
        let has_more = self.take_some(on);
        if let Some(rest) = on.outlet().rest() {
            rest.finish();
        }
        has_more
    }

    fn take_some(&mut self, on: &mut impl Inlet) -> bool {
        let Self { settings, transmitter, .. } = self;
        for taken in 0..BURST {
            // What is not real time must stay in the mailbox without an empty batch.
            let lacks_room = on.outlet().rest().is_some_and(|rest| !rest.takes());
            if lacks_room && on.first().is_none_or(|first| u16::from(first.0) < settings.real_time_from) {
                return false;
            }
            let accepts = on.take(|outlet, package, is_alone| {
                let is_rest = settings.is_rest(&package.head) && give_to_rest(outlet, package);
                if !is_rest {
                    transmitter.accept(outlet, package, taken == 0 && is_alone());
                }
                !is_rest
            });
            let Some(accepts) = accepts else { return false };
            if accepts && on.outlet().queue().0.has_plenty() {
                break;
            }
        }
        true
    }

    /// What ends a sleep with an empty mailbox, or with one that has only what is not real time.
    fn wakes(&self, outlet: &mut impl Outlet) -> Wakes {
        let Some(rest) = outlet.rest().filter(|rest| !rest.has_room()) else { return Wakes::Any };
        rest.wants_room();
        Wakes::AboveOrRoom(Priority(self.settings.real_time_from.saturating_sub(1).try_into().unwrap_or(u8::MAX)))
    }
}

/// Hands over what is not real time, where there is a thread for it.
fn give_to_rest(outlet: &mut impl Outlet, package: &Package<'_>) -> bool {
    let Some(rest) = outlet.rest() else { return false };
    if rest.takes() {
        rest.give(&package.head, package.published_ns, package.body);
    } else {
        // It claims to be real time, and so lies above what is. There it cannot stay, and it is not sent as real time.
        let (outbound, mut report) = outlet.queue();
        outbound.displace(package, &mut report);
    }
    true
}
