//! Tracks each peer's authenticated incarnation. One thread writes; senders and the clock read.

use super::hello::Hello;
use super::keys::{Binding, Endpoint, KeyRing, Purpose};
use super::seal::{self, Seal};
use super::tally::Rejections;
use super::{HELLO_BYTES, HELLO_DATAGRAM_BYTES};
use crate::frame::{FrameHead, FrameKind, HEAD_BYTES, NodeIndex};
use crate::port::Port;
use crate::settings::Settings;
use rohrpost_mailbox::SeqCount;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

impl Port {
    pub(super) fn purpose(self) -> Purpose {
        match self {
            Self::Packages => Purpose::Packages,
            Self::Time => Purpose::Time,
            Self::Rest => Purpose::Rest,
            Self::Replicas => Purpose::Replicas,
        }
    }

    /// Whether a hello says from which sequence on its incarnation is heard there. Where none does, all that is sealed
    /// to a present incarnation may be opened, and once.
    pub(super) const fn is_in_hellos(self) -> bool {
        matches!(self, Self::Packages | Self::Time)
    }
}

/// A router, as far as keys depend on it.
#[derive(Clone, Copy, Debug)]
pub struct RouterIdentity {
    /// Its system.
    pub system: u8,
    /// Its node.
    pub own: NodeIndex,
    /// Nodes that there are.
    pub nodes: NodeIndex,
    /// Digest of its configuration.
    pub digest: u64,
    /// Its incarnation, from a source of random numbers that is fit for keys: if two incarnations had one, they would
    /// use a nonce twice. Not 0.
    pub incarnation: u64,
}

impl RouterIdentity {
    /// The router of these settings.
    pub fn of(settings: &Settings) -> Self {
        let Settings { system, own, digest, incarnation, .. } = *settings;
        Self { system, own, nodes: settings.nodes.len() as NodeIndex, digest, incarnation }
    }
}

/// An incarnation of a peer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct PeerIncarnation {
    pub(super) incarnation: u64,
    /// Place of the key that it is sent to with.
    pub(super) key: usize,
    /// Of packages and of time, as [`Port`] counts them: what it sent before is not taken.
    pub(super) next: [u64; 2],
}

/// What the threads of one router know of its peers' incarnations.
pub struct PeerSessions {
    pub(super) router: RouterIdentity,
    pub(super) keys: KeyRing,
    peers: Box<[PeerSession]>,
    /// Peers of which an incarnation is known, one bit each.
    known: AtomicU64,
    /// One bit for each peer with datagrams of another incarnation than the known one.
    doubts: AtomicU64,
    /// Peers for which a reply waits for a slot, one bit each: nothing is sealed to them before it has left.
    unsaid: AtomicU64,
    /// By [`Port`].
    rejections: [Arc<Rejections>; Port::ALL.len()],
}

impl fmt::Debug for PeerSessions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PeerSessions").field("router", &self.router).finish_non_exhaustive()
    }
}

/// Keys, challenge and counters of one peer.
#[derive(Default)]
struct PeerSession {
    /// By the place of the key.
    hello_to: Vec<Seal>,
    hello_from: Vec<Seal>,
    session: Published,
    /// What it must answer for an incarnation of it to begin.
    challenge: AtomicU64,
    /// Challenges to it.
    asked: AtomicU32,
    /// Hellos of this incarnation to it.
    hellos: AtomicU64,
    /// By [`Port`]: the next sequence that may be sealed.
    sealed: [AtomicU64; Port::ALL.len()],
}

impl PeerSessions {
    /// Nobody is known yet.
    ///
    /// # Panics
    /// If the incarnation is 0.
    pub fn new(router: RouterIdentity, keys: KeyRing) -> Arc<Self> {
        assert_ne!(router.incarnation, 0, "an incarnation is not 0");
        let seals = |from, to| {
            let (from, to) = (Endpoint::any(from), Endpoint::any(to));
            keys.derive_all(&Binding { purpose: Purpose::Hello, system: router.system, from, to })
        };
        let peer = |node| PeerSession {
            hello_to: seals(router.own, node),
            hello_from: seals(node, router.own),
            ..PeerSession::default()
        };
        let peers = (0..router.nodes).map(peer).collect();
        let rejections = Port::ALL.map(|_| Arc::new(Rejections::new(router.nodes)));
        let (known, doubts, unsaid) = Default::default();
        Arc::new(Self { peers, router, keys, known, doubts, unsaid, rejections })
    }

    /// What was not taken at a port.
    pub fn rejections(&self, port: Port) -> &Arc<Rejections> {
        &self.rejections[port as usize]
    }

