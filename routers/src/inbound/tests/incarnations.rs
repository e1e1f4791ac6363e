//! Peers that begin, fall silent, restart, or do not hear us.

use super::*;
use crate::counts::Cause;
use crate::harness::address;
use crate::link::PeerLinkState;
use crate::report::RouterEvent;

fn data(from: NodeIndex, to: NodeIndex) -> Head {
    head(module(50, to), module(200, from), 90)
}

use crate::frame::NodeIndex;
use crate::port::Port;

#[test]
fn a_peer_without_a_datagram_for_a_second_is_silent() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
    let states = |end: &End, now_ns| end.stats.state(1, now_ns);
    assert_eq!(states(&base, START + S - 1), PeerLinkState::Unknown);
    assert_eq!(states(&base, START + S), PeerLinkState::Silent);
    base.meet(START + 2 * S, &mut arm);
    assert_eq!(states(&base, START + 2 * S), PeerLinkState::Alive);
    let mut told = Vec::new();
    for ms in (2000..4000).step_by(10) {
        let now_ns = START + ms * MS;
        base.refusals(now_ns);
        told.extend(base.log.events.drain(..).map(|event| (ms, event)));
        assert_eq!(states(&base, now_ns) == PeerLinkState::Silent, ms >= 3000, "at {ms} ms");
    }
    let (heard, silent) = (RouterEvent::Heard { peer: 1 }, |peer| RouterEvent::Silent { peer });
    assert_eq!(told, [(2000, heard), (2000, silent(2)), (3000, silent(1))]);
    base.meet(START + 4 * S, &mut arm);
    assert_eq!(base.log.events, [RouterEvent::Heard { peer: 1 }]);
}

#[test]
fn a_stalled_router_waits_for_its_peers_anew() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
    base.meet(START, &mut arm);
    base.refusals(START);
    base.log.events.clear();
    base.refusals(START + 5 * S);
    assert_eq!(base.log.events, [RouterEvent::Silent { peer: 2 }], "which was never heard");
    assert_eq!(base.stats.state(1, START + 5 * S), PeerLinkState::Alive);
    (1..=10).for_each(|step| drop(base.refusals(START + 5 * S + step * 100 * MS)));
    assert_eq!(base.stats.state(1, START + 6 * S), PeerLinkState::Silent);
}

#[test]
fn a_restarted_peer_is_known_by_its_incarnation() {
    let mut base = End::new(0, |_| {});
    let lives = |incarnation| End::new(1, |settings| settings.incarnation = incarnation);
    let (mut first, mut second) = (lives(11), lives(12));
    let old: Vec<_> = (0..3).map(|_| first.send(START, data(1, 0), b"", true).unwrap().1).collect();
    base.take(START, 1, &old[0]);
    let new: Vec<_> = (0..2).map(|_| second.send(START, data(1, 0), b"", true).unwrap().1).collect();
    base.take(START, 1, &new[0]);
    assert_eq!(base.log.events, [RouterEvent::Heard { peer: 1 }], "one datagram alone is doubted");
    base.take(START, 1, &new[1]);
    assert_eq!(base.log.events, [RouterEvent::Heard { peer: 1 }, RouterEvent::Restarted { peer: 1 }]);
    base.take(START + MS, 1, &old[1]);
    base.take(START + MS, 1, &new[1]);
    assert_eq!(base.log.ids(), [0, 1], "nothing of the old incarnation, nothing twice");
    let received = &base.stats.peer(1).received;
    assert_eq!((received.restarts.get(), received.old.get(), received.duplicates.get()), (1, 2, 1));
    assert_eq!(received.lost.get(), 1, "the first incarnation's first, which only said that it is there");

    // A second router with the same node number is noticed, and kept out.
    for step in 0..30 {
        let now_ns = START + step * 100 * MS;
        second.hears(0, now_ns);
        let (_, new) = second.send(now_ns, data(1, 0), b"", true).unwrap();
        base.take(now_ns, 1, &new);
    }
    base.take(START + 29 * 100 * MS, 1, &old[2]);
    base.take(START + 29 * 100 * MS, 1, &old[2]);
    assert_eq!(base.log.events[2..], [RouterEvent::Twice { peer: 1 }]);
    assert_eq!(base.log.delivered.len(), 2 + 30);
    base.assert_balanced();
}

