//! What a sending end lets go, when, and in which order; flows and time slots have files of their own.

use super::*;
use crate::counts::Cause;
use crate::frame::{Alive, Frame};
use crate::harness::{ENVELOPE, End, MS, S, START, head, module};
use crate::link::{ALIVE_EVERY_NS, TELL_EVERY_NS};
use crate::report::Mismatch;
use proptest::prelude::*;
use rohrpost_mailbox::Type;

mod flows;
mod slot;

/// The packages of a datagram, by their ids; a fragment stands for its package.
fn ids(datagram: &[u8]) -> Vec<u16> {
    match Frame::parse(datagram).unwrap().1 {
        Frame::Packages(packages) => packages.map(|(head, _)| head.id).collect(),
        Frame::Fragment(part) => vec![part.head.id],
        _ => Vec::new(),
    }
}

fn sent(end: &mut End, now_ns: u64) -> Vec<(NodeIndex, Vec<u16>)> {
    let all = end.leave(now_ns).into_iter().map(|(to, datagram)| (to, ids(&datagram)));
    all.filter(|(_, ids)| !ids.is_empty()).collect()
}

fn to(node: NodeIndex, priority: u8) -> Head {
    head(module(50, node), module(200, 0), priority)
}

#[test]
fn an_idle_network_takes_a_package_from_where_it_lies() {
    let mut end = End::new(0, |_| {});
    for (sequence, body) in [(1, &b"at once"[..]), (2, b"")] {
        let (peer, datagram) = end.send(START, to(1, 90), body, true).unwrap();
        let (frame, Frame::Packages(mut packages)) = Frame::parse(&datagram).unwrap() else { panic!() };
        assert_eq!(
            (peer, frame.from, frame.to, frame.sequence),
            (1, 0, 1, sequence),
            "the first said that we are here"
        );
        assert_eq!((frame.digest, frame.incarnation, frame.system), (7, 100, 1));
        let (head, there) = packages.next().unwrap();
        assert_eq!((head.to, head.priority.0, there), (module(50, 1), 90, body));
    }
    end.assert_balanced();
    assert_eq!(end.stats.peer(1).sent.packages.get(), 2);
    assert_eq!(end.send(START, to(1, 90), b"waits for company", false), None);
    assert_eq!(end.send(START, to(1, 90), b"not before the other", true), None);
    assert_eq!(end.stats.waiting_in_all(), 2);
    assert_eq!(sent(&mut end, START), [(1, vec![2, 3])]);
    assert_eq!((end.stats.waiting_in_all(), end.stats.waiting_bytes.get()), (0, 0));
}

#[test]
fn a_package_that_no_second_could_join_waits_for_no_company() {
    let mut end = End::new(0, |_| {});
    // Of datagrams of 1472 B.
    let half = (1472 - frame::HEAD_BYTES) / 2 - PACKAGE_HEAD_BYTES;
    assert!(end.send(START, to(1, 90), &vec![0; half + 1], false).is_some());
    assert_eq!(end.send(START, to(1, 90), &vec![0; half], false), None, "two of these fit");
    assert_eq!(end.send(START, to(1, 90), &vec![0; half + 1], false), None, "not before the other");
    assert_eq!(sent(&mut end, START), [(1, vec![1]), (1, vec![2])]);
    end.assert_balanced();
}

#[test]
fn levels_go_in_order_and_datagrams_are_filled() {
    let mut end = End::new(0, |_| {});
    for (peer, priority, len) in
        [(1, 90, 700), (2, 250, 10), (1, 90, 800), (1, 250, 10), (1, 90, 10), (1, 10, 300), (2, 90, 10), (1, 200, 1000)]
    {
        end.queue(START, to(peer, priority), &vec![0; len]);
    }
    assert_eq!(
        sent(&mut end, START),
        [
            (2, vec![1, 6]),    // Has waited longest of the first level; with it all for that peer that fits.
            (1, vec![3, 7, 5]), // 0 does not fit, so nothing else of its level may go; 5 does.
            (1, vec![0]),
            (1, vec![2, 4]),
        ],
    );
}

