//! Which node may send from which names, and which sender may command which receiver.

use crate::admission::{Admission, PACKET, v4};
use crate::counts::Cause;
use crate::frame::{Fragment, FrameHead, FrameKind};
use crate::harness::{End, START, address, head, module};
use crate::inbound::Envelope;
use crate::link::PeerLinkState;
use rohrpost_config::{Access, AccessRule, ClassSet, Commanded};
use rohrpost_mailbox::{Class, Head, Name, Priority, Type, local};
use rohrpost_network::{Security, Tunnel};
use std::net::Ipv4Addr;

/// A datagram of node 1 with one package: its head, and what follows.
fn datagram(sequence: u64, package: &Head) -> (FrameHead, Vec<u8>) {
    let head =
        FrameHead { kind: FrameKind::Packages, system: 1, from: 1, to: 0, digest: 7, incarnation: 101, sequence };
    (head, package.to_bytes().to_vec())
}

/// Results for packages from node 1, each in a datagram that was sealed.
fn causes(end: &mut End, packages: &[Head]) -> Vec<Option<Cause>> {
    let mut all = Vec::new();
    for (sequence, package) in (0..).zip(packages) {
        let before = end.log.lost.len();
        let (head, text) = datagram(sequence, package);
        let came = Envelope { source: address(1), arrived_ns: START, bytes: 68 };
        end.inbound.handle_opened(START, &came, (&head, &text, 0), &mut end.log);
        all.push(end.log.lost.get(before).map(|(.., cause)| *cause));
    }
    end.assert_balanced();
    all
}

#[test]
fn a_node_speaks_for_its_own_names_alone() {
    let mut end = End::new(0, |settings| settings.network.security = Security::Keys);
    let of = |from: Name| head(module(200, 0), from, 60);
    let foreign = Some(Cause::ForeignName);
    let names = [module(60, 1), module(60, 2), module(60, 0), Name::new(9, 60, 1, 0), Name::NONE, module(60, 1)];
    assert_eq!(causes(&mut end, &names.map(of)), [None, foreign, foreign, foreign, foreign, None]);
    assert_eq!(end.log.delivered.len(), 2);
}

#[test]
fn only_classes_that_are_listed_may_command_from_another_node() {
    let callers = ClassSet::from_iter([Class(60)]);
    let rule = AccessRule { commanded: Commanded::Class(Class(200)), callers, line: 7 };
    let mut end = End::new(0, |settings| {
        settings.network.security = Security::Keys;
        settings.admission.access = Access::new(vec![rule]);
    });
    let command = |to, from| Head { kind: Type::command(16), ..head(module(to, 0), module(from, 1), 60) };
    let data = head(module(200, 0).with_local(local::DATA), module(61, 1), 60);
    let packages = [command(200, 60), command(200, 61), command(199, 61), data];
    assert_eq!(causes(&mut end, &packages), [None, Some(Cause::NotAllowed), None, None]);
}

/// End of node 0, with a tunnel: routers are of class 250.
fn guarded() -> End {
    End::new(0, |settings| {
        let tunnel = Tunnel { network: Ipv4Addr::new(10, 78, 0, 0), prefix: 24 };
        settings.network.security = Security::Keys;
        settings.admission = Admission { router: Some(Class(250)), tunnel: Some((tunnel, 0)), ..Admission::default() };
    })
}

#[test]
fn a_routers_own_mailboxes_take_nothing_but_packets_of_the_tunnel() {
    let mut end = guarded();
    let router = |node, local| module(250, node).with_local(local);
    let packet = Head { kind: PACKET, ..head(router(0, 4), router(1, 4), 0) };
    let (own, bad) = (Some(Cause::RoutersOwn), Some(Cause::BadPacket));
    let packages = [
        head(router(0, 3), module(60, 1), 60),
        head(router(0, 4), module(60, 1), 60),
        head(module(60, 0), router(1, 3), 60),
        packet,
        Head { kind: Type::command(4), ..head(router(0, 0), module(60, 1), 60) },
    ];
    assert_eq!(causes(&mut end, &packages), [own, own, own, bad, None]);
    let (addresses, mut end) = ([2, 1].map(|last| Ipv4Addr::new(10, 78, 0, last)), guarded());
    let body = v4(addresses[0], addresses[1], b"ping");
    let (head, mut text) = datagram(0, &Head { len: body.len() as u16, ..packet });
    text.extend_from_slice(&body);
    let came = Envelope { source: address(1), arrived_ns: START, bytes: 68 };
    end.inbound.handle_opened(START, &came, (&head, &text, 0), &mut end.log);
    assert_eq!((end.log.delivered.len(), end.log.causes()), (1, vec![]));
    end.assert_balanced();
}

#[test]
fn no_package_of_another_node_hurries_more_than_it_may() {
    let mut end = End::new(0, |_| {});
    let of = |kind, from, to| Head { kind, ..head(module(to, 0).with_local(local::DATA), module(from, 1), 255) };
    let (command, reply, data) = (Type::command(16), Type::reply(16), Type::data(1));
    let packages = [
        of(command, 60, 200),
        of(reply, 200, 60),
        of(reply, 60, 200),
        of(data, 60, 200),
        of(data, 200, 60),
        of(data, 9, 8),
    ];
    assert_eq!(causes(&mut end, &packages), [None; 6]);
    let delivered: Vec<u8> = end.log.delivered.iter().map(|(_, head, _)| head.priority.0).collect();
    assert_eq!(delivered, [60, 60, 200, 200, 200, 9]);
    assert_eq!(end.stats.inn.class(Priority(255)).packages.get(), 0, "and it is counted as what it is");
}

#[test]
fn nor_does_one_that_comes_in_parts() {
    let mut end = End::new(0, |_| {});
    let package = Head { len: 4, ..head(module(90, 0).with_local(local::DATA), module(60, 1), 255) };
    for (index, bytes) in [(0, b"ab"), (1, b"cd")] {
        let part = Fragment { first: 0, index, count: 2, offset: 2 * u32::from(index), head: package, bytes };
        let head = FrameHead { kind: FrameKind::Fragment, sequence: index.into(), ..datagram(0, &package).0 };
        let text = [&part.head_bytes()[..], bytes].concat();
        let came = Envelope { source: address(1), arrived_ns: START, bytes: 68 };
        end.inbound.handle_opened(START, &came, (&head, &text, 0), &mut end.log);
        end.assert_balanced();
    }
    let delivered: Vec<u8> = end.log.delivered.iter().map(|(_, head, _)| head.priority.0).collect();
    assert_eq!(delivered, [90]);
}

#[test]
fn what_a_peer_said_before_it_had_our_configuration_does_not_part_us() {
    let mut end = End::new(0, |settings| settings.network.security = Security::Keys);
    let old = FrameHead { digest: 8, ..datagram(0, &head(module(200, 0), module(60, 1), 60)).0 };
    assert!(!end.inbound.may_handshake(START, address(1), &old, &mut end.log));
    assert!(matches!(end.stats.state(1, START), PeerLinkState::Refused(_)), "nothing else is known of it");
    assert_eq!(causes(&mut end, &[head(module(200, 0), module(60, 1), 60)]), [None]);
    assert_eq!(end.stats.state(1, START), PeerLinkState::Alive);
    assert!(!end.inbound.may_handshake(START, address(1), &old, &mut end.log));
    assert_eq!(end.stats.state(1, START), PeerLinkState::Alive);
    assert!(end.refusals(START).is_empty(), "and nobody is told without a seal");
}
