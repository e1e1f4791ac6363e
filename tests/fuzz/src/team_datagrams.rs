//! A router of a team that takes any datagrams, in an order and at times that the bytes say: what is delivered was sent
//! by another system for this one, what it remembers stays bounded, and where it seals nobody without the key is heard.

use crate::split::Bytes;
use rohrpost_config::TEAM_PEERS_MAX;
use rohrpost_mailbox::{Head, Name};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::frame::{HEAD_BYTES, write_check};
use rohrpost_routers::report::NotDelivered;
use rohrpost_routers::security::{InstallationKey, KeyId, KeyRing};
use rohrpost_routers::session::{Cause, EndHost};
use rohrpost_routers::team::{
    MEMBERS_MAX, TEAM_BODY_BYTES_MAX, TeamHead, TeamHost, TeamKind, TeamRouter, TeamSettings,
};
use std::collections::BTreeSet;
use std::net::{Ipv4Addr, SocketAddr};
use std::num::NonZeroU8;

const OWN: u8 = 1;
/// Datagrams of one program.
const STEPS_MAX: usize = 300;

struct Node {
    delivered: usize,
}

impl EndHost for Node {
    fn answer(&mut self, _: &[u8], _: Cause, _: Option<&str>, answer: &mut Vec<u8>) -> bool {
        answer.push(0);
        true
    }
}

impl TeamHost for Node {
    fn deliver(&mut self, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        assert!(head.to.system() == OWN && head.from.system() != OWN && head.from.is_mailbox());
        assert!(usize::from(head.len) == body.len() && body.len() <= TEAM_BODY_BYTES_MAX);
        self.delivered += 1;
        if body.is_empty() { Err(NotDelivered::NoMailbox) } else { Ok(()) }
    }

    fn hosts(&self, name: Name) -> bool {
        name.instance() == 0
    }
}

/// A router and its node.
fn router(is_sealed: bool) -> (TeamRouter, Node) {
    let keys = is_sealed.then(|| KeyRing::new(InstallationKey::new(KeyId(NonZeroU8::MIN), &[7; 32]), None));
    let (incarnation, reached, admission) = (3, None, Admission::default());
    let settings =
        TeamSettings { system: OWN, node: 0, common: 7, incarnation, seed: [9; 32], keys, reached, admission };
    (TeamRouter::new(settings, true, 0), Node { delivered: 0 })
}

pub(crate) fn run(data: &[u8]) {
    let mut bytes = Bytes(data);
    let is_sealed = bytes.byte() & 1 != 0;
    let (mut router, mut node) = router(is_sealed);
    let (mut now_ns, mut datagram) = (0, Vec::new());
    for _ in 0..STEPS_MAX {
        if bytes.is_empty() {
            break;
        }
        now_ns += u64::from(bytes.byte()) * 50_000_000;
        let kind = bytes.byte();
        let length = usize::from(bytes.byte());
        let text = bytes.take(length);
        let mut came = text.to_vec();
        if kind & 1 != 0 {
            came = with_head(kind, &mut bytes, text);
        }
        router.handle(now_ns, SocketAddr::new(Ipv4Addr::LOCALHOST.into(), 21_121), &mut came, &mut node);
        while let Some((reply, body)) = router.next_reply() {
            assert!(reply.from.system() == OWN && router.send(&reply, &body, &mut datagram).is_ok());
        }
        if router.poll(now_ns, &mut datagram).is_ok() {
            assert!(datagram.len() <= 1472 && TeamHead::read(&datagram).is_ok(), "a beat is one packet");
        }
        assert!(router.teammates().len() <= MEMBERS_MAX);
    }
    assert!(!is_sealed || node.delivered == 0 && router.teammates().is_empty(), "nobody here has the key");
}

/// A datagram with a sound head and check, so that what is behind them is read.
fn with_head(kind: u8, bytes: &mut Bytes<'_>, text: &[u8]) -> Vec<u8> {
    let kind = if kind & 2 == 0 { TeamKind::Package } else { TeamKind::Beat };
    let [system, node, to, common, incarnation, sequence] = [(); 6].map(|()| bytes.byte());
    let head = TeamHead {
        kind,
        system,
        node: node % 64,
        to: if to & 1 == 0 { OWN } else { u8::MAX },
        common: (common % 9).into(),
        incarnation: incarnation.into(),
        sequence: sequence.into(),
    };
    let mut datagram = vec![0; HEAD_BYTES];
    head.write(&mut datagram);
    datagram.extend(text);
    write_check(&mut datagram);
    datagram
}

/// A file of hosts, in both forms: what is read is of other systems, in order, and not too much; ids and addresses of a
/// team's hosts file are of one host each, and each mistake has a place.
pub(crate) fn run_hosts(data: &[u8]) {
    match rohrpost_config::roster(data, OWN) {
        Ok(hosts) => {
            let ids: BTreeSet<u8> = hosts.iter().map(|host| host.id).collect();
            let addresses: BTreeSet<SocketAddr> = hosts.iter().map(|host| host.address).collect();
            assert!(ids.contains(&OWN) && ids.len() == hosts.len() && addresses.len() == hosts.len());
        }
        Err(mistakes) => assert!(mistakes.iter().all(|it| it.line > 0 && it.column > 0) && !mistakes.is_empty()),
    }
    let Ok(text) = std::str::from_utf8(data) else { return };
    match rohrpost_config::hosts(text, OWN, 21_121) {
        Ok(peers) => {
            assert!(peers.len() <= TEAM_PEERS_MAX && peers.is_sorted());
            assert!(peers.iter().all(|peer| peer.system != OWN && (1..=254).contains(&peer.system)));
        }
        Err(problems) => assert!(problems.iter().all(|problem| problem.line.is_some()) && !problems.is_empty()),
    }
}
