//! Opens datagrams before the receiving half of a router handles them, and challenges peers that are
//! not known.

use super::handshake::Handshake;
use super::opening::{Opened, OpenedHello, Opening};
use super::peer_sessions::PeerSessions;
use super::rejection::{NotOpened, Rejection};
use super::tally::Tally;
use crate::frame::{self, BadFrame, FrameHead, NodeIndex};
use crate::inbound::{Envelope, Inbound};
use crate::link::SILENT_AFTER_NS;
use crate::port::Port;
use crate::report::{Deliver, Mismatch, RouterEvent};
use crate::stats::Stats;
use std::sync::Arc;

/// Interval of challenges to a peer that is not known, or silent.
pub const ASK_EVERY_NS: u64 = 100_000_000;
/// After this time without an answer a peer is challenged seldom: when it starts, it challenges this node.
const EAGER_FOR_NS: u64 = 10_000_000_000;
/// See [`EAGER_FOR_NS`].
const ASK_SELDOM_NS: u64 = 1_000_000_000;
/// A peer that says something of another incarnation than the one that is known is asked so often at most.
const DOUBT_EVERY_NS: u64 = 20_000_000;

/// Interval at which the gate looks for peers to challenge, however many datagrams come.
const LOOK_EVERY_NS: u64 = 10_000_000;

/// A hello in the buffer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct OutgoingHello {
    /// The receiver.
    pub to: NodeIndex,
    /// How long it is.
    pub bytes: usize,
    /// It answers one.
    pub is_reply: bool,
    /// An incarnation begins when it has left.
    pub begins: bool,
}

/// One, in the thread that receives packages.
pub struct Gate {
    all: Arc<PeerSessions>,
    opening: Opening,
    /// None at a port without handshakes: the port of packages finds out which incarnations live.
    handshake: Option<Handshake>,
    tally: Tally,
    peers: Box<[ChallengeSchedule]>,
    /// Nobody is to be asked before this, ns.
    look_ns: u64,
}

/// What decides when a peer is challenged again.
#[derive(Clone, Copy, Default)]
struct ChallengeSchedule {
    /// When it was asked last, ns; none: never.
    at_ns: Option<u64>,
    /// When its present incarnation began, ns.
    began_ns: u64,
    /// Since when it is not known, or silent, ns.
    missed_since_ns: Option<u64>,
}

impl Gate {
    /// `seed` comes from a source of random numbers that is fit for keys; each incarnation has another.
    pub fn new(all: &Arc<PeerSessions>, seed: [u8; 32]) -> Self {
        Self::of(all, Port::Packages, Some(Handshake::new(all, seed)))
    }

    /// A gate at a port where no hello comes, in the thread that receives there.
    pub fn without_hellos(all: &Arc<PeerSessions>, port: Port) -> Self {
        Self::of(all, port, None)
    }

    fn of(all: &Arc<PeerSessions>, port: Port, handshake: Option<Handshake>) -> Self {
        Self {
            opening: Opening::new(all, port),
            handshake,
            tally: Tally::new(all.rejections(port)),
            peers: vec![ChallengeSchedule::default(); all.router.nodes.into()].into(),
            all: all.clone(),
            look_ns: 0,
        }
    }

    /// Takes a datagram, whatever it is. `reply` has room for a hello
    /// ([`HELLO_DATAGRAM_BYTES`](super::HELLO_DATAGRAM_BYTES)), if one is to be sent back. Then [`Self::begin`].
    pub fn take(
        &mut self,
        now_ns: u64,
        came: &Envelope,
        datagram: &mut [u8],
        inbound: &mut Inbound,
        deliver: &mut impl Deliver,
        reply: &mut [u8],
    ) -> Option<OutgoingHello> {
        if datagram.len() > inbound.sealed_bytes_max() {
            let why = Rejection::NotOurs;
            self.reject(now_ns, came, why, why.into(), inbound, deliver);
            return None;
        }
        match self.opening.open_from(datagram, |from| inbound.is_address_of(from, came.source)) {
            Ok(Opened::Frame(head, text)) => {
                inbound.handle_opened(now_ns, came, (&head, text, self.first(head.from)), deliver);
            }
            Ok(Opened::Hello(head, opened)) => {
                if let Some(handshake) = &mut self.handshake
                    && inbound.may_handshake(now_ns, came.source, &head, deliver)
                {
                    let outcome = handshake.receive(now_ns, &head, &opened, reply);
                    let said = |bytes| OutgoingHello { to: head.from, bytes, is_reply: true, begins: outcome.begins };
                    return outcome.reply_bytes.map(said);
                }
                if inbound.is_of_other(came.source, &head) {
                    return self.answer_other(now_ns, &head, &opened, inbound, reply);
                }
            }
            Err(NotOpened::Bad(why @ (BadFrame::Foreign | BadFrame::Damaged(_) | BadFrame::Sealed))) => {
                inbound.bad(came.source, why);
            }
            Err(why @ NotOpened::Bad(BadFrame::Version(_))) => {
                self.reject(now_ns, came, Rejection::Version, why, inbound, deliver);
            }
            Err(why @ NotOpened::Rejected(rejection)) => self.reject(now_ns, came, rejection, why, inbound, deliver),
        }
        None
    }

