//! A package from system to system without a server takes nothing from the heap, and gives nothing back to it: sent or
//! received, sealed or not, for one system or for all, new, repeated or forged, and by the TCP router as well.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_mailbox::{ALL_SYSTEMS, Head, Name, Priority, Type, local};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::frame::write_check;
use rohrpost_routers::report::NotDelivered;
use rohrpost_routers::security::{InstallationKey, KeyId, KeyRing};
use rohrpost_routers::session::{Cause, EndHost};
use rohrpost_routers::team::{TEAM_DATAGRAM_BYTES_MAX, TeamHost, TeamRefusal, TeamRouter, TeamSettings};
use std::net::{Ipv4Addr, SocketAddr};
use std::num::NonZeroU8;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

const MS: u64 = 1_000_000;
const SOURCE: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 21_121);
const BODY: [u8; 200] = [3; 200];

/// Takes all data, and counts them.
#[derive(Default)]
struct Node {
    delivered: u64,
}

impl EndHost for Node {
    fn answer(&mut self, _: &[u8], _: Cause, _: Option<&str>, _: &mut Vec<u8>) -> bool {
        false
    }
}

impl TeamHost for Node {
    fn deliver(&mut self, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        self.delivered += 1;
        Ok(())
    }

    fn hosts(&self, _: Name) -> bool {
        true
    }
}

fn router(system: u8, is_sealed: bool) -> TeamRouter {
    let key = || InstallationKey::new(KeyId(NonZeroU8::MIN), &[7; 32]);
    let settings = TeamSettings {
        system,
        node: 0,
        common: 7,
        incarnation: system.into(),
        seed: [system; 32],
        keys: is_sealed.then(|| KeyRing::new(key(), None)),
        reached: None,
        admission: Admission::default(),
    };
    TeamRouter::new(settings, true, 0)
}

/// Two systems that exchange datagrams; each in the room that its shell has.
struct Two {
    is_sealed: bool,
    routers: [TeamRouter; 2],
    node: Node,
    datagram: Vec<u8>,
    room: Vec<u8>,
}

impl Two {
    fn new(is_sealed: bool) -> Self {
        let room = || Vec::with_capacity(TEAM_DATAGRAM_BYTES_MAX + 1);
        let routers = [router(1, is_sealed), router(2, is_sealed)];
        Self { is_sealed, routers, node: Node::default(), datagram: room(), room: room() }
    }

    /// What is in `datagram` comes, as it was sent or with its last byte changed; sealed, that has a right check again.
    fn comes(&mut self, now_ns: u64, at: usize, is_forged: bool) {
        self.room.clone_from(&self.datagram);
        *self.room.last_mut().unwrap() ^= u8::from(is_forged);
        if is_forged && self.is_sealed {
            write_check(&mut self.room);
        }
        self.routers[at].handle(now_ns, SOURCE, &mut self.room, &mut self.node);
    }

    fn beats(&mut self, now_ns: u64) {
        for at in [0, 1] {
            if self.routers[at].poll(now_ns, &mut self.datagram).is_ok() {
                self.comes(now_ns, 1 - at, false);
            }
        }
    }

    /// The first sends a package, which also comes by the TCP router.
    fn package(&mut self, now_ns: u64, to: u8, id: u16) {
        let from = Name::new(1, 96, 0, local::REPLIES);
        let to = Name::new(to, 96, 0, local::DATA);
        let head = Head { to, from, len: 200, kind: Type::data(1), id, priority: Priority(96), ..Head::default() };
        let sent = self.routers[0].send(&head, &BODY, &mut self.datagram);
        self.routers[0].left(&head, sent);
        self.comes(now_ns, 1, true);
        self.comes(now_ns, 1, false);
        self.comes(now_ns, 1, false);
        self.routers[1].by_tcp(now_ns, &head, &BODY, &mut self.node);
    }
}

#[test]
fn a_package_between_systems_takes_nothing_from_the_heap() {
    for is_sealed in [false, true] {
        let mut two = Two::new(is_sealed);
        // They meet, and prove that they live.
        (0..40).for_each(|step| two.beats(step * 100 * MS));
        let (before, packages) = (heap_uses(), 10_000);
        assert!(before > 0, "counts");
        for id in 0..packages {
            let now_ns = (4000 + u64::from(id)) * MS;
            two.package(now_ns, if id % 2 == 0 { 2 } else { ALL_SYSTEMS }, id);
            two.beats(now_ns);
        }
        assert_eq!(heap_uses(), before, "sealed: {is_sealed}");
        let counts = two.routers[1].counts();
        let refused = |why| counts.refused(why);
        let packages = u64::from(packages);
        let forged = if is_sealed { TeamRefusal::Unsealed } else { TeamRefusal::Damaged };
        assert_eq!((two.node.delivered, counts.copies.get()), (packages, packages), "once each");
        assert_eq!((refused(TeamRefusal::Duplicate), refused(forged)), (packages, packages), "sealed: {is_sealed}");
    }
}
