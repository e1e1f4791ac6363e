//! The ports of a router: each takes what is for it alone.

use super::*;
use crate::frame::{Alive, FrameHead, FrameKind};
use crate::harness::address;
use crate::inbound::peer::LEAP_KEPT_NS;
use crate::link::{PeerLinkState, SILENT_AFTER_NS};
use crate::outbound::Outbound;
use crate::port::Port;

/// Ports that packages or parts of replicas go to.
const PORTS: [Port; 3] = [Port::Packages, Port::Rest, Port::Replicas];

/// "Still there" from node 1 to node 0, at a port.
pub(super) fn alive(port: Port, incarnation: u64, sequence: u64) -> Vec<u8> {
    let said = Alive { heard_incarnation: 100, ..Alive::default() }.to_bytes();
    let sequence = port.first_sequence() + sequence;
    let head = FrameHead { kind: FrameKind::Alive, system: 1, from: 1, to: 0, digest: 7, incarnation, sequence };
    [&head.to_bytes(&[&said])[..], &said].concat()
}

/// Counters of a port of a router that hears nobody yet.
fn stats_of(port: Port, settings: &Settings) -> Arc<Stats> {
    let all = Stats::new(settings, START);
    if port == Port::Packages { all } else { Stats::of_port(port, settings, &all) }
}

/// What the router of node 1 sends to the port of node 0, the first `count` datagrams.
fn sent(port: Port, count: usize) -> Vec<Vec<u8>> {
    let mut arm = End::new(1, |_| {});
    arm.outbound = Outbound::new(&arm.settings, stats_of(port, &arm.settings));
    let mut all = Vec::new();
    while all.len() < count {
        arm.outbound.tell_all(START);
        all.extend(arm.leave(START).into_iter().filter(|(to, _)| *to == 0).map(|(_, datagram)| datagram));
    }
    all
}

/// Two of them: one alone would be doubted in any case.
#[test]
fn what_is_for_another_port_changes_nothing_of_its_sender() {
    let far = 3 * WINDOW as usize;
    for (port, other) in PORTS.into_iter().flat_map(|port| PORTS.map(|other| (port, other))) {
        if port == other {
            continue;
        }
        let mut base = End::new(0, |_| {});
        base.stats = stats_of(port, &base.settings);
        base.inbound = Inbound::new(&base.settings, base.stats.clone());
        let (own, strays) = (sent(port, 40), sent(other, far));
        own[..20].iter().for_each(|datagram| base.take(START, 1, datagram));
        let stats = base.stats.clone();
        let seen = || {
            let (received, link) = (&stats.peer(1).received, &stats.peer(1).link);
            (received.datagrams.get(), received.missing(), received.old.get(), link.next.get(), link.heard_ns.get())
        };
        let before = seen();
        strays[far - 2..].iter().for_each(|datagram| base.take(START + MS, 1, datagram));
        assert_eq!((seen(), stats.foreign.get()), (before, 2), "what is for {other:?} comes to {port:?}");
        own[20..].iter().for_each(|datagram| base.take(START + 2 * MS, 1, datagram));
        assert_eq!(seen().0, before.0 + 20, "{port:?} goes on after what was for {other:?}");
    }
}

/// A router is told apart by the port of packages; of what another port hears first, nothing is known there.
#[test]
fn the_first_datagram_that_is_heard_may_be_for_another_port() {
    let mut base = End::new(0, |_| {});
    base.take(START, 1, &alive(Port::Replicas, 9, 5000));
    assert_eq!((base.stats.peer(1).link.incarnation.get(), base.stats.foreign.get()), (0, 1));
    assert_eq!(base.stats.state(1, START), PeerLinkState::Unknown);
}

/// Where nothing is sealed anybody can forge two datagrams; what they part is together again when they end.
#[test]
fn forged_datagrams_that_are_far_ahead_part_a_peer_for_a_second() {
    for leaps in 1..4 {
        let mut base = End::new(0, |_| {});
        let own = sent(Port::Packages, 60);
        own[..20].iter().for_each(|datagram| base.take(START, 1, datagram));
        let incarnation = base.stats.peer(1).link.incarnation.get();
        for leap in 1..=leaps {
            let first = leap * (1 << 40);
            (first..first + 3).for_each(|at| base.take(START, 1, &alive(Port::Packages, incarnation, at)));
        }
        let stats = base.stats.clone();
        let taken = || stats.peer(1).received.datagrams.get();
        let before = taken();
        own[20..30].iter().for_each(|datagram| base.take(START + SILENT_AFTER_NS - 1, 1, datagram));
        assert_eq!(taken(), before, "they stand for the peer");
        own[30..].iter().for_each(|datagram| base.take(START + SILENT_AFTER_NS, 1, datagram));
        assert_eq!(taken(), before + 29, "it is heard again, after one that is doubted");
        own.iter().for_each(|datagram| base.take(START + SILENT_AFTER_NS, 1, datagram));
        assert_eq!(taken(), before + 29, "and nothing twice");
    }
}

/// What a peer passed over when it went far ahead is not taken again for ever, however silent it is.
#[test]
fn a_leap_that_nothing_contradicts_is_true_for_good() {
    for (is_contradicted, taken_again) in [(false, 0), (true, 29)] {
        let mut base = End::new(0, |_| {});
        let own = sent(Port::Packages, 60);
        own[..20].iter().for_each(|datagram| base.take(START, 1, datagram));
        let incarnation = base.stats.peer(1).link.incarnation.get();
        let mut now_ns = START;
        let (step_ns, steps) = (SILENT_AFTER_NS / 2, 3 * LEAP_KEPT_NS / SILENT_AFTER_NS);
        for at in 0..steps {
            now_ns += step_ns;
            base.take(now_ns, 1, &alive(Port::Packages, incarnation, (1 << 40) + at));
            if is_contradicted {
                base.take(now_ns, 1, &own[20 + at as usize % 10]);
            }
        }
        let stats = base.stats.clone();
        let taken = || stats.peer(1).received.datagrams.get();
        let before = taken();
        own[30..].iter().for_each(|datagram| base.take(now_ns + SILENT_AFTER_NS, 1, datagram));
        assert_eq!(taken(), before + taken_again, "contradicted: {is_contradicted}");
    }
}

/// Two routers claim one node: the one that is heard at the real-time port is heard at the other, too.
#[test]
fn the_real_time_port_decides_which_incarnation_lives() {
    let mut end = End::new(0, |_| {});
    let rest = Stats::of_port(Port::Rest, &end.settings, &end.stats);
    let mut inbound = Inbound::new(&end.settings, rest.clone());
    let mut hear = |end: &mut End, incarnation, sequence| {
        let before = rest.peer(1).received.datagrams.get();
        let bytes = alive(Port::Rest, incarnation, sequence);
        inbound.handle(START, &Datagram { source: address(1), arrived_ns: START, bytes: &bytes }, &mut end.log);
        rest.peer(1).received.datagrams.get() > before
    };
    assert!(hear(&mut end, 5, 0), "nobody is known yet");
    end.stats.peer(1).link.incarnation.set(6);
    assert!(!hear(&mut end, 5, 1), "another was heard there");
    assert!(hear(&mut end, 6, 0));
    assert_eq!(rest.peer(1).received.old.get(), 1);
}
