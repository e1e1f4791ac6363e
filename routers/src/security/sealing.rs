//! The half that seals: one for each port, in the thread that sends there.

use super::keys::Endpoint;
use super::peer_sessions::{Known, PeerSessions};
use super::seal::{self, Seal};
use crate::frame::{self, FrameHead, NodeIndex};
use crate::port::Port;
use std::sync::Arc;

/// No incarnation of the peer has answered a challenge yet, so nothing can be sealed to it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("no router has answered there yet")]
pub struct NoSession;

/// Seals datagrams of one port.
pub struct Sealing {
    all: Arc<PeerSessions>,
    port: Port,
    peers: Box<[Known<PeerSeal>]>,
    /// By node and place of the key: seals that any incarnation of the node opens. Empty where only known peers are
    /// sealed to.
    strangers: Box<[Vec<Seal>]>,
}

/// Seal to a peer's present incarnation.
struct PeerSeal {
    /// Place of the key.
    key: usize,
    seal: Seal,
}

/// While there are two keys, one in so many datagrams is sealed with the other one: the peer's next incarnation may
/// have only that.
const OTHER_KEY_EVERY: u64 = 4;

impl Sealing {
    /// State for a port; there is one.
    pub fn new(all: &Arc<PeerSessions>, port: Port) -> Self {
        let peers = (0..all.router.nodes).map(|_| Known::default()).collect();
        Self { peers, strangers: Box::default(), all: all.clone(), port }
    }

    /// Seals time in time slots, to each node that has a key, known or not. A node that joins must hear time before
    /// it may send a challenge.
    pub fn of_slots(all: &Arc<PeerSessions>) -> Self {
        let seals = |node| all.keys.derive_all(&all.binding(Port::Time, all.own(), Endpoint::any(node)));
        Self { strangers: (0..all.router.nodes).map(seals).collect(), ..Self::new(all, Port::Time) }
    }

    /// Seals a datagram where it lies: 36 bytes for the head, what follows it, and [`TAG_BYTES`](super::TAG_BYTES) of
    /// room.
    ///
    /// # Errors
    /// [`Unacquainted`]: ask first.
    ///
    /// # Panics
    /// If a sequence of the head was sealed before.
    pub fn seal(&mut self, head: &FrameHead, datagram: &mut [u8]) -> Result<(), NoSession> {
        head.write(0, datagram);
        self.close(datagram)
    }

    /// Seals a datagram with a written head, with a check or without.
    ///
    /// # Errors
    /// [`Unacquainted`]: ask first.
    ///
    /// # Panics
    /// If a sequence of the head was sealed before, or there is no head.
    pub fn close(&mut self, datagram: &mut [u8]) -> Result<(), NoSession> {
        let (to, sequence) = frame::place_of(datagram);
        let port = self.port;
        let all = &self.all;
        let way = Self::way(&mut self.peers, all, port, to);
        let (key, seal) = match self.strangers.get(usize::from(to)) {
            Some(seals) => {
                let key = Self::key_to_stranger(way.map(|way| way.key), seals.len(), sequence);
                (key, &seals[key])
            }
            None => way.map(|way| (way.key, &way.seal)).ok_or(NoSession)?,
        };
        all.use_up(port, to, sequence);
        frame::write_key(all.keys.id(key), datagram);
        seal.close(seal::of_sequence(sequence), datagram);
        Ok(())
    }

    /// Place of the key for a peer that is not known, or may have restarted: mostly the key of the known incarnation,
    /// else each in turn.
    fn key_to_stranger(known: Option<usize>, keys: usize, sequence: u64) -> usize {
        match known {
            Some(key) if !sequence.is_multiple_of(OTHER_KEY_EVERY) => key,
            Some(key) => keys - 1 - key,
            None => sequence as usize % keys,
        }
    }

    /// Takes back what [`Self::close`] did last to a datagram that could not be sent: what is in it can be read again.
    ///
    /// # Panics
    /// If that was not done to it.
    pub fn reopen(&mut self, datagram: &mut [u8]) {
        let (to, sequence) = frame::place_of(datagram);
        // With the very key: another incarnation may have begun meanwhile.
        let way = self.peers[usize::from(to)].made.as_ref();
        let opened = way.and_then(|way| way.seal.open(seal::of_sequence(sequence), datagram));
        assert!(opened.is_some(), "what was just closed opens again");
    }

    fn way<'a>(
        peers: &'a mut [Known<PeerSeal>],
        all: &PeerSessions,
        port: Port,
        to: NodeIndex,
    ) -> Option<&'a mut PeerSeal> {
        peers[usize::from(to)].of(all, to, |session| {
            let peer = Endpoint { node: to, incarnation: session.incarnation };
            let seal = all.keys.derive(session.key, &all.binding(port, all.own(), peer));
            PeerSeal { key: session.key, seal }
        })
    }
}
