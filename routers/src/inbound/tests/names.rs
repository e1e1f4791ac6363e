//! Whose names come from whom, and who may command whom.

use crate::access::Access;
use crate::frame::{FrameHead, Kind};
use crate::harness::{End, START, address, head, module};
use crate::inbound::Came;
use crate::link::State;
use crate::stats::Cause;
use rohrpost_config::{self as config, Security};
use rohrpost_mailbox::{Class, Head, Name, Type};

/// A datagram of node 1 with one package: its head, and what follows.
fn datagram(sequence: u64, package: &Head) -> (FrameHead, Vec<u8>) {
    let head = FrameHead { kind: Kind::Packages, system: 1, from: 1, to: 0, digest: 7, incarnation: 101, sequence };
    (head, package.to_bytes().to_vec())
}

/// What became of packages that came from node 1, each in a datagram that was sealed.
fn causes(end: &mut End, packages: &[Head]) -> Vec<Option<Cause>> {
    let mut all = Vec::new();
    for (sequence, package) in (0..).zip(packages) {
        let before = end.log.lost.len();
        let (head, text) = datagram(sequence, package);
        let came = Came { source: address(1), arrived_ns: START, bytes: 68 };
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
    let rule = config::Access { class: Class(200), callers: vec![Class(60)], line: 7 };
    let mut end = End::new(0, |settings| {
        settings.network.security = Security::Keys;
        settings.access = Access::new(&[rule]);
    });
    let command = |to, from| Head { kind: Type::command(16), ..head(module(to, 0), module(from, 1), 60) };
    let data = head(module(200, 0), module(61, 1), 60);
    let packages = [command(200, 60), command(200, 61), command(199, 61), data];
    assert_eq!(causes(&mut end, &packages), [None, Some(Cause::NotAllowed), None, None]);
}

#[test]
fn what_a_peer_said_before_it_had_our_configuration_does_not_part_us() {
    let mut end = End::new(0, |settings| settings.network.security = Security::Keys);
    let old = FrameHead { digest: 8, ..datagram(0, &head(module(200, 0), module(60, 1), 60)).0 };
    assert!(!end.inbound.may_greet(START, address(1), &old, &mut end.log));
    assert!(matches!(end.stats.state(1, START), State::Refused(_)), "of whom nothing else is known");
    assert_eq!(causes(&mut end, &[head(module(200, 0), module(60, 1), 60)]), [None]);
    assert_eq!(end.stats.state(1, START), State::Alive);
    assert!(!end.inbound.may_greet(START, address(1), &old, &mut end.log));
    assert_eq!(end.stats.state(1, START), State::Alive);
    assert!(end.refusals(START).is_empty(), "and nobody is told without a seal");
}