    /// The peers that something can be sealed to, one bit each.
    pub fn known(&self) -> u64 {
        // ORDERING (F): a reader that finds a peer here finds its incarnation, and so can seal to it. Pairs with (E).
        self.known.load(Ordering::Acquire)
    }

    /// The peers of [`Self::known`] that can open what is sealed to them.
    pub fn reached(&self) -> u64 {
        // ORDERING (H): a reader that finds that a reply has left finds so after it has. Pairs with (G).
        self.known() & !self.unsaid.load(Ordering::Acquire)
    }

    /// A reply to a peer is to leave in a slot: until then it may not be able to open what is sealed to it. Whether
    /// none waited before.
    pub fn reply_waits(&self, peer: NodeIndex) -> bool {
        self.unsaid.fetch_or(1 << peer, Ordering::Relaxed) & 1 << peer == 0
    }

    /// It has left, or is lost: then the peer asks again.
    pub fn reply_left(&self, peer: NodeIndex) {
        // ORDERING (G): the reply was handed over before. Pairs with (H).
        self.unsaid.fetch_and(!(1 << peer), Ordering::Release);
    }

    /// The incarnation of a peer that is known to live, if there is one.
    pub fn incarnation(&self, peer: NodeIndex) -> Option<u64> {
        self.session(peer)?.1.map(|session| session.incarnation)
    }

    /// Whether a node of that number is a peer.
    pub(super) fn is_peer(&self, node: NodeIndex) -> bool {
        node < self.router.nodes && node != self.router.own
    }

    /// Grows with each incarnation that begins.
    pub(super) fn version(&self, peer: NodeIndex) -> u32 {
        self.peer(peer).session.version.version()
    }

    /// None while it is being written: then it is to be looked at again.
    pub(super) fn session(&self, peer: NodeIndex) -> Option<(u32, Option<PeerIncarnation>)> {
        self.peer(peer).session.read()
    }

    pub(super) fn begin(&self, peer: NodeIndex, session: PeerIncarnation) {
        self.peer(peer).session.write(session);
        // ORDERING (E): the incarnation was written before. Pairs with (F).
        self.known.fetch_or(1 << peer, Ordering::Release);
        self.doubts.fetch_and(!(1 << peer), Ordering::Relaxed);
    }

    /// Something came of another incarnation of a peer, or to another of ours: perhaps it has another by now. It is to
    /// be asked soon.
    pub(super) fn doubt(&self, peer: NodeIndex) {
        if !self.doubts(peer) {
            self.doubts.fetch_or(1 << peer, Ordering::Relaxed);
        }
    }

    pub(super) fn doubts(&self, peer: NodeIndex) -> bool {
        self.doubts.load(Ordering::Relaxed) & 1 << peer != 0
    }

    pub(super) fn doubted(&self, peer: NodeIndex) {
        self.doubts.fetch_and(!(1 << peer), Ordering::Relaxed);
    }

    pub(super) fn challenge(&self, peer: NodeIndex) -> u64 {
        self.peer(peer).challenge.load(Ordering::Relaxed)
    }

    pub(super) fn set_challenge(&self, peer: NodeIndex, challenge: u64) {
        self.peer(peer).challenge.store(challenge, Ordering::Relaxed);
    }

    /// Uses up a sequence. Each is used once, whichever threads call this: a second datagram with the nonce of a first
    /// would give away what is in both.
    ///
    /// # Panics
    /// If it was used before.
    pub(super) fn use_up(&self, port: Port, peer: NodeIndex, sequence: u64) {
        // ORDERING: Relaxed; nothing is handed over by it. All threads see its values in one order.
        let next = self.peer(peer).sealed[port as usize].fetch_max(sequence + 1, Ordering::Relaxed);
        assert!(sequence >= next, "sequence {sequence} is sealed a second time");
    }

    /// Key between two incarnations. Time is sealed to the node instead, since a joining node must read it before it is
    /// authenticated. The joining node treats as unverified all time sent before the hello that started the peer's
    /// session.
    pub(super) fn binding(&self, port: Port, from: Endpoint, to: Endpoint) -> Binding {
        let to = if port == Port::Time { Endpoint::any(to.node) } else { to };
        Binding { purpose: port.purpose(), system: self.router.system, from, to }
    }

    pub(super) fn own(&self) -> Endpoint {
        Endpoint { node: self.router.own, incarnation: self.router.incarnation }
    }

    pub(super) fn hello_from(&self, peer: NodeIndex, key: usize) -> &Seal {
        &self.peer(peer).hello_from[key]
    }