#[test]
fn a_life_that_was_taken_for_over_comes_back() {
    let mut base = End::new(0, |_| {});
    let lives = |incarnation| End::new(1, |settings| settings.incarnation = incarnation);
    let (mut dead, mut living) = (lives(11), lives(12));
    let late: Vec<_> = (0..2).map(|_| dead.send(START, data(1, 0), b"", true).unwrap().1).collect();
    let all: Vec<_> = (0..4).map(|_| living.send(START, data(1, 0), b"", true).unwrap().1).collect();
    // We have just begun, and datagrams of the dead one come after one of the living.
    base.take(START, 1, &all[1]);
    late.iter().for_each(|late| base.take(START, 1, late));
    base.take(START + S - 1, 1, &all[2]);
    assert_eq!(base.log.ids(), [1, 1]);
    base.take(START + S, 1, &all[3]);
    base.take(START + S, 1, &all[0]);
    base.take(START + S, 1, &all[1]);
    assert_eq!(base.log.ids(), [1, 1, 3], "and nothing that may have been delivered");
    base.assert_balanced();
}

#[test]
fn what_a_life_that_is_over_sent_before_does_not_bring_it_back() {
    let mut base = End::new(0, |_| {});
    let lives = |incarnation| End::new(1, |settings| settings.incarnation = incarnation);
    let (mut first, mut second) = (lives(11), lives(12));
    let old: Vec<_> = (0..5).map(|_| first.send(START, data(1, 0), b"", true).unwrap().1).collect();
    let new: Vec<_> = (0..3).map(|_| second.send(START, data(1, 0), b"", true).unwrap().1).collect();
    old[1..4].iter().for_each(|datagram| base.take(START, 1, datagram));
    new[..2].iter().for_each(|datagram| base.take(START, 1, datagram));
    let before = base.log.delivered.len();
    // The second incarnation is silent, and the wire or an attacker replays what the first one sent.
    let now_ns = START + 3 * S;
    old[..4].iter().for_each(|datagram| base.take(now_ns, 1, datagram));
    let stats = base.stats.clone();
    let received = &stats.peer(1).received;
    assert_eq!(
        (base.log.delivered.len(), received.old.get(), received.restarts.get()),
        (before, 5, 1),
        "nothing twice"
    );
    assert!(!base.log.events.contains(&RouterEvent::Twice { peer: 1 }), "that router may have ended");
    base.take(now_ns, 1, &new[2]);
    assert_eq!((base.log.delivered.len(), received.restarts.get()), (before + 1, 1), "the second incarnation goes on");
    base.take(now_ns + S, 1, &old[4]);
    assert_eq!((base.log.delivered.len(), received.restarts.get()), (before + 2, 2), "what goes on is no copy");
    new.iter().for_each(|datagram| base.take(now_ns + 2 * S, 1, datagram));
    assert_eq!(
        (base.log.delivered.len(), received.restarts.get()),
        (before + 2, 2),
        "nothing twice of the second either"
    );
    base.assert_balanced();
}

#[test]
fn a_one_way_link_is_noticed() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
    base.meet(START, &mut arm);
    let (mut unheard_ns, mut alive) = (None, Vec::new());
    for step in 0..400 {
        // Nothing of ours arrives any more.
        let now_ns = START + step * 10 * MS;
        for (_, datagram) in arm.leave(now_ns).into_iter().filter(|(to, _)| *to == 0) {
            base.take(now_ns, 1, &datagram);
            alive.push(now_ns);
        }
        base.refusals(now_ns);
        if base.stats.state(1, now_ns) == PeerLinkState::Unheard {
            unheard_ns.get_or_insert(now_ns - START);
        }
    }
    let told_ns = alive.iter().find(|at| **at >= START + S).unwrap() - START;
    assert!((S..S + 200 * MS).contains(&told_ns));
    assert_eq!(unheard_ns, Some(told_ns + S), "a second after the first denial");
    assert_eq!(base.log.events.iter().filter(|event| **event == RouterEvent::Unheard { peer: 1 }).count(), 1);
    base.meet(START + 4 * S, &mut arm);
    assert_eq!(base.stats.state(1, START + 4 * S), PeerLinkState::Alive);
}

