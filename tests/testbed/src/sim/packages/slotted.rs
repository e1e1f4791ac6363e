//! Packages where there are time slots: sent in a slot as far as it has room, and tidied between slots.
//!
//! `sim/slotted` calls this; without slots, `poll` sends as packages come.

use super::watch::Watch;
use super::{PORT, Packages};
use crate::sim::host::TRANSIT_SLOTS;
use crate::sim::station::{Io, Sent};
use rohrpost_mailbox::{Head, Priority};
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::intake::{Intake, MAKING_NS, TAKING_NS, Transit};
use rohrpost_routers::outbound::Accepted;
use rohrpost_routers::security::HELLO_SLOT_BYTES;
use rohrpost_routers::tdma::TransmitWindow;
use std::rc::Rc;

/// What a package goes through when it is taken from the transit mailbox.
pub(in crate::sim) struct Hands<'a, 'b> {
    pub(in crate::sim) packages: &'a mut Packages,
    pub(in crate::sim) io: &'a mut Io<'b>,
    /// The slot, where each package that is taken keeps the thread from sending.
    pub(in crate::sim) tx_window: Option<&'a TransmitWindow>,
}

impl Transit for Hands<'_, '_> {
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

    fn busy_ns(&self) -> u64 {
        self.tx_window.map_or(0, |tx_window| tx_window.busy_ns(self.io.now.monotonic_ns))
    }

    fn take(&mut self) -> Option<(Head, Accepted)> {
        self.io.works(if self.tx_window.is_some() { TAKING_NS } else { 0 });
        self.packages.take_one(self.io)
    }
}

impl Packages {
    /// With time slots, where all is sealed: sends a hello in one, to this node before others; whether there was any.
    pub(in crate::sim) fn say_in(
        &mut self,
        io: &mut Io<'_>,
        first: Option<NodeIndex>,
        tx_window: &mut TransmitWindow,
    ) -> bool {
        let (Some(seals), now_ns) = (&mut self.seals, io.now.monotonic_ns) else { return false };
        let fits = tx_window.carries_hello() && tx_window.fits(now_ns, HELLO_SLOT_BYTES);
        let Some((said, datagram)) = fits.then(|| seals.waiting.take(now_ns, first)).flatten() else { return false };
        tx_window.takes(now_ns, HELLO_SLOT_BYTES);
        io.sent.push(Sent { port: PORT, to: said.to.into(), bytes: Rc::from(datagram), handed: io.now });
        seals.waiting.left(said);
        true
    }

    /// With time slots: sends in one what must be said, and then what is most important, as long as it fits.
    pub(in crate::sim) fn poll_in(&mut self, io: &mut Io<'_>, intake: &mut Intake, tx_window: &mut TransmitWindow) {
        let now_ns = io.now.monotonic_ns;
        while let Some(refusal) = self.refusals.pop_front_if(|refusal| tx_window.fits(now_ns, refusal.bytes.len())) {
            tx_window.takes(now_ns, refusal.bytes.len());
            io.sent.push(refusal);
        }
        loop {
            let mut watch = Watch::out(io, &mut self.undelivered);
            self.outbound.drop_first(watch.io.now.monotonic_ns, &mut watch);
            intake.take_on(&mut Hands { packages: self, io, tx_window: Some(tx_window) });
            let Some(room_bytes) = tx_window.room_bytes(io.now.monotonic_ns + MAKING_NS) else { break };
            let (made_ns, mut watch) = (io.now.monotonic_ns, Watch::out(io, &mut self.undelivered));
            let (_, behind) = watch.io.host.transit.waits();
            let datagram = (room_bytes, &mut self.buffer[..]);
            let Some((to, bytes)) = self.outbound.poll_slot(made_ns, datagram, behind, &mut watch) else { break };
            io.works(MAKING_NS);
            tx_window.takes(io.now.monotonic_ns, bytes);
            let bytes = Rc::from(&self.buffer[..bytes]);
            self.send(io, to, bytes);
        }
    }

    /// With time slots: does between them what passing time does; when to ask again.
    pub(in crate::sim) fn tidy(&mut self, io: &mut Io<'_>) -> u64 {
        let until_ns = self.poll_inbound(io);
        self.answer(io);
        let mut watch = Watch::out(io, &mut self.undelivered);
        self.outbound.tidy(watch.io.now.monotonic_ns, &mut watch);
        until_ns
    }
}
