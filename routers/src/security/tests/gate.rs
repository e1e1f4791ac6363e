//! The gate asks as often as it must, and no more often.

use super::*;
use crate::frame::{BadFrame, RefusalReason, VERSION};
use crate::harness::{End, MS, S, START, address};
use crate::inbound::Envelope;
use crate::inbound::TICK_EVERY_NS;
use crate::link::PeerLinkState;
use crate::report::{Mismatch, RouterEvent};
use rohrpost_network::Security;

struct Router {
    gate: Gate,
    all: Arc<PeerSessions>,
    end: End,
}

impl Router {
    fn new(own: u8) -> Self {
        Self::with_digest(own, DIGEST)
    }

    fn with_digest(own: u8, digest: u64) -> Self {
        let end = End::new(own, |settings| {
            settings.network.security = Security::Keys;
            settings.digest = digest;
        });
        Self::with_keys(end, ring(&[1]), own)
    }

    fn with_keys(end: End, keys: KeyRing, own: u8) -> Self {
        let all = PeerSessions::new(RouterIdentity::of(&end.settings), keys);
        Self { gate: Gate::new(&all, [own; 32]), all, end }
    }

    fn ask(&mut self, now_ns: u64) -> Vec<(u8, Vec<u8>)> {
        let mut datagram = [0; HELLO_DATAGRAM_BYTES];
        let Self { gate, end, .. } = self;
        let mut all = Vec::new();
        while let Some(said) = gate.ask(now_ns, &end.stats, &mut datagram) {
            all.push((said.to, datagram[..said.bytes].to_vec()));
        }
        all
    }

    fn take(&mut self, now_ns: u64, from: u8, datagram: &[u8]) -> Option<Vec<u8>> {
        let (mut bytes, mut reply) = (datagram.to_vec(), [0; HELLO_DATAGRAM_BYTES]);
        let came = Envelope { source: address(from), arrived_ns: now_ns, bytes: bytes.len() };
        let Self { gate, end: End { inbound, log, .. }, .. } = self;
        let said = gate.take(now_ns, &came, &mut bytes, inbound, log, &mut reply);
        let reply = said.map(|said| reply[..said.bytes].to_vec());
        gate.begin(now_ns);
        reply
    }
}

#[test]
fn an_unknown_peer_is_challenged_again_and_again_and_one_with_another_incarnation_soon() {
    let (mut a, mut b) = (Router::new(0), Router::new(1));
    let asked = a.ask(START);
    assert_eq!(asked.iter().map(|(to, _)| *to).collect::<Vec<_>>(), [1, 2]);
    assert_eq!(a.ask(START + ASK_EVERY_NS / 2), []);
    assert_eq!(a.ask(START + ASK_EVERY_NS).len(), 2, "nobody has answered");
    let answer = b.take(START, 0, &asked[0].1).unwrap();
    let last = a.take(START, 1, &answer).unwrap();
    assert!(b.take(START, 0, &last).is_none());
    assert_eq!((a.all.known(), b.all.known()), (0b10, 0b01));
    let now_ns = START + 2 * ASK_EVERY_NS;
    assert_eq!(a.ask(now_ns).iter().map(|(to, _)| *to).collect::<Vec<_>>(), [2], "the other is known");
    // b begins anew, and a does not know it.
    let datagram = sealed_alive(&mut Sealing::new(&a.all, Port::Packages), 0);
    let mut again = Router::new(1);
    again.ask(now_ns);
    assert!(again.take(now_ns, 0, &datagram).is_none());
    assert_eq!(again.all.rejections(Port::Packages).of(Some(0), Rejection::OtherIncarnation), 1);
    assert_eq!(again.ask(now_ns + 20 * MS).len(), 1, "sooner than a silent peer");
    let told = again.end.log.events.iter().filter(|event| matches!(event, RouterEvent::Rejected { .. })).count();
    assert_eq!(told, 1);
}

#[test]
fn another_wire_format_is_reported_by_its_receiver_and_changes_nothing() {
    let (mut a, mut b) = (Router::new(0), Router::new(1));
    let (_, mut question) = a.ask(START).swap_remove(0);
    question[2] = VERSION + 1;
    crate::frame::write_check(&mut question);
    assert_eq!(b.take(START, 0, &question), None);
    let told = RouterEvent::Rejected {
        source: address(0),
        peer: Some(0),
        why: NotOpened::Bad(BadFrame::Version(VERSION + 1)),
        datagrams: 1,
    };
    assert_eq!(b.end.log.events, [told]);
    assert_eq!(b.all.rejections(Port::Packages).of(Some(0), Rejection::Version), 1);
    assert_eq!(b.all.known(), 0);
}

