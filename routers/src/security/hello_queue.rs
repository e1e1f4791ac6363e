//! Hellos that wait for a time slot: for each peer the newest challenge and the newest reply.

use super::gate::OutgoingHello;
use super::peer_sessions::PeerSessions;
use super::{CHALLENGE_MAX_NS, HELLO_DATAGRAM_BYTES, TAG_BYTES};
use crate::frame::NodeIndex;
use std::sync::Arc;

/// A hello as slots count it: what seals it is around every datagram.
pub const HELLO_SLOT_BYTES: usize = HELLO_DATAGRAM_BYTES - TAG_BYTES;

/// Used by the sending thread of a node in time slots.
pub struct HelloQueue {
    all: Arc<PeerSessions>,
    /// By peer: its challenge and its reply.
    peers: Box<[[Option<Word>; 2]]>,
    /// The peer with the next turn.
    next: usize,
}

#[derive(Clone, Copy)]
struct Word {
    /// When it was made, ns.
    at_ns: u64,
    /// An incarnation begins by it.
    begins: bool,
    datagram: [u8; HELLO_DATAGRAM_BYTES],
}

impl HelloQueue {
    /// Nothing waits.
    pub fn new(all: &Arc<PeerSessions>) -> Self {
        Self { peers: vec![[None; 2]; all.router.nodes.into()].into(), all: all.clone(), next: 0 }
    }

    /// A hello that is to leave. It replaces the waiting hello. A reply that starts a session is replaced only by
    /// another such reply.
    ///
    /// # Panics
    /// If the datagram is shorter than a hello.
    pub fn put(&mut self, now_ns: u64, said: OutgoingHello, datagram: &[u8]) {
        let mut word = Word { at_ns: now_ns, begins: said.begins, datagram: [0; HELLO_DATAGRAM_BYTES] };
        word.datagram.copy_from_slice(&datagram[..HELLO_DATAGRAM_BYTES]);
        let Some(peer) = self.peers.get_mut(usize::from(said.to)) else { return };
        let place = &mut peer[usize::from(said.is_reply)];
        let stays = place.is_some_and(|before| before.begins && !word.begins && !before.is_old(now_ns));
        if !stays {
            *place = Some(word);
        }
    }

    /// The next that is to leave: replies first, and those to one peer before others; then all in turn. What is too old
    /// to be answered is dropped. When it has left, [`Self::left`].
    pub fn take(
        &mut self,
        now_ns: u64,
        first: Option<NodeIndex>,
    ) -> Option<(OutgoingHello, [u8; HELLO_DATAGRAM_BYTES])> {
        let (next, peers) = (self.next, self.peers.len());
        let first = first.map(usize::from).filter(|first| *first < peers);
        for is_reply in [true, false] {
            let turns = (0..peers).map(|turn| (next + turn) % peers);
            for to in first.into_iter().chain(turns) {
                let Some(word) = self.peers[to][usize::from(is_reply)].take() else { continue };
                if word.is_old(now_ns) {
                    if word.begins {
                        self.all.reply_left(to as NodeIndex);
                    }
                } else {
                    self.next = (to + 1) % peers;
                    let (bytes, begins) = (HELLO_DATAGRAM_BYTES, word.begins);
                    let said = OutgoingHello { to: to as NodeIndex, bytes, is_reply, begins };
                    return Some((said, word.datagram));
                }
            }
        }
        None
    }

    /// It was handed to the network: if it was a reply, its peer can open what is sealed to it from now on.
    pub fn left(&self, said: OutgoingHello) {
        if said.is_reply {
            self.all.reply_left(said.to);
        }
    }
}

impl Word {
    /// Nobody would take an answer to it, or it as one.
    fn is_old(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.at_ns) >= CHALLENGE_MAX_NS
    }
}