#[test]
fn an_urgent_package_goes_between_the_parts_of_a_large_one() {
    let mut end = End::new(0, |_| {});
    end.queue(START, to(1, 90), &vec![1; 5000]);
    end.queue(START, to(1, 90), b"behind it");
    let mut all = Vec::new();
    for round in 0..3 {
        let (_, datagram) = end.poll(START).unwrap();
        all.push(datagram);
        if round == 1 {
            end.queue(START, to(1, 250), b"urgent");
        }
    }
    all.extend(end.leave(START).into_iter().map(|(_, datagram)| datagram));
    assert_eq!(all.iter().map(|datagram| ids(datagram)).collect::<Vec<_>>(), [[0], [0], [2], [0], [0], [1]]);
    let mut offset = 0;
    for datagram in &all {
        let Frame::Fragment(part) = Frame::parse(datagram).unwrap().1 else { continue };
        assert_eq!((part.first, part.count, part.offset, part.head.len), (1, 4, offset, 5000));
        assert!(part.index == 3 || datagram.len() == 1472, "only the last leaves room");
        offset += part.bytes.len() as u32;
    }
    assert_eq!(end.stats.peer(1).sent.fragments.get(), 4);
    end.assert_balanced();
}

#[test]
fn the_largest_package_goes_in_the_smallest_datagrams() {
    let mut end = End::new(0, |settings| settings.network.datagram_bytes_max = crate::settings::DATAGRAM_BYTES_MIN);
    end.queue(START, to(1, 90), &vec![1; rohrpost_mailbox::BODY_BYTES_MAX]);
    let parts = (0..).map(|ms| sent(&mut end, START + ms * MS)).take_while(|parts| !parts.is_empty());
    assert_eq!(parts.map(|parts| parts.len()).sum::<usize>(), 143);
    end.assert_balanced();
}

#[test]
fn what_goes_to_a_node_that_is_not_there_is_lost_with_its_cause() {
    let mismatch = Mismatch { reason: crate::frame::RefusalReason::Digest, version: 1, digest: Some(1) };
    check_cause(|_| {}, Cause::Silent);
    let unheard = |end: &End| {
        let link = &end.stats.peer(1).link;
        link.heard_ns.set(START + 3 * S);
        link.denied_ns.set(START);
    };
    check_cause(unheard, Cause::Unheard);
    check_cause(|end| end.stats.peer(1).link.refuse(START + 3 * S, mismatch), Cause::Refused);
}

/// A package to an absent peer is lost with a cause: new or waiting, and of any kind.
fn check_cause(set: impl Fn(&End), cause: Cause) {
    let mut end = End::new(0, |_| {});
    // Waits since a moment, so it is not stale.
    end.hears(1, START + 3 * S);
    end.queue(START + 3 * S, to(1, 90), &ENVELOPE);
    end.stats.peer(1).link.heard_ns.set(START);
    set(&end);
    let now_ns = START + 3 * S + MS;
    assert_eq!(sent(&mut end, now_ns), []);
    assert_eq!(end.send(now_ns, to(1, 90), &ENVELOPE, true), None);
    assert_eq!(end.log.causes(), [cause; 2]);
    assert!(end.log.lost.iter().all(|(_, body, _)| *body == ENVELOPE));
    assert_eq!(end.stats.out.class(Priority(90)).lost(cause), 2);
    end.assert_balanced();
}

#[test]
fn names_that_nobody_has_and_names_of_this_node_have_no_route() {
    let mut end = End::new(0, |_| {});
    for name in [module(50, 0), module(50, 3), Name::new(2, 50, 1, 0), Name::NONE, Name::from_raw(u32::MAX)] {
        assert_eq!(end.send(START, head(name, module(200, 0), 90), b"", true), None);
    }
    assert_eq!(end.log.causes(), [Cause::NoRoute; 5]);
    assert!(end.send(START, head(module(50, 1).with_local(255), module(200, 0), 90), b"", true).is_some());
    end.assert_balanced();
}

