//! A datagram of 64 bytes, sealed and opened.

use super::Path;
use rohrpost_routers::frame::{FrameHead, FrameKind, HEAD_BYTES, NodeIndex};
use rohrpost_routers::security::{
    HELLO_DATAGRAM_BYTES, Handshake, InstallationKey, KeyId, KeyRing, Opened, Opening, PeerSessions, Port,
    RouterIdentity, Sealing, TAG_BYTES,
};
use std::num::NonZeroU8;

const DATAGRAM_BYTES: usize = HEAD_BYTES + 64 + TAG_BYTES;

/// One of two routers that share a key.
struct Router {
    own: NodeIndex,
    handshake: Handshake,
    sealing: Sealing,
    opening: Opening,
}

impl Router {
    fn new(own: NodeIndex) -> Self {
        let router = RouterIdentity { system: 1, own, nodes: 2, digest: 7, incarnation: 100 + u64::from(own) };
        let all = PeerSessions::new(router, KeyRing::new(InstallationKey::new(KeyId(NonZeroU8::MIN), &[3; 32]), None));
        let (sealing, opening) = (Sealing::new(&all, Port::Packages), Opening::new(&all, Port::Packages));
        Self { own, handshake: Handshake::new(&all, [own; 32]), sealing, opening }
    }

    /// Takes a hello; what it answers takes its place.
    fn greet(&mut self, hello: &mut [u8; HELLO_DATAGRAM_BYTES]) {
        let mut reply = [0; HELLO_DATAGRAM_BYTES];
        let Opened::Hello(head, asked) = self.opening.open(hello).unwrap() else { panic!("no hello") };
        self.handshake.receive(0, &head, &asked, &mut reply);
        self.handshake.begin();
        *hello = reply;
    }
}

/// Seals a datagram.
pub(super) struct Seal {
    from: Router,
    to: Router,
    sequence: u64,
    datagram: [u8; DATAGRAM_BYTES],
}

impl Default for Seal {
    fn default() -> Self {
        let (mut from, mut to) = (Router::new(0), Router::new(1));
        let mut hello = [0; HELLO_DATAGRAM_BYTES];
        from.sealing.ask(to.own, &mut hello).unwrap();
        to.greet(&mut hello);
        from.greet(&mut hello);
        to.greet(&mut hello);
        Self { from, to, sequence: 0, datagram: [0; DATAGRAM_BYTES] }
    }
}

impl Path for Seal {
    fn operate(&mut self) {
        let head = FrameHead {
            kind: FrameKind::Packages,
            system: 1,
            from: 0,
            to: 1,
            digest: 7,
            incarnation: 100,
            sequence: self.sequence,
        };
        self.from.sealing.seal(&head, &mut self.datagram).unwrap();
        self.sequence += 1;
    }
}

/// Opens a datagram.
#[derive(Default)]
pub(super) struct Open(Seal);

impl Path for Open {
    fn prepare(&mut self) {
        self.0.operate();
    }

    fn operate(&mut self) {
        let opened = self.0.to.opening.open(&mut self.0.datagram);
        assert!(matches!(opened, Ok(Opened::Frame(..))));
    }
}
