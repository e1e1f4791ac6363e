//! Sealed datagrams: which nodes can read them, and what happens to those that are altered, replayed or sent elsewhere.

use super::*;
use std::collections::BTreeSet;

#[test]
fn nothing_of_what_was_sealed_can_be_read_on_the_wire() {
    let (mut a, _) = pair();
    let text = b"estop estop estop estop";
    let datagram = a.seal(Port::Packages, 1, text).unwrap();
    assert!(!datagram.windows(5).any(|part| part == b"estop"));
    let again = a.seal(Port::Packages, 1, text).unwrap();
    let rest = |datagram: &[u8]| datagram[HEAD_BYTES..].to_vec();
    assert_ne!(rest(&datagram), rest(&again), "the same twice does not look the same");
    let elsewhere = a.seal(Port::Time, 1, text).unwrap();
    assert_ne!(rest(&datagram), rest(&elsewhere), "nor at the other port, with the same sequence");
}

#[test]
fn each_bit_counts() {
    let (mut a, mut b) = pair();
    let datagram = a.seal(Port::Packages, 1, b"text").unwrap();
    for bit in 0..datagram.len() * 8 {
        let mut altered = datagram.clone();
        altered[bit / 8] ^= 1 << (bit % 8);
        assert!(b.open(Port::Packages, &altered).is_err(), "bit {bit}");
        // The check itself is no part of what is signed: written anew, it is what it was.
        if !(HEAD_BYTES - 4..HEAD_BYTES).contains(&(bit / 8)) {
            assert!(b.open(Port::Packages, &checked(altered)).is_err(), "bit {bit}, with the check that belongs to it");
        }
    }
    for bytes in 0..datagram.len() {
        assert!(b.open(Port::Packages, &checked(datagram[..bytes].to_vec())).is_err(), "cut to {bytes}");
    }
    assert!(b.open(Port::Packages, &checked([&datagram[..], b"!"].concat())).is_err());
    assert_eq!(b.open(Port::Packages, &datagram).unwrap().1, b"text", "none of this did any harm");
}

/// Any order within the window; each once.
#[test]
fn each_opens_once_in_whatever_order_within_the_window() {
    let (mut a, mut b) = pair();
    let mut datagrams: Vec<_> = (0..1024_u16).map(|n| a.seal(Port::Packages, 1, &n.to_le_bytes()).unwrap()).collect();
    // The last first, and then as far from each other as can be.
    datagrams.rotate_right(1);
    let order = (0..1024).map(|n| n * 389 % 1024).filter(|n| *n != 0);
    for place in [0].into_iter().chain(order) {
        assert!(b.open(Port::Packages, &datagrams[place]).is_ok(), "{place}");
    }
    for datagram in &datagrams {
        assert_eq!(b.open(Port::Packages, datagram), Err(Rejection::Replay.into()));
    }
}

#[test]
fn what_is_for_another_node_or_incarnation_does_not_open() {
    let (mut a, mut b) = pair();
    let mut c = Router::new(2, 300);
    acquaint(&mut c, &mut a);
    let for_b = a.seal(Port::Packages, 1, b"text").unwrap();
    let rejected = |why: Rejection| Err(NotOpened::from(why));
    assert_eq!(c.open(Port::Packages, &for_b), rejected(Rejection::NotOurs));
    assert_eq!(a.open(Port::Packages, &for_b), rejected(Rejection::NotOurs), "sent back to its sender");
    let mut readdressed = for_b.clone();
    readdressed[6] = 2;
    assert_eq!(c.open(Port::Packages, &checked(readdressed)), rejected(Rejection::Forged));
    let mut later = Router::new(1, 201);
    acquaint(&mut a, &mut later);
    assert_eq!(
        later.open(Port::Packages, &for_b),
        rejected(Rejection::Replay),
        "said before this incarnation was known"
    );
    assert!(b.open(Port::Packages, &for_b).is_ok());
    // An incarnation of the receiver that its sender does not know of yet.
    let mut unknown = Router::new(1, 202);
    acquaint(&mut unknown, &mut Router::new(0, 100));
    let for_later = a.seal(Port::Packages, 1, b"text").unwrap();
    assert_eq!(unknown.open(Port::Packages, &for_later), rejected(Rejection::Forged), "for another incarnation");
    assert!(later.open(Port::Packages, &for_later).is_ok());
}

#[test]
fn wrong_keys_and_none_are_told_apart() {
    let (a, _) = pair();
    let rejected = |why: Rejection| Some(NotOpened::from(why));
    let sealed = a.ask(1);
    let mut other_id = Router::with_keys(1, 200, ring(&[9]));
    assert_eq!(other_id.greet(&sealed).err(), rejected(Rejection::OtherKey));
    let mut other_bytes = Router::with_keys(1, 200, KeyRing::new(key_of(1, [77; KEY_BYTES]), None));
    assert_eq!(other_bytes.greet(&sealed).err(), rejected(Rejection::Forged));
    let head = a.head(Port::Packages, 1, 0);
    let open = [&head.to_bytes(&[b"text"])[..], b"text"].concat();
    assert_eq!(Router::new(1, 200).open(Port::Packages, &open).err(), rejected(Rejection::Unsealed));
}

