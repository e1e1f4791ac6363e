//! The half that opens: one for each port, in the thread that receives there.

use super::HELLO_DATAGRAM_BYTES;
use super::hello::Hello;
use super::keys::Endpoint;
use super::peer_sessions::{Known, PeerSessions};
use super::rejection::{NotOpened, Rejection};
use super::seal::{self, Seal};
use super::unverified::UnverifiedIncarnations;
use crate::frame::{FrameHead, FrameKind, NodeIndex};
use crate::inbound::window::{Arrival, SequenceWindow};
use crate::port::Port;
use std::sync::Arc;

/// A datagram with a valid seal.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Opened<'a> {
    /// A frame from the peer's present incarnation to our present one, not opened before: its head and its text.
    Frame(FrameHead, &'a [u8]),
    /// A hello from some incarnation of the peer, perhaps an old one: for the [`Handshake`](super::Handshake) alone.
    Hello(FrameHead, OpenedHello),
}

/// A hello as it came.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct OpenedHello {
    /// What it says.
    pub hello: Hello,
    /// Place of its key.
    pub(super) key: usize,
}

/// Opens datagrams of one port.
pub struct Opening {
    all: Arc<PeerSessions>,
    port: Port,
    peers: Box<[Known<HeardIncarnation>]>,
    /// By node: incarnations of it that are not known to live.
    overheard: Box<[UnverifiedIncarnations]>,
    /// By node; the one that was heard last stands first.
    past: Box<[[Past; PAST]]>,
}

/// Incarnations of a peer that took turns: so many are remembered, each with what was opened of it, at a port that is
/// not in hellos.
const PAST: usize = 4;

/// An incarnation that was heard at such a port, and from which sequence on it is heard when it is taken for the
/// present one again.
#[derive(Clone, Copy, Default)]
struct Past {
    incarnation: u64,
    next: u64,
}

/// A peer's present incarnation as it is heard.
struct HeardIncarnation {
    incarnation: u64,
    /// By the place of the key: which of two the peer seals with is its choice.
    seals: Vec<Seal>,
    /// From this sequence on it is heard. Where no hello says it, it is that of what is opened first.
    first: Option<u64>,
    window: SequenceWindow,
}

impl Opening {
    /// State for a port; there is one.
    pub fn new(all: &Arc<PeerSessions>, port: Port) -> Self {
        let peers = (0..all.router.nodes).map(|_| Known::default()).collect();
        let overheard = (0..all.router.nodes).map(|_| UnverifiedIncarnations::default()).collect();
        let past = vec![<[Past; PAST]>::default(); all.router.nodes.into()].into();
        Self { peers, overheard, past, all: all.clone(), port }
    }

