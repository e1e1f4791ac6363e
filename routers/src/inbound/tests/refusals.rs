//! Refused datagrams, and which node learns of it.

use super::super::refusing::write_refusal;
use super::*;
use crate::frame::{self, Frame, VERSION};
use crate::harness::address;
use crate::link::PeerLinkState;
use crate::report::RouterEvent;

/// A datagram of node 1 to node 0, made with other settings.
fn datagram(change: impl FnOnce(&mut Settings)) -> Vec<u8> {
    let mut arm = End::new(1, change);
    let head = head(module(50, 0), module(200, arm.settings.own), 90);
    arm.outbound.tell_all(START);
    let direct = arm.send(START, head, b"body", true);
    direct.map_or_else(|| unreachable!("there is a route"), |(_, datagram)| datagram)
}

#[test]
fn another_configuration_is_refused_and_told() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |settings| settings.digest = 8));
    let foreign = datagram(|settings| settings.digest = 8);
    let theirs = Mismatch { reason: RefusalReason::Digest, version: VERSION, digest: Some(8) };
    let ours = Mismatch { reason: RefusalReason::Digest, version: VERSION, digest: Some(7) };
    let mut refusals = 0;
    for step in 0..25 {
        let now_ns = START + step * 100 * MS;
        base.take(now_ns, 1, &foreign);
        for (to, refusal) in base.refusals(now_ns) {
            assert_eq!(to, address(1));
            arm.take(now_ns, 0, &refusal);
            refusals += 1;
        }
    }
    let now_ns = START + 2400 * MS;
    assert_eq!(refusals, 3, "one a second");
    let refused = RouterEvent::Refused { source: address(1), peer: Some(1), mismatch: theirs };
    assert_eq!(
        base.log.events,
        [refused, RouterEvent::Silent { peer: 2 }],
        "told once; of the other node nothing is heard"
    );
    assert_eq!(arm.log.events, [RouterEvent::Refuses { peer: 0, mismatch: ours }]);
    assert_eq!(base.stats.state(1, now_ns), PeerLinkState::Refused(theirs));
    assert_eq!(arm.stats.state(0, now_ns), PeerLinkState::Refused(ours));
    assert!(base.log.delivered.is_empty() && arm.refusals(now_ns).is_empty(), "a refusal is not refused");
    assert_eq!(base.stats.peer(1).received.refused.get(), 25);

    // Its configuration is fixed: it restarts.
    base.take(now_ns, 1, &datagram(|settings| settings.incarnation = 999));
    assert_eq!((base.stats.state(1, now_ns), base.log.delivered.len()), (PeerLinkState::Alive, 1));
    assert!(base.stats.state(1, now_ns + 10 * S) == PeerLinkState::Silent, "and a refusal holds for a while only");
}

#[test]
fn another_version_is_refused_and_told() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
    // A frame of version 9, of which only the beginning and the check are as ours.
    let mut foreign = datagram(|_| {});
    foreign[2] = 9;
    let (head, rest) = foreign.split_at(32);
    let check = crc32fast::hash(&[head, &rest[4..]].concat());
    foreign[32..36].copy_from_slice(&check.to_le_bytes());
    base.take(START, 1, &foreign);
    let mismatch = Mismatch { reason: RefusalReason::Version, version: 9, digest: None };
    assert_eq!(base.log.events, [RouterEvent::Refused { source: address(1), peer: Some(1), mismatch }]);
    let [(_, refusal)] = &base.refusals(START)[..] else { panic!() };
    arm.take(START, 0, refusal);
    let mismatch = Mismatch { reason: RefusalReason::Version, version: VERSION, digest: Some(7) };
    assert_eq!(arm.log.events, [RouterEvent::Refuses { peer: 0, mismatch }]);
}