#[test]
fn a_peer_that_is_challenged_again_after_long_can_answer() {
    let (mut a, mut b) = (Router::new(0), Router::new(1));
    a.ask(START);
    let late_ns = START + 50 * CHALLENGE_MAX_NS;
    let question = a.ask(late_ns)[0].1.clone();
    let answer = b.take(late_ns, 0, &question).unwrap();
    assert!(a.take(late_ns + CHALLENGE_MAX_NS - 1, 1, &answer).is_some());
    assert_eq!(a.all.known(), 0b10);
}

#[test]
fn a_peer_that_is_away_for_long_is_challenged_seldom() {
    let mut a = Router::new(0);
    let mut asked_in = |seconds: std::ops::Range<u64>| {
        let mut times_ns = (seconds.start * S..seconds.end * S).step_by((10 * MS) as usize);
        let mut asked = 0;
        times_ns.by_ref().for_each(|ns| asked += a.ask(START + ns).len());
        asked / 2
    };
    let first = asked_in(0..5);
    assert!((20..=50).contains(&first), "{first}");
    asked_in(5..12);
    let later = asked_in(12..32);
    assert!((10..=20).contains(&later), "{later}");
}

/// Lets a ask b; both know each other then.
fn acquaint_at(now_ns: u64, a: &mut Router, b: &mut Router) {
    let (own, other) = (a.end.settings.own, b.end.settings.own);
    let question = a.ask(now_ns).into_iter().find(|(to, _)| *to == other).unwrap().1;
    let answer = b.take(now_ns, own, &question).unwrap();
    let last_word = a.take(now_ns, other, &answer).unwrap();
    assert_eq!(b.take(now_ns, own, &last_word), None);
}

/// Of node 0, that it is still there.
fn alive(sequence: u64) -> (FrameHead, Vec<u8>) {
    let told = crate::frame::Alive { heard_incarnation: 0, heard_next: 0, heard_lost: 0 }.to_bytes();
    let kind = FrameKind::Alive;
    let head = FrameHead { kind, system: SYSTEM, from: 0, to: 1, digest: DIGEST, incarnation: 100, sequence };
    (head, told.to_vec())
}

fn sealed_alive(sealing: &mut Sealing, sequence: u64) -> Vec<u8> {
    let (head, told) = alive(sequence);
    let mut datagram = [&[0; HEAD_BYTES], &told[..], &[0; TAG_BYTES]].concat();
    sealing.seal(&head, &mut datagram).unwrap();
    datagram
}

#[test]
fn what_is_lost_before_the_first_that_comes_is_counted() {
    let (mut a, mut b) = (Router::new(0), Router::new(1));
    acquaint_at(START, &mut a, &mut b);
    let mut sealing = Sealing::new(&a.all, Port::Packages);
    let mut datagram = Vec::new();
    (0..100).for_each(|sequence| datagram = sealed_alive(&mut sealing, sequence));
    b.take(START, 0, &datagram);
    for tick in 1..=4 {
        b.end.inbound.poll(START + tick * TICK_EVERY_NS, &mut [0; 100], &mut b.end.log);
    }
    let received = &b.end.stats.peer(0).received;
    assert_eq!((received.datagrams.get(), received.lost.get()), (1, 99));
}

#[test]
fn replays_from_the_address_of_a_third_node_separate_no_node_from_it() {
    let (mut a, mut b) = (Router::with_digest(0, 8), Router::new(1));
    let recorded = a.ask(START)[0].1.clone();
    assert_eq!(b.take(START, 2, &recorded), None);
    let state = |router: &Router, peer| router.end.stats.state(peer, START);
    assert!([0, 2].iter().all(|peer| !matches!(state(&b, *peer), PeerLinkState::Refused(_))));
    assert_eq!(b.all.rejections(Port::Packages).of(Some(2), Rejection::Address), 1);
    b.take(START, 0, &recorded);
    assert!(matches!(state(&b, 0), PeerLinkState::Refused(_)), "from its own, it may have another configuration");
}