#[test]
fn no_two_derived_keys_are_the_same() {
    use super::super::keys::{Binding, Endpoint, Purpose};
    let ring = ring(&[2, 1]);
    let mut seen = BTreeSet::new();
    let mut number = 0;
    for place in [0, 1] {
        for purpose in [Purpose::Hello].into_iter().chain(Port::ALL.map(Port::purpose)) {
            for (system, from, from_incarnation, to, to_incarnation) in [
                (1, 0, 5, 1, 6),
                (2, 0, 5, 1, 6),
                (1, 1, 5, 0, 6),
                (1, 0, 6, 1, 5),
                (1, 0, 5, 1, 7),
                (1, 0, 4, 1, 6),
                (1, 0, 5, 2, 6),
                (1, 2, 5, 1, 6),
            ] {
                let (from, to) = (
                    Endpoint { node: from, incarnation: from_incarnation },
                    Endpoint { node: to, incarnation: to_incarnation },
                );
                let mut datagram = [0; HEAD_BYTES + 32 + TAG_BYTES];
                ring.derive(place, &Binding { purpose, system, from, to }).close([0; 12], &mut datagram);
                seen.insert(datagram[HEAD_BYTES..].to_vec());
                number += 1;
            }
        }
    }
    assert_eq!(seen.len(), number);
}

#[test]
#[should_panic(expected = "sealed a second time")]
fn a_sequence_is_never_sealed_twice() {
    let (mut a, _) = pair();
    a.seal(Port::Packages, 1, b"one").unwrap();
    a.next[0] = 0;
    let _ = a.seal(Port::Packages, 1, b"another");
}

#[test]
fn what_is_sealed_for_a_port_opens_there_and_at_no_other() {
    for port in Port::ALL {
        let (mut a, mut b) = pair();
        let [there, back] = [a.seal(port, 1, b"text").unwrap(), b.seal(port, 0, b"text").unwrap()];
        for (router, sealed) in [(&mut b, &there), (&mut a, &back)] {
            for other in Port::ALL.into_iter().filter(|other| *other != port) {
                let opened = router.open(other, sealed);
                assert_eq!(opened, Err(Rejection::Forged.into()), "sealed for {port:?}, brought to {other:?}");
            }
            assert_eq!(router.open(port, sealed).unwrap().1, b"text");
            assert_eq!(router.open(port, sealed), Err(Rejection::Replay.into()));
        }
    }
}

/// Each port has one thread that seals. If it had two, one would end, and no nonce would serve twice.
#[test]
fn of_two_threads_that_seal_at_a_port_none_uses_a_sequence_of_the_other() {
    let (a, _) = pair();
    let begin = std::sync::Barrier::new(2);
    let used = || {
        begin.wait();
        let uses = |sequence: &u64| {
            let use_up = || a.all.use_up(Port::Replicas, 1, *sequence);
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(use_up)).is_ok()
        };
        (0..2000).filter(uses).collect::<BTreeSet<u64>>()
    };
    let [one, other] = std::thread::scope(|scope| [scope.spawn(used), scope.spawn(used)].map(|it| it.join().unwrap()));
    assert!(one.is_disjoint(&other));
    assert_eq!(one.union(&other).max(), Some(&1999), "the last is used by one of them");
}

#[test]
fn what_is_not_taken_is_counted_by_cause_and_told_once_a_second() {
    let (a, _) = pair();
    let counts = a.all.rejections(Port::Packages);
    let mut tally = Tally::new(counts);
    let told: Vec<_> = (0..30).map(|n| tally.note(n * TELL_EVERY_NS / 10, Some(1), Rejection::Forged)).collect();
    let expected: Vec<_> = (0..30).map(|n| (n % 10 == 0).then_some(if n == 0 { 1 } else { 10 })).collect();
    assert_eq!(told, expected);
    assert_eq!(tally.note(0, None, Rejection::Unsealed), Some(1), "others have a turn of their own");
    assert_eq!((counts.of(Some(1), Rejection::Forged), counts.of(Some(1), Rejection::Replay)), (30, 0));
    assert_eq!((counts.of(None, Rejection::Unsealed), counts.of(Some(0), Rejection::Unsealed)), (1, 0));
}

#[test]
fn what_could_not_be_sent_can_be_read_again_in_any_later_incarnation() {
    let (mut a, _) = pair();
    let mut datagram = a.seal(Port::Packages, 1, b"a package").unwrap();
    acquaint(&mut Router::new(1, 201), &mut a);
    a.sealing[0].reopen(&mut datagram);
    assert_eq!(&datagram[HEAD_BYTES..][..9], b"a package");
}

/// At some ports no hello says what comes first; still nothing is opened twice there, also when an incarnation begins
/// again, and when another was taken for its successor meanwhile.
#[test]
fn where_no_hello_says_what_comes_first_all_opens_once_however_often_its_incarnation_begins() {
    for port in [Port::Rest, Port::Replicas] {
        let (mut a, mut b) = pair();
        let seal = |a: &mut Router| a.seal(port, 1, b"text").unwrap();
        let early = seal(&mut a);
        let datagrams: Vec<_> = (0..5).map(|_| seal(&mut a)).collect();
        for datagram in &datagrams {
            assert!(b.open(port, datagram).is_ok());
        }
        assert_eq!(b.opening[port as usize].first(0), 1, "what it sent before is not missed");
        assert!(b.open(port, &early).is_ok(), "it was reordered");
        let again = |a: &mut Router, b: &mut Router, why: &str| {
            for datagram in datagrams.iter().chain([&early]) {
                assert_eq!(b.open(port, datagram), Err(Rejection::Replay.into()), "{port:?}: {why}");
            }
            let next = a.seal(port, 1, b"text").unwrap();
            assert!(b.open(port, &next).is_ok(), "{port:?}: {why}");
        };
        again(&mut a, &mut b, "the same incarnation");
        acquaint(&mut a, &mut b);
        again(&mut a, &mut b, "it is greeted again");
        let mut other = Router::new(0, 101);
        acquaint(&mut other, &mut b);
        let of_other = other.seal(port, 1, b"text").unwrap();
        assert!(b.open(port, &of_other).is_ok());
        acquaint(&mut a, &mut b);
        again(&mut a, &mut b, "another was taken for its successor");
    }
}
