//! Sends what is not real time as packages come: what to take from the thread that reads the mailbox, and for how long
//! to wait.

use super::outlet::{Outlet, OutletStep, Transmitter};
use crate::outbound::Package;
use crate::settings::Settings;

/// Packages taken before the wire has its turn.
const BURST: usize = 64;
/// The end of the router is checked this often, ns.
const LOOK_NS: u64 = 100_000_000;
/// Packages for a peer that does not hear this incarnation yet are checked this often, ns.
const LOOK_AGAIN_NS: u64 = 10_000_000;

/// What comes from the thread that reads the mailbox.
pub trait RestInlet {
    /// Clock, queue and sockets.
    type Outlet: Outlet;
    /// The same, without a package.
    fn outlet(&mut self) -> &mut Self::Outlet;
    /// Lends out the next package, with whether it is the last for now. False: there was none.
    fn take(&mut self, what: impl FnOnce(&mut Self::Outlet, &Package<'_>, bool)) -> bool;
}

/// Sends what is not real time, where that has threads of its own.
pub struct RestDriver {
    transmitter: Transmitter,
}

impl RestDriver {
    /// Makes the driver of a starting router.
    pub fn new(settings: &Settings) -> Self {
        Self { transmitter: Transmitter::new(settings) }
    }

    /// Does what is due, one datagram at most beside those that leave at once.
    pub fn poll(&mut self, on: &mut impl RestInlet) -> OutletStep {
        self.take(on);
        let outlet = on.outlet();
        let now_ns = outlet.monotonic_ns();
        let Some(until_ns) = self.transmitter.step(outlet, now_ns) else { return OutletStep::Again };
        let until_ns = until_ns.min(outlet.deliver(now_ns));
        let (outbound, _) = outlet.queue();
        // More packages wait in the mailbox, where less important ones are displaced.
        let look_ns = if outbound.waits() { LOOK_AGAIN_NS } else { LOOK_NS };
        let for_ns = until_ns.saturating_sub(now_ns).min(look_ns);
        if outbound.has_plenty() { OutletStep::Sleep { for_ns } } else { OutletStep::Wait { for_ns } }
    }

    /// Takes packages while they are of use.
    fn take(&mut self, on: &mut impl RestInlet) {
        for _ in 0..BURST {
            let has_plenty = on.outlet().queue().0.has_plenty();
            if has_plenty || !on.take(|outlet, package, is_last| self.transmitter.accept(outlet, package, is_last)) {
                return;
            }
        }
    }
}