/// Anybody can write a peer's address on a datagram that nobody can open.
#[test]
fn a_cause_is_believed_of_the_silent_alone() {
    let mut b = Router::new(1);
    let keyed = |keys| Router::with_keys(End::new(0, |settings| settings.network.security = Security::Keys), keys, 0);
    let (mut other_id, mut other_key) = (keyed(ring(&[2])), keyed(KeyRing::new(key_of(1, [9; KEY_BYTES]), None)));
    let (other_id, other_key) = (other_id.ask(START)[0].1.clone(), other_key.ask(START)[0].1.clone());
    let mut version = other_id.clone();
    version[2] = VERSION + 1;
    crate::frame::write_check(&mut version);
    let (head, told) = alive(0);
    let unsealed = [&head.to_bytes(&[&told])[..], &told].concat();
    let state = |b: &Router, now_ns| b.end.stats.state(0, now_ns);
    b.take(START, 0, &other_key);
    assert_eq!(state(&b, START), PeerLinkState::Unknown, "it may be heard yet, and packages go to it");
    let mut now_ns = START + 2 * S;
    for (datagram, reason, wire) in [
        (&other_id, RefusalReason::Key, VERSION),
        (&other_key, RefusalReason::Key, VERSION),
        (&version, RefusalReason::Version, VERSION + 1),
        (&unsealed, RefusalReason::Sealed, VERSION),
    ] {
        now_ns += 10 * S;
        assert_eq!(state(&b, now_ns), PeerLinkState::Silent, "what was said is over");
        b.take(now_ns, 0, datagram);
        let mismatch = Mismatch { reason, version: wire, digest: None };
        assert_eq!(state(&b, now_ns), PeerLinkState::Refused(mismatch));
        assert_eq!(b.end.stats.state(2, now_ns), PeerLinkState::Silent, "of the others nothing is said");
    }
    // With the right key it is heard, and what seems to come from it beside that changes nothing.
    let mut a = Router::new(0);
    acquaint_at(now_ns, &mut a, &mut b);
    b.take(now_ns, 0, &sealed_alive(&mut Sealing::new(&a.all, Port::Packages), 0));
    assert_eq!(state(&b, now_ns), PeerLinkState::Alive);
    b.take(now_ns, 0, &other_key);
    assert_eq!(state(&b, now_ns), PeerLinkState::Alive);
}

#[test]
fn what_is_longer_than_any_of_ours_is_not_opened() {
    let (a, mut b) = (Router::new(0), Router::new(1));
    let mut hello = [0; HELLO_DATAGRAM_BYTES];
    a.all.ask(1, &mut hello).unwrap();
    b.take(START, 0, &checked([&hello[..], &[0; 60_000]].concat()));
    b.take(START, 0, &checked([&hello[..], &[0; 1]].concat()));
    let rejected = |why| b.all.rejections(Port::Packages).of(Some(0), why);
    assert_eq!((rejected(Rejection::NotOurs), rejected(Rejection::Forged)), (1, 1));
}

/// Other ports than that of packages, with keys, windows and counters of their own: hellos are neither said nor taken.
#[test]
fn another_port_opens_what_is_sealed_for_it_and_counts_the_rest_for_itself() {
    for port in [Port::Rest, Port::Replicas] {
        let (mut a, mut b) = (Router::new(0), Router::new(1));
        acquaint_at(START, &mut a, &mut b);
        b.gate = Gate::without_hellos(&b.all, port);
        assert_eq!(b.ask(START + 10 * S), []);
        let sealed = sealed_alive(&mut Sealing::new(&a.all, port), 0);
        let for_packages = sealed_alive(&mut Sealing::new(&a.all, Port::Packages), 1);
        let hello = a.ask(START + S).swap_remove(0).1;
        let mut unsealed = sealed.clone();
        unsealed[7] = 0;
        for (from, datagram, why) in [
            (2, &sealed, Some(Rejection::Address)),
            (0, &sealed, None),
            (0, &sealed, Some(Rejection::Replay)),
            (0, &for_packages, Some(Rejection::Forged)),
            (0, &hello, Some(Rejection::NotOurs)),
            (0, &checked(unsealed), Some(Rejection::Unsealed)),
        ] {
            assert_eq!(b.take(START + S, from, datagram), None);
            let all = Rejection::ALL.map(|why| b.all.rejections(port).of(Some(from), why));
            assert_eq!(why.map_or(1, |why| all[why as usize]), 1, "{port:?}, {why:?}: {all:?}");
        }
        assert_eq!(b.end.stats.peer(0).received.datagrams.get(), 1, "{port:?}");
        let elsewhere = Port::ALL.into_iter().filter(|other| *other != port);
        let counted = elsewhere.flat_map(|other| Rejection::ALL.map(|why| b.all.rejections(other).of(Some(0), why)));
        assert_eq!(counted.sum::<u64>(), 0);
    }
}

/// An attacker that reads all datagrams, and is faster than the peers.
#[test]
fn what_is_brought_from_a_wrong_address_is_not_used_up_by_that() {
    let (mut a, mut b) = (Router::new(0), Router::new(1));
    acquaint_at(START, &mut a, &mut b);
    let datagram = sealed_alive(&mut Sealing::new(&a.all, Port::Packages), 0);
    let received = |b: &Router| b.end.stats.peer(0).received.datagrams.get();
    let before = received(&b);
    b.take(START, 2, &datagram);
    assert_eq!((b.all.rejections(Port::Packages).of(Some(2), Rejection::Address), received(&b)), (1, before));
    b.take(START, 0, &datagram);
    assert_eq!(received(&b), before + 1);
    b.take(START, 0, &datagram);
    assert_eq!((b.all.rejections(Port::Packages).of(Some(0), Rejection::Replay), received(&b)), (1, before + 1));
}