    /// Opens a datagram where it lies. Its head can be believed then, but not before.
    ///
    /// # Errors
    /// [`NotOpened`]; nothing has changed, and no key was derived.
    pub fn open<'a>(&mut self, datagram: &'a mut [u8]) -> Result<Opened<'a>, NotOpened> {
        self.open_from(datagram, |_| true)
    }

    /// The same, if it comes from where the node is that it says it is from: what others bring costs no opening, and
    /// does not use up what comes from there.
    ///
    /// # Errors
    /// [`NotOpened`]; nothing has changed, and no key was derived.
    pub fn open_from<'a>(
        &mut self,
        datagram: &'a mut [u8],
        is_there: impl Fn(NodeIndex) -> bool,
    ) -> Result<Opened<'a>, NotOpened> {
        let (head, key) = self.head(datagram, is_there)?;
        let all = &self.all;
        if head.kind == FrameKind::Hello {
            return Ok(Opened::Hello(head, self.hello(&head, key, datagram)?));
        }
        let past = &mut self.past[usize::from(head.from)];
        let heard = Self::heard(&mut self.peers, &self.overheard, past, all, self.port, head.from);
        let heard = heard.filter(|heard| heard.incarnation == head.incarnation).ok_or_else(|| {
            all.doubt(head.from);
            Rejection::OtherIncarnation
        })?;
        if heard.window.is_duplicate(head.sequence) {
            return Err(Rejection::Replay.into());
        }
        let text = heard.seals[key].open(seal::of_sequence(head.sequence), datagram).ok_or(Rejection::Forged)?;
        // What the network lost is another's to count.
        let arrival = heard.window.arrive(head.sequence, &mut 0);
        debug_assert!(arrival != Arrival::Duplicate);
        heard.first.get_or_insert(head.sequence);
        if !self.port.is_in_hellos() {
            past[0].next = heard.window.next();
        }
        Ok(Opened::Frame(head, text))
    }

    /// Whether a datagram of time says that it is of another incarnation of its node than the known one, or none is
    /// known: then it can be overheard.
    pub fn is_strange(&mut self, datagram: &[u8]) -> bool {
        let Ok((head, _)) = FrameHead::read(datagram) else { return false };
        let is_theirs = self.port == Port::Time && self.is_ours(&head) && head.kind != FrameKind::Hello;
        let heard = |opening: &mut Self| {
            let Self { peers, overheard, past, all, port } = opening;
            let heard = Self::heard(peers, overheard, &mut past[usize::from(head.from)], all, *port, head.from);
            heard.is_some_and(|heard| heard.incarnation == head.incarnation)
        };
        is_theirs && !heard(self)
    }

    /// Opens a datagram that [`Self::is_strange`]: some incarnation of its node has said it to this node at some time.
    /// For each incarnation that is named a key is derived, which costs about as much as to open a datagram.
    /// `is_there`: see [`Self::open_from`].
    ///
    /// # Errors
    /// [`NotOpened`]
    pub fn overhear<'a>(
        &mut self,
        datagram: &'a mut [u8],
        is_there: impl Fn(NodeIndex) -> bool,
    ) -> Result<(FrameHead, &'a [u8]), NotOpened> {
        let (head, key) = self.head(datagram, is_there)?;
        self.all.doubt(head.from);
        let all = &self.all;
        let text = self.overheard[usize::from(head.from)].open((&head, key), datagram, || {
            let peer = Endpoint { node: head.from, incarnation: head.incarnation };
            all.keys.derive(key, &all.binding(Port::Time, peer, all.own()))
        });
        Ok((head, text.ok_or(Rejection::Forged)?))
    }

    /// The head of what says that it is for this node, and comes from where its sender is; and the place of its key.
    fn head(&self, datagram: &[u8], is_there: impl Fn(NodeIndex) -> bool) -> Result<(FrameHead, usize), NotOpened> {
        let (head, key_id) = FrameHead::read(datagram)?;
        if key_id == 0 {
            return Err(Rejection::Unsealed.into());
        }
        let key = self.all.keys.place(key_id).ok_or(Rejection::OtherKey)?;
        if !self.is_ours(&head) {
            return Err(Rejection::NotOurs.into());
        }
        if !is_there(head.from) {
            return Err(Rejection::Address.into());
        }
        Ok((head, key))
    }

    /// Whether it says that it comes from another node of ours, to this one.
    fn is_ours(&self, head: &FrameHead) -> bool {
        let all = &self.all;
        all.is_peer(head.from) && head.to == all.router.own && head.system == all.router.system
    }

    /// First sequence that counts for the peer's last opened incarnation; missing sequences from there on are lost.
    pub(super) fn first(&self, peer: NodeIndex) -> u64 {
        self.peers[usize::from(peer)].made.as_ref().and_then(|heard| heard.first).unwrap_or(0)
    }

    fn hello(&self, head: &FrameHead, key: usize, datagram: &mut [u8]) -> Result<OpenedHello, Rejection> {
        if self.port != Port::Packages {
            return Err(Rejection::NotOurs);
        }
        if datagram.len() != HELLO_DATAGRAM_BYTES {
            return Err(Rejection::Forged);
        }
        let number = u32::try_from(head.sequence).map_err(|_| Rejection::Forged)?;
        let seal = self.all.hello_from(head.from, key);
        let text = seal.open(seal::of_hello(head.incarnation, number), datagram).ok_or(Rejection::Forged)?;
        Ok(OpenedHello { hello: Hello::parse(text).ok_or(Rejection::Forged)?, key })
    }

    fn heard<'a>(
        peers: &'a mut [Known<HeardIncarnation>],
        overheard: &[UnverifiedIncarnations],
        past: &mut [Past; PAST],
        all: &PeerSessions,
        port: Port,
        from: NodeIndex,
    ) -> Option<&'a mut HeardIncarnation> {
        peers[usize::from(from)].of(all, from, |session| {
            let peer = Endpoint { node: from, incarnation: session.incarnation };
            let from = if port.is_in_hellos() {
                // What was overheard is not proven a second time.
                session.next[port as usize].max(overheard[usize::from(from)].next(session.incarnation))
            } else {
                // What is sealed there is sealed to this incarnation of ours: all of it may be opened, and once.
                remembered(past, session.incarnation)
            };
            HeardIncarnation {
                incarnation: session.incarnation,
                seals: all.keys.derive_all(&all.binding(port, peer, all.own())),
                first: port.is_in_hellos().then_some(from),
                window: SequenceWindow::going_on(from),
            }
        })
    }
}

/// Moves an incarnation that becomes the present one to the front of the remembered ones, and returns its first
/// acceptable sequence. Nothing is opened twice as long as at most [`PAST`] routers of one node live at once.
fn remembered(past: &mut [Past; PAST], incarnation: u64) -> u64 {
    let at = past.iter().position(|past| past.incarnation == incarnation);
    past[..=at.unwrap_or(PAST - 1)].rotate_right(1);
    if at.is_none() {
        past[0] = Past { incarnation, next: 0 };
    }
    past[0].next
}