    /// Asks a peer whether it lives, in the first bytes of a datagram; how many. With one of the keys after the other:
    /// which of them the peer has is not known. None as long as no incarnation of it could take an answer.
    pub fn ask(&self, peer: NodeIndex, datagram: &mut [u8]) -> Option<usize> {
        let hello = Hello { challenge: self.challenge(peer), answer: 0, next: self.next(peer) };
        if hello.challenge == 0 {
            return None;
        }
        let asked = self.peer(peer).asked.fetch_add(1, Ordering::Relaxed) as usize;
        Some(self.hello(peer, asked % self.keys.len(), hello, datagram))
    }

    /// The sequences that come next: of packages, and of time.
    pub(super) fn next(&self, peer: NodeIndex) -> [u64; 2] {
        [Port::Packages, Port::Time].map(|port| self.peer(peer).sealed[port as usize].load(Ordering::Relaxed))
    }

    /// Writes a hello; how long its datagram is.
    ///
    /// # Panics
    /// If this incarnation has sent a peer all the hellos that it may. Only another incarnation, with other
    /// nonces, can go on. An attacker that replays a peer's challenges without end, and forges datagrams that make this
    /// node challenge and answer, 200 a second in all, gets there in 248 days; a peer that is away, in 136 years.
    pub(super) fn hello(&self, peer: NodeIndex, key: usize, hello: Hello, datagram: &mut [u8]) -> usize {
        let number = u32::try_from(self.peer(peer).hellos.fetch_add(1, Ordering::Relaxed));
        let number = number.expect("an incarnation says 2^32 hellos to a peer at most; the router begins another");
        let datagram = &mut datagram[..HELLO_DATAGRAM_BYTES];
        let RouterIdentity { system, own, digest, incarnation, .. } = self.router;
        let sequence = number.into();
        let head = FrameHead { kind: FrameKind::Hello, system, from: own, to: peer, digest, incarnation, sequence };
        head.write(self.keys.id(key), datagram);
        datagram[HEAD_BYTES..HEAD_BYTES + HELLO_BYTES].copy_from_slice(&hello.to_bytes());
        self.peer(peer).hello_to[key].close(seal::of_hello(incarnation, number), datagram);
        HELLO_DATAGRAM_BYTES
    }

    /// Pretends that this many hellos were sent to a peer.
    #[cfg(test)]
    pub(super) fn has_said(&self, peer: NodeIndex, hellos: u64) {
        self.peer(peer).hellos.store(hellos, Ordering::Relaxed);
    }

    fn peer(&self, peer: NodeIndex) -> &PeerSession {
        &self.peers[usize::from(peer)]
    }
}

const _: () = {
    assert!(rohrpost_network::NODES_MAX <= 64, "peers are the bits of a word");
};

/// An incarnation that one thread writes and others read, whole. A read during a write gets nothing, and the reader
/// keeps what it had.
#[derive(Default)]
struct Published {
    version: SeqCount,
    incarnation: AtomicU64,
    key: AtomicU64,
    next: [AtomicU64; 2],
}

impl Published {
    fn write(&self, session: PeerIncarnation) {
        self.version.write(|| {
            self.incarnation.store(session.incarnation, Ordering::Relaxed);
            self.key.store(session.key as u64, Ordering::Relaxed);
            self.next.iter().zip(session.next).for_each(|(place, next)| place.store(next, Ordering::Relaxed));
        });
    }

    fn read(&self) -> Option<(u32, Option<PeerIncarnation>)> {
        self.version.read(|| {
            let incarnation = self.incarnation.load(Ordering::Relaxed);
            let key = self.key.load(Ordering::Relaxed) as usize;
            let next = self.next.each_ref().map(|next| next.load(Ordering::Relaxed));
            (incarnation != 0).then_some(PeerIncarnation { incarnation, key, next })
        })
    }
}

/// What a thread has made of a peer's incarnation, until another begins.
pub(super) struct Known<K> {
    version: u32,
    pub(super) made: Option<K>,
}

impl<K> Default for Known<K> {
    fn default() -> Self {
        Self { version: 0, made: None }
    }
}

impl<K> Known<K> {
    /// What belongs to the present incarnation. A new one costs the derivation of its keys; else it is one load.
    pub(super) fn of(
        &mut self,
        all: &PeerSessions,
        peer: NodeIndex,
        make: impl FnOnce(&PeerIncarnation) -> K,
    ) -> Option<&mut K> {
        if all.version(peer) != self.version
            && let Some((version, session)) = all.session(peer)
        {
            self.version = version;
            self.made = session.as_ref().map(make);
        }
        self.made.as_mut()
    }
}
