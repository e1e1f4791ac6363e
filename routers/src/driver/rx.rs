//! Takes what other nodes sent: has datagrams opened, checked and delivered, and answers those that are to be answered.

use super::answer::{ANSWER_BYTES, Answer};
use crate::inbound::{Datagram, Envelope, Inbound, InboundStep, SOCKET_MAX_NS};
use crate::report::Deliver;
use crate::security::{Gate, OutgoingHello};
use crate::settings::Settings;
use crate::stats::Stats;
use std::sync::Arc;

/// What the thread that receives has of the system.
pub trait RxPlatform {
    /// Delivers packages, and takes reports of losses.
    fn delivery(&mut self) -> impl Deliver;
    /// Has a refusal or hello sent: at once, or in a slot. False: no room is left for it, and it is lost.
    fn answer(&mut self, answer: Answer) -> bool;
    /// Wakes the thread that sends.
    fn ring(&mut self);
}

/// Receives at one port.
pub struct RxDriver {
    inbound: Inbound,
    stats: Arc<Stats>,
    /// Where datagrams are sealed: opens them, and tracks live peers.
    gate: Option<Gate>,
    in_slots: bool,
    /// At the port for what is not real time no hello or refusal leaves.
    is_rest: bool,
    /// Nothing has come since this router began.
    is_new: bool,
}

impl RxDriver {
    /// Makes the driver of a starting router, with its gate where datagrams are sealed.
    pub fn new(settings: &Settings, stats: &Arc<Stats>, gate: Option<Gate>) -> Self {
        let (inbound, stats) = (Inbound::new(settings, stats.clone()), stats.clone());
        Self { inbound, stats, gate, in_slots: settings.tdma.is_some(), is_rest: false, is_new: true }
    }

    /// The same at the port for what is not real time.
    #[must_use]
    pub fn of_rest(self) -> Self {
        Self { is_rest: true, ..self }
    }

    /// Whether it is at that port.
    pub fn is_rest(&self) -> bool {
        self.is_rest
    }

    /// What opens datagrams, where they are sealed.
    pub fn gate(&self) -> Option<&Gate> {
        self.gate.as_ref()
    }

    /// Whether a datagram that waited for so long in the socket is passed over. A socket that outlives routers may hold
    /// datagrams from before this router began. These say nothing of which peers live now.
    pub fn passes_over(&mut self, waited_ns: u64) -> bool {
        self.is_new &= waited_ns > SOCKET_MAX_NS;
        self.is_new
    }

    /// Takes a datagram; where it is sealed, it is opened in place.
    pub fn take(&mut self, on: &mut impl RxPlatform, now_ns: u64, came: &Envelope, datagram: &mut [u8]) {
        let Self { inbound, gate, .. } = self;
        let Some(gate) = gate else {
            let Envelope { source, arrived_ns, .. } = *came;
            let datagram = Datagram { source, arrived_ns, bytes: datagram };
            return inbound.handle(now_ns, &datagram, &mut on.delivery());
        };
        let mut reply = [0; ANSWER_BYTES];
        let said = gate.take(now_ns, came, datagram, inbound, &mut on.delivery(), &mut reply);
        if let Some(said) = said {
            self.say(on, said, reply);
        }
        // After the hello: earlier packages would not be taken.
        if self.gate.as_mut().is_some_and(|gate| gate.begin(now_ns)) {
            // Packages for this peer may leave.
            on.ring();
        }
    }

    /// Does what is due; when there is more, monotonic ns.
    pub fn poll(&mut self, on: &mut impl RxPlatform, now_ns: u64) -> u64 {
        self.ask(on, now_ns);
        let mut datagram = [0; ANSWER_BYTES];
        loop {
            let output = self.inbound.poll(now_ns, &mut datagram, &mut on.delivery());
            match output {
                InboundStep::Refuse { .. } if self.is_rest => {}
                // Without room for it, it is sent again a second later.
                InboundStep::Refuse { to, bytes } => drop(on.answer(Answer::Refusal { to, bytes, datagram })),
                InboundStep::Wait { until_ns } => return until_ns,
            }
        }
    }

    /// Sends challenges to peers without a session or without a sign of life, where datagrams are sealed.
    fn ask(&mut self, on: &mut impl RxPlatform, now_ns: u64) {
        let mut question = [0; ANSWER_BYTES];
        while let Some(gate) = &mut self.gate
            && let Some(said) = gate.ask(now_ns, &self.stats, &mut question)
        {
            self.say(on, said, question);
        }
    }

    /// Sends a hello. In time slots it waits for one, and packages sealed to an incarnation that begins by it wait for
    /// the hello.
    fn say(&self, on: &mut impl RxPlatform, said: OutgoingHello, datagram: [u8; ANSWER_BYTES]) {
        let answer = Answer::Hello { said, datagram };
        match &self.gate {
            // Without room for it, it is lost: a peer without a session is asked again.
            Some(gate) if self.in_slots => gate.waits(said, || on.answer(answer)),
            _ => drop(on.answer(answer)),
        }
    }
}
