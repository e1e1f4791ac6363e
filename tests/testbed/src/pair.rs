//! Two routers that know each other, without sockets: what hot paths are tried and counted on.

use crate::lan;
use rohrpost_mailbox::Name;
use rohrpost_network::{Network, Route};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::security::{
    HELLO_DATAGRAM_BYTES, Handshake, InstallationKey, KeyId, KeyRing, Opened, Opening, PeerSessions, Port,
    RouterIdentity, Sealing,
};
use rohrpost_routers::settings::Settings;
use std::net::{IpAddr, Ipv4Addr};
use std::num::NonZeroU8;
use std::sync::Arc;

/// Where a node's datagrams come from.
pub fn address(node: NodeIndex) -> IpAddr {
    Ipv4Addr::new(10, 0, 0, node + 1).into()
}

/// The module that a node has.
pub fn module(node: NodeIndex) -> Name {
    Name::new(1, 200, node, 0)
}

/// Of one of two nodes on a LAN, 0 or 1, with a module each.
pub fn settings(own: NodeIndex) -> Settings {
    let other = 1 - own;
    let lan = lan::settings(own, &[address(0), address(1)], None);
    Settings {
        incarnation: 9,
        network: Network { quota_bytes: 128 << 10, ..lan.network },
        routes: vec![Route { first: module(other), last: module(other).with_local(u8::MAX), node: other }],
        senders: vec![vec![module(own)]],
        hosts: Vec::new(),
        admission: Admission::default(),
        ..lan
    }
}

/// The seals of one of two routers that share a key.
pub struct SealedRouter {
    own: NodeIndex,
    /// Its sessions, and its counters of what it rejected.
    pub peer_sessions: Arc<PeerSessions>,
    handshake: Handshake,
    /// Seals packages.
    pub sealing: Sealing,
    /// Opens them.
    pub opening: Opening,
}

impl SealedRouter {
    /// Node 0 or 1.
    pub fn new(own: NodeIndex) -> Self {
        let router = RouterIdentity { system: 1, own, nodes: 2, digest: 7, incarnation: 100 + u64::from(own) };
        let keys = KeyRing::new(InstallationKey::new(KeyId(NonZeroU8::MIN), &[3; 32]), None);
        let peer_sessions = PeerSessions::new(router, keys);
        Self {
            own,
            handshake: Handshake::new(&peer_sessions, [own; 32]),
            sealing: Sealing::new(&peer_sessions, Port::Packages),
            opening: Opening::new(&peer_sessions, Port::Packages),
            peer_sessions,
        }
    }

    /// Both prove to each other that they live now.
    ///
    /// # Panics
    /// Panics if one does not take the other's hello.
    pub fn acquaint(&mut self, other: &mut Self, now_ns: u64) {
        let mut hello = [0; HELLO_DATAGRAM_BYTES];
        assert!(self.peer_sessions.ask(other.own, &mut hello).is_some(), "it can ask");
        let replied = [other.take(now_ns, &mut hello), self.take(now_ns, &mut hello), other.take(now_ns, &mut hello)];
        assert_eq!(replied, [true, true, false], "asked, answered, proved");
    }

    /// Takes a hello; the reply takes its place. Whether there is one.
    fn take(&mut self, now_ns: u64, hello: &mut [u8; HELLO_DATAGRAM_BYTES]) -> bool {
        let mut reply = [0; HELLO_DATAGRAM_BYTES];
        let Ok(Opened::Hello(head, asked)) = self.opening.open(hello) else { panic!("no hello") };
        let replied = self.handshake.receive(now_ns, &head, &asked, &mut reply).reply_bytes.is_some();
        self.handshake.begin();
        *hello = reply;
        replied
    }
}