#[test]
fn strangers_are_refused() {
    let stranger = std::net::Ipv4Addr::new(10, 9, 9, 9).into();
    for (source, change, peer, why) in [
        (stranger, (|_| {}) as fn(&mut Settings), None, "an address that nobody has"),
        (address(2), |_| {}, Some(2), "another node's address"),
        (address(1), |settings| settings.system = 2, Some(1), "another system"),
        (address(1), |settings| settings.own = 0, Some(1), "says that it is we"),
        (address(1), |settings| settings.own = 77, Some(1), "a node that there is not"),
    ] {
        let mut base = End::new(0, |_| {});
        let mut settings = crate::harness::settings(1, 3);
        change(&mut settings);
        let frame = crate::frame::FrameHead {
            kind: frame::FrameKind::Alive,
            system: settings.system,
            from: settings.own,
            to: 0,
            digest: 7,
            incarnation: 5,
            sequence: 0,
        };
        let datagram = [&frame.to_bytes(&[&[0; 24]])[..], &[0; 24]].concat();
        assert!(Frame::parse(&datagram).is_ok());
        base.take_from(START, source, &datagram);
        let mismatch = Mismatch { reason: RefusalReason::Stranger, version: VERSION, digest: Some(7) };
        assert_eq!(base.log.events, [RouterEvent::Refused { source, peer, mismatch }], "{why}");
        let refusals = base.refusals(START);
        assert_eq!(refusals.iter().map(|(to, _)| *to).collect::<Vec<_>>(), [source], "{why}");
    }
}

#[test]
fn a_peer_that_does_not_know_our_address_takes_nothing_though_it_is_heard() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
    base.meet(START, &mut arm);
    let own = arm.send(START, head(module(50, 0), module(200, 1), 90), b"", true).unwrap().1;
    arm.take_from(START, address(2), &base.send(START, head(module(50, 1), module(200, 0), 90), b"", true).unwrap().1);
    let [(_, refusal)] = &arm.refusals(START)[..] else { panic!() };
    let now_ns = START + S;
    base.take(now_ns, 1, refusal);
    base.take(now_ns, 1, &own);
    assert!(matches!(base.stats.state(1, now_ns), PeerLinkState::Refused(_)), "what it sends says nothing of that");
}

#[test]
fn refusals_of_a_peer_that_hears_us_part_nobody() {
    for reason in [RefusalReason::Version, RefusalReason::Digest, RefusalReason::Stranger] {
        let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, |_| {}));
        let state = |base: &End, now_ns| base.stats.state(1, now_ns);
        base.meet(START, &mut arm);
        arm.meet(START, &mut base);
        base.meet(START, &mut arm);
        base.log.events.clear();
        let mut forged = [0; 100];
        let bytes = write_refusal(&arm.settings, Some(0), reason, &mut forged);
        let take = |base: &mut End, ms: u64| base.take(START + ms * MS, 1, &forged[..bytes]);
        for ms in [0, 1, 999] {
            take(&mut base, ms);
            assert_eq!(
                state(&base, START + ms * MS),
                PeerLinkState::Alive,
                "{reason:?} after {ms} ms, from a peer that hears us"
            );
        }
        assert_eq!((base.stats.peer(1).received.old.get(), &base.log.events[..]), (3, &[][..]));
        take(&mut base, 1000);
        assert!(
            matches!(state(&base, START + S), PeerLinkState::Refused(_)),
            "{reason:?}: it says no more that it hears us"
        );
        let mut unheard = End::new(0, |_| {});
        take(&mut unheard, 0);
        assert!(matches!(state(&unheard, START), PeerLinkState::Refused(_)), "{reason:?}: nothing speaks against it");
    }
}

#[test]
fn damaged_and_foreign_datagrams_change_nothing() {
    let mut base = End::new(0, |_| {});
    let good = datagram(|_| {});
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        base.take(START, 1, &bad);
    }
    base.take_from(START, std::net::Ipv4Addr::LOCALHOST.into(), &good[..40]);
    base.take(START, 1, b"GET / HTTP/1.1");
    assert!(base.log.delivered.is_empty() && base.log.events.is_empty() && base.refusals(START).is_empty());
    // Two bytes mark it as ours.
    assert_eq!(base.stats.peer(1).received.damaged.get(), good.len() as u64 - 2);
    assert_eq!(base.stats.foreign.get(), 4);
    base.take(START, 1, &good);
    assert_eq!(base.log.delivered.len(), 1);
}
