//! The thread that reads the socket and puts packages from other nodes into the mailboxes of this one.

use super::ages::Ages;
use super::answers::ErrorReplier;
use super::news::News;
use super::sender_cache::SenderCache;
use super::slots::{Answer, REFUSAL_BYTES};
use super::socket::{InSocket, Received};
use super::threads::{Awake, Shared};
use crate::counts::Cause;
use crate::frame::NodeIndex;
use crate::inbound::{Datagram, Envelope, Inbound, InboundStep, SOCKET_MAX_NS};
use crate::report::{Deliver, NotDelivered, Report, RouterEvent};
use crate::security::{Gate, HELLO_DATAGRAM_BYTES, Said};
use crate::settings::Settings;
use crate::stats::Stats;
use rohrpost_mailbox::{Head, SendError, monotonic_ns};
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::time::Duration;

/// Room for the largest UDP datagram.
const DATAGRAM_BYTES: usize = 1 << 16;

const _: () = assert!(HELLO_DATAGRAM_BYTES <= REFUSAL_BYTES, "a hello leaves as a refusal does");

/// The other thread is rung this often at most.
const RING_EVERY_NS: u64 = 20_000_000;

/// State of the receiving thread.
pub(super) struct RxThread {
    pub(super) shared: Arc<Shared>,
    pub(super) socket: Arc<InSocket>,
    pub(super) inbound: Inbound,
    pub(super) delivery: PackageDelivery,
    pub(super) settings: Arc<Settings>,
    pub(super) stats: Arc<Stats>,
    /// Where datagrams are sealed: opens them, and tracks live peers.
    pub(super) guard: Option<Gate>,
    /// With time slots, refusals and hellos leave through them.
    pub(super) answers: Option<SyncSender<Answer>>,
    /// At the port for what is not real time: no hello or refusal leaves there.
    pub(super) is_rest: bool,
}

impl RxThread {
    /// Runs until the socket is closed.
    pub(super) fn run(mut self) {
        let (mut datagram, mut refusal) = (vec![0; DATAGRAM_BYTES], [0; REFUSAL_BYTES]);
        let (mut awake, mut ring_ns, mut seen_dropped) = (Awake::default(), 0, 0);
        // A socket that outlives routers may hold datagrams from before this router began. These say nothing of which
        // peers live now.
        let mut is_of_before = true;
        loop {
            let began_ns = monotonic_ns();
            let (received, now_ns) = (self.socket.receive(&mut datagram), monotonic_ns());
            awake.slept(Duration::from_nanos(now_ns.saturating_sub(began_ns)));
            match received {
                Received::Closed => return,
                Received::Nothing => {}
                Received::Datagram { waited_ns, dropped, .. } if is_of_before && waited_ns > SOCKET_MAX_NS => {
                    seen_dropped = dropped;
                    continue;
                }
                Received::Datagram { bytes, source, waited_ns, dropped } => {
                    is_of_before = false;
                    if dropped != seen_dropped {
                        self.stats.dropped.add(dropped.wrapping_sub(seen_dropped).into());
                        seen_dropped = dropped;
                    }
                    let came = Envelope { source, arrived_ns: now_ns.saturating_sub(waited_ns), bytes };
                    self.take(now_ns, &came, &mut datagram[..bytes]);
                }
            }
            self.ask(now_ns);
            while let InboundStep::Refuse { to, bytes } = self.inbound.poll(now_ns, &mut refusal, &mut self.delivery) {
                match &self.answers {
                    _ if self.is_rest => {}
                    // Without room in the queue it is lost, and sent again a second later.
                    Some(slots) => drop(slots.try_send(Answer::Refusal { to, bytes, datagram: refusal })),
                    None => self.socket.answer(to, &refusal[..bytes]),
                }
            }
            if now_ns >= ring_ns && !self.is_rest {
                ring_ns = now_ns + RING_EVERY_NS;
                self.shared.ring_if_due(now_ns);
            }
            awake.pause_if_long(now_ns);
        }
    }

    fn take(&mut self, now_ns: u64, came: &Envelope, datagram: &mut [u8]) {
        let Self { inbound, delivery, guard, .. } = self;
        let Some(gate) = guard else {
            let Envelope { source, arrived_ns, .. } = *came;
            return inbound.handle(now_ns, &Datagram { source, arrived_ns, bytes: datagram }, delivery);
        };
        let mut reply = [0; REFUSAL_BYTES];
        if let Some(said) = gate.take(now_ns, came, datagram, inbound, delivery, &mut reply) {
            self.say(said, reply);
        }
        // After the hello: earlier packages would not be taken.
        if self.guard.as_mut().is_some_and(|gate| gate.begin(now_ns)) {
            // Packages for this peer may leave.
            self.shared.ring();
        }
    }

    /// Sends challenges to peers without a session or without a sign of life, where datagrams are sealed.
    fn ask(&mut self, now_ns: u64) {
        let mut challenge = [0; REFUSAL_BYTES];
        while let Some(gate) = &mut self.guard
            && let Some(said) = gate.ask(now_ns, &self.stats, &mut challenge)
        {
            self.say(said, challenge);
        }
    }

    /// Sends a hello. In time slots it waits for one, and packages sealed to an incarnation that begins by it wait for
    /// the hello.
    fn say(&self, said: Said, datagram: [u8; REFUSAL_BYTES]) {
        let Some(slots) = &self.answers else {
            return self.socket.answer(self.settings.nodes[usize::from(said.to)].address, &datagram[..said.bytes]);
        };
        // Without room in the queue it is lost: a peer without a session is asked again.
        if let Some(gate) = &self.guard {
            gate.waits(said, || slots.try_send(Answer::Hello { said, datagram }).is_ok());
        }
    }
}

/// Delivers packages, and replies for undeliverable ones.
pub(super) struct PackageDelivery {
    pub(super) sender_cache: SenderCache,
    pub(super) answers: ErrorReplier,
    /// None where another thread reports the same.
    pub(super) news: Option<News>,
    pub(super) ages: Arc<Ages>,
    /// Largest body of the mailbox that refused the last package.
    pub(super) takes_bytes: Option<usize>,
}

impl Report for PackageDelivery {
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, body: &[u8], cause: Cause) {
        self.answers.answer_arrived(peer, head, body, cause, self.takes_bytes.take());
    }
}

impl Deliver for PackageDelivery {
    fn deliver(&mut self, _from: NodeIndex, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        let Err(error) = self.sender_cache.send(head, body) else {
            self.ages.note(head, body);
            return Ok(());
        };
        if let SendError::TooLarge { max, .. } = error {
            self.takes_bytes = Some(max);
        }
        Err(error.into())
    }

    fn event(&mut self, event: RouterEvent) {
        self.news.iter().for_each(|news| news.event(event));
    }
}
