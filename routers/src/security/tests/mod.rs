//! Two routers that seal, a wire that keeps all datagrams, and an attacker with access to it.

mod gate;
mod handshake;
mod hostile;
mod sealed;
mod slots;

use super::*;
use crate::frame::{FrameHead, FrameKind, HEAD_BYTES, NodeIndex};
use std::num::NonZeroU8;
use std::sync::Arc;

pub(super) const SYSTEM: u8 = 1;
pub(super) const DIGEST: u64 = 7;

/// The installation key of an id, the same on every node that has it.
pub(super) fn key(id: u8) -> InstallationKey {
    key_of(id, [id; KEY_BYTES])
}

pub(super) fn key_of(id: u8, bytes: [u8; KEY_BYTES]) -> InstallationKey {
    InstallationKey::new(KeyId(NonZeroU8::new(id).unwrap()), &bytes)
}

/// Keys of these ids, the newest first.
pub(super) fn ring(ids: &[u8]) -> KeyRing {
    KeyRing::new(key(ids[0]), ids.get(1).map(|id| key(*id)))
}

/// One incarnation of a router.
pub(super) struct Router {
    pub(super) own: NodeIndex,
    pub(super) incarnation: u64,
    pub(super) all: Arc<PeerSessions>,
    pub(super) handshake: Handshake,
    /// By port.
    pub(super) sealing: [Sealing; Port::ALL.len()],
    pub(super) opening: [Opening; Port::ALL.len()],
    pub(super) next: [u64; Port::ALL.len()],
}

impl Router {
    pub(super) fn new(own: NodeIndex, incarnation: u64) -> Self {
        Self::with_keys(own, incarnation, ring(&[1]))
    }

    pub(super) fn with_keys(own: NodeIndex, incarnation: u64, keys: KeyRing) -> Self {
        let router = RouterIdentity { system: SYSTEM, own, nodes: 3, digest: DIGEST, incarnation };
        let all = PeerSessions::new(router, keys);
        let mut seed = [own; 32];
        seed[..8].copy_from_slice(&incarnation.to_le_bytes());
        Self {
            own,
            incarnation,
            handshake: Handshake::new(&all, seed),
            sealing: Port::ALL.map(|port| Sealing::new(&all, port)),
            opening: Port::ALL.map(|port| Opening::new(&all, port)),
            next: [0; Port::ALL.len()],
            all,
        }
    }

    pub(super) fn ask(&self, peer: NodeIndex) -> Vec<u8> {
        let mut datagram = [0; 100];
        let bytes = self.all.ask(peer, &mut datagram).unwrap();
        datagram[..bytes].to_vec()
    }

    pub(super) fn head(&self, port: Port, to: NodeIndex, sequence: u64) -> FrameHead {
        let kind = match port {
            Port::Packages | Port::Rest => FrameKind::Packages,
            Port::Time => FrameKind::Sync,
            Port::Replicas => FrameKind::RecordPart,
        };
        FrameHead { kind, system: SYSTEM, from: self.own, to, digest: DIGEST, incarnation: self.incarnation, sequence }
    }

    /// The next datagram of a port.
    pub(super) fn seal(&mut self, port: Port, to: NodeIndex, text: &[u8]) -> Result<Vec<u8>, NoSession> {
        let head = self.head(port, to, self.next[port as usize]);
        self.next[port as usize] += 1;
        let mut datagram = [&[0; HEAD_BYTES], text, &[0; TAG_BYTES]].concat();
        self.sealing[port as usize].seal(&head, &mut datagram).map(|()| datagram)
    }

    pub(super) fn open(&mut self, port: Port, datagram: &[u8]) -> Result<(FrameHead, Vec<u8>), NotOpened> {
        match self.opening[port as usize].open(&mut datagram.to_vec())? {
            Opened::Frame(head, text) => Ok((head, text.to_vec())),
            Opened::Hello(..) => panic!("a hello in the place of a frame"),
        }
    }

    /// Takes a hello: whether an incarnation began by it, and the answer.
    pub(super) fn greet(&mut self, datagram: &[u8]) -> Result<(bool, Option<Vec<u8>>), NotOpened> {
        self.greet_at(0, datagram)
    }

    pub(super) fn greet_at(&mut self, now_ns: u64, datagram: &[u8]) -> Result<(bool, Option<Vec<u8>>), NotOpened> {
        let mut room = [0; HELLO_DATAGRAM_BYTES];
        match self.opening[0].open(&mut datagram.to_vec())? {
            Opened::Hello(head, hello) => {
                let greeted = self.handshake.receive(now_ns, &head, &hello, &mut room);
                assert_eq!(self.handshake.begin().is_some(), greeted.begins);
                Ok((greeted.begins, greeted.reply_bytes.map(|bytes| room[..bytes].to_vec())))
            }
            Opened::Frame(..) => panic!("a frame in the place of a hello"),
        }
    }
}

/// Lets one ask and hands hellos to and fro until there are no more; all of them.
pub(super) fn acquaint(asks: &mut Router, other: &mut Router) -> Vec<Vec<u8>> {
    let mut said = vec![asks.ask(other.own)];
    loop {
        let listens = if said.len() % 2 == 1 { &mut *other } else { &mut *asks };
        match listens.greet(&said[said.len() - 1]).unwrap().1 {
            Some(answer) => said.push(answer),
            None => return said,
        }
        assert!(said.len() < 10, "they never come to an end");
    }
}

/// Two that know each other.
pub(super) fn pair() -> (Router, Router) {
    let (mut a, mut b) = (Router::new(0, 100), Router::new(1, 200));
    acquaint(&mut a, &mut b);
    (a, b)
}

/// The datagram with a check that is right, as anyone can write it.
pub(super) fn checked(mut datagram: Vec<u8>) -> Vec<u8> {
    crate::frame::write_check(&mut datagram);
    datagram
}