#[test]
fn what_waits_too_long_is_dropped() {
    let mut end = End::new(0, |settings| settings.network.rate_bytes_s = 70_000);
    // A seventh of a second each: less important ones never have their turn.
    for _ in 0..12 {
        end.queue(START, to(1, 90), &[0; 10_000]);
    }
    end.queue(START, head(module(50, 1), module(100, 0), 10), &ENVELOPE);
    let (mut sent_last, mut now_ns) = (0, START);
    while now_ns < START + 3 * S {
        end.hears(1, now_ns);
        if sent(&mut end, now_ns).iter().any(|(_, ids)| !ids.is_empty()) {
            sent_last = now_ns;
        }
        now_ns += 5 * MS;
    }
    assert!(sent_last <= START + WAIT_MAX_NS && sent_last > START + S, "{sent_last}");
    assert!(end.log.causes().contains(&Cause::Stale));
    assert_eq!(end.stats.out.class(Priority(10)).lost(Cause::Stale), 1, "also what waits behind others");
    let old = Package { head: to(1, 90), published_ns: now_ns - WAIT_MAX_NS - 1, body: b"" };
    assert_eq!(end.outbound.accept(now_ns, &old, true, &mut end.log), Accepted::Lost);
    end.assert_balanced();
    assert_eq!(end.stats.waiting_in_all(), 0);
}

#[test]
fn a_package_is_no_more_urgent_than_its_sender_or_its_caller() {
    let mut end = End::new(0, |_| {});
    for (kind, priority, leaves) in [
        (Type::command(16), 250, 100),
        (Type::command(16), 40, 40),
        (Type::reply(16), 250, 50),
        (Type::data(1), 250, 100),
    ] {
        let head = Head { kind, ..head(module(50, 1).with_local(1), module(100, 0), priority) };
        let (_, datagram) = end.send(START, head, b"", true).unwrap();
        let Frame::Packages(mut packages) = Frame::parse(&datagram).unwrap().1 else { panic!() };
        assert_eq!(packages.next().unwrap().0.priority.0, leaves, "{kind:?}");
    }
}

#[test]
fn the_rate_is_kept() {
    const RATE: u64 = 1_000_000;
    let mut end = End::new(0, |settings| settings.network.rate_bytes_s = RATE);
    let (mut bytes, mut now_ns, mut waits) = (0, START, 0);
    while now_ns < START + S {
        end.hears(1, now_ns);
        while end.stats.waiting_in_all() < 20 {
            end.queue(now_ns, to(1, 90), &[0; 1000]);
        }
        match end.poll(now_ns) {
            Ok((_, datagram)) => bytes += datagram.len() as u64 + 28,
            Err(until_ns) => {
                assert!(until_ns > now_ns, "there is something to wait for");
                now_ns = until_ns;
                waits += 1;
            }
        }
    }
    assert!((RATE * 99 / 100..RATE + 2 * 1500).contains(&bytes), "{bytes} B in a second");
    assert!(waits > 500);
}

/// While a flood keeps the wire busy, a package more important than the last one may leave before its time.
#[test]
fn what_is_more_important_than_a_flood_does_not_wait_for_the_pace() {
    let mut end = End::new(0, |settings| settings.network.rate_bytes_s = 1_000_000);
    end.hears(1, START);
    end.leave(START + 10 * MS);
    let flood = |end: &mut End, now_ns| {
        while end.stats.waiting_in_all() < 20 {
            end.queue(now_ns, to(1, 90), &[0; 1000]);
        }
    };
    flood(&mut end, START + 10 * MS);
    let mut now_ns = START + 20 * MS;
    for _ in 0..20 {
        flood(&mut end, now_ns);
        let through_ns = loop {
            if let Err(until_ns) = end.poll(now_ns) {
                break until_ns;
            }
            flood(&mut end, now_ns);
        };
        end.queue(now_ns, to(1, 150), b"urgent");
        assert_eq!(end.poll(now_ns).map(|(to, _)| to), Ok(1), "at once, although the pace holds until {through_ns}");
        end.queue(now_ns, to(1, 150), b"one more of its level");
        now_ns = end.poll(now_ns).expect_err("nothing else goes in advance");
        assert!(now_ns > through_ns, "what went in advance is paid for");
        assert!(end.poll(now_ns).is_ok(), "the other one");
        now_ns = end.poll(now_ns).expect_err("the flood's turn comes");
    }
}

