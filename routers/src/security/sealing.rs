//! The half that seals: one for each port, in the thread that sends there.

use super::acquaintances::{Acquaintances, Known, Port};
use super::keys::End;
use super::seal::{self, Seal};
use crate::frame::{self, FrameHead, NodeIndex};
use std::sync::Arc;

/// No life of the peer is known to live, so there is nobody to seal to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("no router has answered there yet")]
pub struct Unacquainted;

/// Seals datagrams of one port.
pub struct Sealing {
    all: Arc<Acquaintances>,
    port: Port,
    peers: Box<[Known<Way>]>,
}

/// To a peer's present life.
struct Way {
    key_id: u8,
    seal: Seal,
}

impl Sealing {
    /// For a port; there is one.
    pub fn new(all: &Arc<Acquaintances>, port: Port) -> Self {
        Self { peers: (0..all.who.nodes).map(|_| Known::default()).collect(), all: all.clone(), port }
    }

    /// Seals a datagram where it lies: 36 bytes for the head, what follows it, and [`TAG_BYTES`](super::TAG_BYTES) of room.
    ///
    /// # Errors
    /// [`Unacquainted`]: ask first.
    ///
    /// # Panics
    /// If a sequence of the head was sealed before.
    pub fn seal(&mut self, head: &FrameHead, datagram: &mut [u8]) -> Result<(), Unacquainted> {
        head.write(0, datagram);
        self.close(datagram)
    }

    /// The same of a datagram whose head was written, with a check or without.
    ///
    /// # Errors
    /// [`Unacquainted`]: ask first.
    ///
    /// # Panics
    /// If a sequence of the head was sealed before, or there is no head.
    pub fn close(&mut self, datagram: &mut [u8]) -> Result<(), Unacquainted> {
        let (to, sequence) = frame::place_of(datagram);
        let port = self.port;
        let all = &self.all;
        let way = Self::way(&mut self.peers, all, port, to).ok_or(Unacquainted)?;
        all.use_up(port, to, sequence);
        frame::write_key(way.key_id, datagram);
        way.seal.close(seal::of_sequence(sequence), datagram);
        Ok(())
    }

    /// Takes back what [`Self::close`] did last to a datagram that could not be sent: what is in it can be read again.
    ///
    /// # Panics
    /// If that was not done to it.
    pub fn reopen(&mut self, datagram: &mut [u8]) {
        let (to, sequence) = frame::place_of(datagram);
        // With the very key: another life may have begun meanwhile.
        let way = self.peers[usize::from(to)].made.as_ref();
        let opened = way.and_then(|way| way.seal.open(seal::of_sequence(sequence), datagram));
        assert!(opened.is_some(), "what was just closed opens again");
    }

    fn way<'a>(peers: &'a mut [Known<Way>], all: &Acquaintances, port: Port, to: NodeIndex) -> Option<&'a mut Way> {
        peers[usize::from(to)].of(all, to, |life| {
            let peer = End { node: to, incarnation: life.incarnation };
            let seal = all.keys.derive(life.key, &all.binding(port, all.own(), peer));
            Way { key_id: all.keys.id(life.key), seal }
        })
    }

    /// Asks a peer whether it lives, in the first bytes of a datagram; how many. It is to be asked until it is heard.
    pub fn ask(&self, peer: NodeIndex, datagram: &mut [u8]) -> Option<usize> {
        self.all.ask(peer, datagram)
    }
}
