//! Packages where there are time slots: what the driver has of them.
//!
//! `sim/slotted` calls this; without slots, `free` has another driver.

use super::{PORT, Packages, address, checked};
use crate::sim::clock::Now;
use crate::sim::host::TRANSIT_SLOTS;
use crate::sim::station::{Io, Sent};
use rohrpost_mailbox::{Head, Priority};
use rohrpost_routers::driver::{Answer, NotSent};
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::intake::{TAKING_NS, Transit};
use rohrpost_routers::outbound::{Accepted, Package};
use std::net::IpAddr;
use std::rc::Rc;

/// What a package goes through when it is taken from the transit mailbox.
pub(in crate::sim) struct TransitAdapter<'a, 'b> {
    pub(in crate::sim) packages: &'a mut Packages,
    pub(in crate::sim) io: &'a mut Io<'b>,
}

impl Transit for TransitAdapter<'_, '_> {
    fn waits(&mut self) -> (usize, Option<Priority>) {
        self.io.host.transit.waits()
    }

    fn slots(&self) -> usize {
        TRANSIT_SLOTS
    }

    fn queued(&self) -> Option<u8> {
        self.packages.outbound.first_level()
    }

    fn level(&self, priority: Priority) -> u8 {
        self.packages.outbound.level(priority)
    }

    fn local_ns(&self) -> u64 {
        self.io.now.monotonic_ns
    }

    fn take(&mut self) -> Option<(Head, Accepted)> {
        if !self.io.host.transit.is_empty() {
            self.io.works(TAKING_NS);
        }
        let Self { packages, io } = self;
        let parcel = packages.take_parcel(io)?;
        let head = parcel.head;
        let accepted = if io.is_intruders(&parcel) {
            packages.accept_uncapped(io, &parcel)
        } else {
            let package = Package { head, published_ns: parcel.published_ns, body: &parcel.body };
            let (now_ns, (outbound, mut report)) = (io.now.monotonic_ns, packages.queue(io));
            outbound.accept(now_ns, &package, false, &mut report)
        };
        packages.took(io, parcel);
        Some((head, accepted))
    }
}

impl Packages {
    /// With time slots: sends a datagram in one.
    pub(in crate::sim) fn send_in(&mut self, io: &mut Io<'_>, to: NodeIndex, bytes: &[u8]) -> Result<(), NotSent> {
        let sent = self.hand_over(io, to, bytes);
        if sent.is_err() && self.held_since_ns.is_some() {
            self.drops_held(io, bytes);
        }
        sent
    }

    pub(in crate::sim) fn makes(&mut self, now: Now) {
        self.made = Some(now);
    }

    /// A datagram that was made waits for the next slot: it has left the queue, unless it missed another slot before.
    pub(in crate::sim) fn holds(&mut self, io: &mut Io<'_>, datagram: &[u8]) {
        let Some(made) = self.made else { return };
        self.leaves(io, &checked(datagram));
        self.held_since_ns = Some(made.monotonic_ns);
    }

    /// It is lost: what is in it is as if it had never left.
    pub(in crate::sim) fn drops_held(&mut self, io: &mut Io<'_>, datagram: &[u8]) {
        self.held_since_ns = None;
        io.oracle.comes_back(io.life, &checked(datagram));
    }

    /// The next refusal or hello that the thread that receives wants to have sent.
    pub(in crate::sim) fn next_answer(&mut self) -> Option<Answer> {
        self.answers.pop_front()
    }

    /// Hands it to the kernel.
    pub(in crate::sim) fn send_answer(&mut self, io: &mut Io<'_>, to: IpAddr, datagram: &[u8]) {
        let node = (0..io.plan.nodes.len()).find(|node| address(*node) == to);
        let Some(to) = node else { return io.oracle.saw("refused where no node is") };
        io.sent.push(Sent { port: PORT, to, bytes: Rc::from(datagram), handed: io.now, sealed_to: None });
    }
}