#[test]
fn plenty_is_what_fills_datagrams_and_half_a_quota_and_not_a_dozen_small_packages() {
    let mut end = End::new(0, |settings| settings.network.rate_bytes_s = 70_000);
    end.hears(1, START);
    let quota_bytes = end.settings.network.quota_bytes as u64;
    let mut count = 0;
    while !end.outbound.has_plenty() {
        end.send(START, to(1, 90), b"small", false);
        count += 1;
    }
    assert!(count > 100, "a datagram of small ones has company: {count}");
    assert!(end.stats.waiting_bytes.get() <= quota_bytes, "before anything is lost");
    assert_eq!(end.log.lost.len(), 0);
}

#[test]
fn an_idle_peer_hears_every_200_ms_and_a_busy_one_every_500_ms_what_we_heard() {
    let mut end = End::new(0, |_| {});
    end.hears(1, START);
    end.stats.peer(1).link.incarnation.set(77);
    end.stats.peer(1).link.next.set(5);
    end.stats.peer(1).received.lost.add(3);
    let (mut told, mut now_ns) = (Vec::new(), START);
    while now_ns < START + 4 * S {
        // Node 1 is busy for the last two seconds, node 2 never.
        if now_ns >= START + 2 * S {
            end.hears(1, now_ns);
            end.send(now_ns, to(1, 90), b"busy", true).unwrap();
        }
        for (to, datagram) in end.leave(now_ns) {
            let Frame::Alive(alive) = Frame::parse(&datagram).unwrap().1 else { panic!() };
            told.push((to, now_ns - START));
            // Node 1 is silent for the second before it is busy.
            let is_heard = to == 1 && !(START + S..START + 2 * S).contains(&now_ns);
            let heard =
                if is_heard { Alive { heard_incarnation: 77, heard_next: 5, heard_lost: 3 } } else { Alive::default() };
            assert_eq!(alive, heard);
        }
        now_ns += 10 * MS;
    }
    let of = |node, begin, end| told.iter().filter(|(to, at)| *to == node && (begin..end).contains(at)).count();
    assert_eq!(
        (of(1, 0, 2 * S), of(2, 0, 2 * S), of(2, 2 * S, 4 * S)),
        (11, 10, 10),
        "and once more 10 ms after the first, and to a peer that begins an incarnation"
    );
    assert_eq!(of(1, 2 * S, 4 * S), 4, "a busy one");
    assert_eq!((ALIVE_EVERY_NS, TELL_EVERY_NS), (200 * MS, S / 2));
}

#[test]
fn what_the_socket_does_not_take_is_counted_once() {
    let mut end = End::new(0, |_| {});
    let (_, direct) = end.send(START, to(1, 90), &ENVELOPE, true).unwrap();
    end.outbound.unsent(&direct[..DIRECT_HEAD_BYTES], &ENVELOPE, &mut end.log);
    end.queue(START, to(1, 90), b"one");
    end.queue(START, to(1, 90), b"two");
    let (_, packed) = end.poll(START).unwrap();
    end.outbound.unsent(&packed, &[], &mut end.log);
    assert_eq!(end.log.causes(), [Cause::Socket; 3]);
    let bodies: Vec<_> = end.log.lost.iter().map(|(_, body, _)| &body[..]).collect();
    assert_eq!(bodies, [&ENVELOPE[..], b"one", b"two"]);
    for fails in [0, 1, 3] {
        end.queue(START, to(1, 90), &vec![0; 5000]);
        for part in 0..4 {
            let Ok((_, datagram)) = end.poll(START) else { break };
            if part == fails {
                end.outbound.unsent(&datagram, &[], &mut end.log);
            }
        }
    }
    assert_eq!(end.log.causes(), [Cause::Socket; 6]);
    assert!(end.leave(START).is_empty(), "the other parts of what is lost do not go");
    assert_eq!(end.stats.peer(1).sent.packages.get(), 0);
    end.assert_balanced();
}