#[test]
fn a_peer_that_is_heard_again_has_a_second_to_hear_us() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
    base.meet(START, &mut arm);
    (0..40).for_each(|step| drop(base.refusals(START + step * 100 * MS)));
    assert_eq!(base.stats.state(1, START + 4 * S), PeerLinkState::Silent);
    // Both directions were cut, and only this one is whole again.
    let mut denied_ns = None;
    for step in 0..=130 {
        let now_ns = START + 4 * S + step * 10 * MS;
        for (_, datagram) in arm.leave(now_ns).into_iter().filter(|(to, _)| *to == 0) {
            base.take(now_ns, 1, &datagram);
            denied_ns.get_or_insert(now_ns);
        }
        base.refusals(now_ns);
        let Some(denied_ns) = denied_ns else { continue };
        let expected = if now_ns < denied_ns + S { PeerLinkState::Alive } else { PeerLinkState::Unheard };
        assert_eq!(base.stats.state(1, now_ns), expected, "{} ns after it is heard again", now_ns - denied_ns);
    }
    assert!(denied_ns.is_some_and(|denied_ns| denied_ns < START + 4 * S + 200 * MS));
}

#[test]
fn what_waited_in_the_socket_is_not_delivered() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
    for (waited_ns, delivered) in [(SOCKET_MAX_NS, 1), (SOCKET_MAX_NS + 1, 1)] {
        let (_, bytes) = arm.send(START, data(1, 0), b"old", true).unwrap();
        let datagram = Datagram { source: address(1), arrived_ns: START, bytes: &bytes };
        base.inbound.handle(START + waited_ns, &datagram, &mut base.log);
        assert_eq!(base.log.delivered.len(), delivered);
    }
    assert_eq!(base.log.causes(), [Cause::Stale]);
    base.assert_balanced();
}

/// What a router of node 1 could have sent to node 0.
fn forged(incarnation: u64, sequence: u64) -> Vec<u8> {
    super::ports::alive(Port::Packages, incarnation, sequence)
}

/// It sends as fast as it is asked to.
pub(super) fn quick(settings: &mut Settings) {
    settings.network.rate_bytes_s = 1 << 40;
}

const LAST: u64 = (1 << 48) - 1;

#[test]
fn one_datagram_that_is_far_ahead_changes_nothing() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, quick));
    let mut send = || arm.send(START, data(1, 0), b"", true).unwrap().1;
    (0..3).for_each(|_| base.take(START, 1, &send()));
    // A duplicate says nothing more; nor does another one that is far from it.
    [LAST, LAST, LAST / 2, 5000].iter().for_each(|sequence| base.take(START, 1, &forged(101, *sequence)));
    base.take(START, 1, &send());
    assert_eq!(base.log.delivered.len(), 4);
    let stats = base.stats.clone();
    let received = &stats.peer(1).received;
    assert_eq!((received.missing(), received.old.get(), received.duplicates.get()), (0, 4, 0));
    // A peer that did not reach us for long is far ahead, and says so again.
    (0..2 * WINDOW).for_each(|_| drop(send()));
    (0..2).for_each(|_| base.take(START, 1, &send()));
    assert_eq!((base.log.delivered.len(), received.old.get()), (5, 5));
    base.assert_balanced();
}

#[test]
fn lives_that_one_datagram_each_tells_of_change_nothing() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, quick));
    let mut send = || arm.send(START, data(1, 0), b"", true).unwrap().1;
    base.take(START, 1, &send());
    for life in 0..1000 {
        let now_ns = START + life * MS;
        base.take(now_ns, 1, &forged(1000 + life, life % 7));
        base.take(now_ns, 1, &send());
    }
    assert_eq!(base.log.delivered.len(), 1001, "nobody is taken for over");
    assert_eq!(base.log.events, [RouterEvent::Heard { peer: 1 }]);
    // Where each says so twice, one line comes in five seconds.
    for life in 0..1000 {
        (0..2).for_each(|sequence| base.take(START + 2 * S + life * 10 * MS, 1, &forged(5000 + life, sequence)));
    }
    assert_eq!(base.log.events[1..], [RouterEvent::Restarted { peer: 1 }; 2]);
    assert_eq!(base.stats.peer(1).received.restarts.get(), 1000);
}

#[test]
fn the_first_datagram_that_is_heard_may_be_a_forged_one() {
    for incarnation in [101, 9] {
        let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
        base.take(START, 1, &forged(incarnation, LAST));
        for _ in 0..4 {
            base.take(START, 1, &arm.send(START, data(1, 0), b"", true).unwrap().1);
        }
        assert_eq!(base.log.ids(), [1, 2, 3], "of its incarnation or another: the second true one is believed");
        assert_eq!(base.stats.peer(1).received.old.get(), 1);
    }
}