    /// Tells a peer with another configuration so, in a sealed reply. Without it each end would take the other's
    /// datagrams for replays.
    fn answer_other(
        &mut self,
        now_ns: u64,
        head: &FrameHead,
        opened: &OpenedHello,
        inbound: &Inbound,
        reply: &mut [u8],
    ) -> Option<OutgoingHello> {
        let outcome = self.handshake.as_mut()?.take(now_ns, head, opened, false, reply);
        if outcome.proves && opened.hello.next[Port::Time as usize] > 0 {
            inbound.tells_other(now_ns, head);
        }
        outcome.reply_bytes.map(|bytes| OutgoingHello { to: head.from, bytes, is_reply: true, begins: false })
    }

    /// First sequence of a peer's present incarnation that counts; what is missing from there on is lost.
    pub fn first(&self, peer: NodeIndex) -> u64 {
        self.opening.first(peer)
    }

    /// Has a hello wait for a slot: `put` says whether there was room. Nothing is sealed to an incarnation that begins
    /// by it before it has left; but if it is lost, nothing waits for it.
    pub fn waits(&self, said: OutgoingHello, put: impl FnOnce() -> bool) {
        let waits = said.begins && self.all.reply_waits(said.to);
        if !put() && waits {
            self.all.reply_left(said.to);
        }
    }

    /// Starts the session with the incarnation that the last hello proved alive; returns whether there is one. Call it
    /// after the reply has left.
    pub fn begin(&mut self, now_ns: u64) -> bool {
        let began = self.handshake.as_mut().and_then(Handshake::begin);
        if let Some(peer) = began {
            self.peers[usize::from(peer)].began_ns = now_ns;
        }
        began.is_some()
    }

    /// The next challenge that is due. Each peer is asked until it is heard, and again when nothing is heard of it.
    pub fn ask(&mut self, now_ns: u64, stats: &Stats, datagram: &mut [u8]) -> Option<OutgoingHello> {
        if now_ns < self.look_ns || self.handshake.is_none() {
            return None;
        }
        let mut peers = 0..self.all.router.nodes;
        let Some(to) = peers.find(|peer| self.is_to_be_asked(*peer, now_ns, stats)) else {
            self.look_ns = now_ns + LOOK_EVERY_NS;
            return None;
        };
        self.peers[usize::from(to)].at_ns = Some(now_ns);
        self.all.doubted(to);
        self.handshake.as_mut()?.refresh(now_ns, to);
        self.all.ask(to, datagram).map(|bytes| OutgoingHello { to, bytes, is_reply: false, begins: false })
    }

    fn is_to_be_asked(&mut self, peer: NodeIndex, now_ns: u64, stats: &Stats) -> bool {
        let ChallengeSchedule { at_ns, began_ns, missed_since_ns } = &mut self.peers[usize::from(peer)];
        let is_over = |every_ns| at_ns.is_none_or(|at_ns| at_ns + every_ns <= now_ns);
        if !self.all.is_peer(peer) || !is_over(DOUBT_EVERY_NS) {
            return false;
        }
        let heard_ns = stats.peer(peer).link.heard_ns.get().max(*began_ns);
        let is_missed = self.all.known() & 1 << peer == 0 || heard_ns + SILENT_AFTER_NS <= now_ns;
        *missed_since_ns = is_missed.then(|| missed_since_ns.unwrap_or(now_ns));
        let every_ns = missed_since_ns.map(|since_ns| match now_ns.saturating_sub(since_ns) < EAGER_FOR_NS {
            true => ASK_EVERY_NS,
            false => ASK_SELDOM_NS,
        });
        self.all.doubts(peer) || every_ns.is_some_and(is_over)
    }

    fn reject(
        &mut self,
        now_ns: u64,
        came: &Envelope,
        rejection: Rejection,
        why: NotOpened,
        inbound: &Inbound,
        deliver: &mut impl Deliver,
    ) {
        let (source, peer) = (came.source, inbound.peer_at(came.source));
        if let Some((peer, reason)) = peer.zip(rejection.reason()) {
            let version = if let NotOpened::Bad(BadFrame::Version(version)) = why { version } else { frame::VERSION };
            inbound.suspect(now_ns, peer, Mismatch { reason, version, digest: None });
        }
        if let Some(datagrams) = self.tally.note(now_ns, peer, rejection) {
            deliver.event(RouterEvent::Rejected { source, peer, why, datagrams });
        }
    }
}