proptest! {
    #[test]
    fn accounts_balance_whatever_happens(
        steps in prop::collection::vec((0u8..8, 0u8..4, any::<u8>(), 0usize..9000, 0u64..300), 1..150),
    ) {
        let mut end = End::new(0, |settings| settings.network.rate_bytes_s = 200_000);
        let (mut now_ns, mut packages) = (START, 0);
        for (what, node, priority, len, ms) in steps {
            now_ns += ms * MS / 10;
            match what {
                0 => now_ns += ms * 10 * MS,
                1 => (1..3).for_each(|node| end.hears(node, now_ns)),
                2 => {
                    if let Ok((_, datagram)) = end.poll(now_ns) {
                        end.outbound.unsent(&datagram, &[], &mut end.log);
                    }
                }
                3 => drop(end.leave(now_ns)),
                _ => {
                    packages += 1;
                    end.send(now_ns, to(node, priority), &vec![0; len], what == 4);
                }
            }
            end.assert_balanced();
        }
        let counted: u64 = end.stats.out.classes().map(|(_, class)| class.packages.get()).sum();
        prop_assert_eq!(counted, packages);
        // Nothing waits forever.
        end.leave(now_ns + 2 * S);
        prop_assert_eq!((end.stats.waiting_in_all(), end.stats.waiting_bytes.get()), (0, 0));
        end.assert_balanced();
    }
}

/// Packages to the one wait, in order; those to the other leave meanwhile, also at once, and it gets keep-alives.
#[test]
fn a_way_without_room_is_passed_over() {
    let mut end = End::new(0, |_| {});
    end.hears(1, START);
    end.hears(2, START);
    end.outbound.pass_over(0b10);
    end.queue(START, to(1, 200), b"for the one");
    assert_eq!(end.send(START, to(1, 200), b"and another", true), None, "it does not leave at once either");
    end.queue(START, to(2, 90), b"for the other");
    let left = sent(&mut end, START + MS);
    assert_eq!(left.iter().map(|(to, _)| *to).collect::<Vec<_>>(), [2], "although the other is more important");
    let alive: Vec<_> = end.leave(START + ALIVE_EVERY_NS + 2 * MS).into_iter().map(|(to, _)| to).collect();
    assert_eq!(alive, [2], "it is told that we are there");
    end.hears(1, START + ALIVE_EVERY_NS);
    end.outbound.pass_over(0);
    let left = sent(&mut end, START + ALIVE_EVERY_NS + 3 * MS);
    assert_eq!(left.iter().map(|(to, _)| *to).collect::<Vec<_>>(), [1]);
    assert_eq!(left[0].1.len(), 2, "both, in one datagram");
    end.assert_balanced();
}

#[test]
fn what_is_not_real_time_leaves_at_the_rate_that_is_left() {
    let slow = |settings: &mut Settings| settings.network.rate_bytes_s = 1_000_000;
    let (mut first, mut rest) = (End::new(0, slow), End::new(0, slow));
    rest.outbound = Outbound::new(&rest.settings, rest.stats.clone()).behind(&first.stats);
    assert_eq!(rest.send(START, to(1, 90), b"", true), None, "it has not said that it hears this incarnation");
    assert!(rest.poll(START).is_err(), "so nothing leaves");
    for end in [&mut first, &mut rest] {
        end.hears(1, START);
    }
    // Each sends what it can for 100 ms.
    let mut bytes = [0; 2];
    for now_ns in (0..1000).map(|step| START + 10 * MS + step * MS / 10) {
        for (end, bytes) in [&mut first, &mut rest].into_iter().zip(&mut bytes) {
            let heads = end.settings.overhead_bytes();
            let mut count = |datagram: &[u8]| *bytes += datagram.len() + heads;
            while end.stats.waiting_in_all() < 3 {
                let at_once = end.send(now_ns, to(1, 90), &[0; 1000], false);
                at_once.iter().for_each(|(_, datagram)| count(datagram));
            }
            while let Ok((_, datagram)) = end.poll(now_ns) {
                count(&datagram);
            }
        }
    }
    assert!(bytes[0] > 90_000, "what is real time is not held up: {bytes:?}");
    assert!(bytes[0] + bytes[1] < 110_000, "and both do not leave faster than the rate: {bytes:?}");
}
