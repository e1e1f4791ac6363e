//! Time slots: time is sealed to each holder of the key, since a joining node must hear it. Hellos wait for a slot.

use super::*;

/// One that sends time in slots, and two others.
fn three() -> [Router; 3] {
    let routers = [Router::new(0, 100), Router::new(1, 200), Router::new(2, 300)];
    routers.map(in_slots)
}

fn in_slots(mut router: Router) -> Router {
    router.sealing[Port::Time as usize] = Sealing::of_slots(&router.all);
    router
}

fn overhears(router: &mut Router, datagram: &[u8]) -> Result<Vec<u8>, NotOpened> {
    let opening = &mut router.opening[Port::Time as usize];
    opening.overhear(&mut datagram.to_vec(), |_| true).map(|(_, text)| text.to_vec())
}

fn is_strange(router: &mut Router, datagram: &[u8]) -> bool {
    router.opening[Port::Time as usize].is_strange(datagram)
}

#[test]
fn an_unknown_peer_is_heard_unverified_and_proves_nothing() {
    let [mut a, mut b, mut c] = three();
    let before = a.seal(Port::Time, 1, b"now").unwrap();
    assert_eq!(b.open(Port::Time, &before), Err(Rejection::OtherIncarnation.into()));
    assert!(is_strange(&mut b, &before));
    assert_eq!(
        (overhears(&mut b, &before).unwrap(), overhears(&mut b, &before).unwrap()),
        (b"now".into(), b"now".into())
    );
    assert!(b.all.doubts(0), "it is to be asked soon");
    assert!(overhears(&mut c, &before).is_err() && !is_strange(&mut c, &before), "it was for another node");
    for bit in 0..before.len() * 8 {
        let mut altered = before.clone();
        altered[bit / 8] ^= 1 << (bit % 8);
        assert!(overhears(&mut b, &checked(altered)).is_err() || bit / 8 / 4 == (HEAD_BYTES - 4) / 4, "bit {bit}");
    }
    acquaint(&mut b, &mut a);
    let after = a.seal(Port::Time, 1, b"then").unwrap();
    assert!(!is_strange(&mut b, &after), "now it is known to live");
    assert_eq!(b.open(Port::Time, &after).unwrap().1, b"then");
    for said in [&before, &after] {
        assert_eq!(b.open(Port::Time, said), Err(Rejection::Replay.into()), "what it said before, and what was taken");
    }
}

#[test]
fn another_incarnation_of_a_known_peer_is_heard_unverified_and_the_known_one_goes_on() {
    let [mut a, mut b, _] = three();
    acquaint(&mut b, &mut a);
    let mut next = in_slots(Router::new(0, 101));
    let said = next.seal(Port::Time, 1, b"anew").unwrap();
    assert!(is_strange(&mut b, &said));
    assert_eq!(overhears(&mut b, &said).unwrap(), b"anew");
    let known = a.seal(Port::Time, 1, b"on").unwrap();
    assert_eq!(b.open(Port::Time, &known).unwrap().1, b"on");
    let mut again = in_slots(Router::new(1, 201));
    let known = a.seal(Port::Time, 1, b"on").unwrap();
    assert_eq!(overhears(&mut again, &known).unwrap(), b"on", "another incarnation of the receiver hears it as well");
    let packages = a.seal(Port::Packages, 1, b"on").unwrap();
    assert!(overhears(&mut again, &packages).is_err(), "but no packages");
}

#[test]
fn while_keys_are_changed_a_peer_with_either_hears_enough() {
    for (ids, known, least) in [(&[1][..], false, 8), (&[2], false, 8), (&[1], true, 4), (&[2], true, 4)] {
        let mut a = in_slots(Router::with_keys(0, 100, ring(&[2, 1])));
        let mut b = in_slots(Router::with_keys(1, 200, ring(ids)));
        if known {
            // An earlier incarnation that had the other key.
            let mut before = Router::with_keys(1, 199, ring(&[3 - ids[0]]));
            acquaint(&mut before, &mut a);
            assert_eq!(a.all.incarnation(1), Some(199));
        }
        let heard = (0..16).filter(|_| {
            let said = a.seal(Port::Time, 1, b"now").unwrap();
            overhears(&mut b, &said).is_ok()
        });
        assert_eq!(heard.count(), least, "{ids:?}, known {known}");
    }
}

fn said(to: NodeIndex, is_reply: bool, begins: bool) -> OutgoingHello {
    OutgoingHello { to, bytes: HELLO_DATAGRAM_BYTES, is_reply, begins }
}

/// What leaves next: its receiver, whether it is a reply, and its first byte.
fn next(waiting: &mut HelloQueue, now_ns: u64, first: Option<NodeIndex>) -> Option<(NodeIndex, bool, u8)> {
    waiting.take(now_ns, first).map(|(said, datagram)| (said.to, said.is_reply, datagram[0]))
}

#[test]
fn the_newest_hellos_wait_and_replies_go_first() {
    let [a, ..] = three();
    let mut waiting = HelloQueue::new(&a.all);
    let mut put = |now_ns, said, mark| waiting.put(now_ns, said, &[mark; HELLO_DATAGRAM_BYTES]);
    put(0, said(1, false, false), 1);
    put(1, said(1, false, false), 2);
    put(1, said(2, false, false), 3);
    put(1, said(1, true, true), 4);
    put(2, said(1, true, false), 5);
    put(2, said(9, true, false), 6);
    assert_eq!(next(&mut waiting, 2, Some(2)), Some((1, true, 4)), "an incarnation begins by it; nobody is node 9");
    assert_eq!(next(&mut waiting, 2, Some(1)), Some((1, false, 2)), "the newest, and the given peer's first");
    assert_eq!(next(&mut waiting, 2, Some(1)), Some((2, false, 3)));
    assert_eq!(next(&mut waiting, 2, None), None);
    waiting.put(0, said(1, true, true), &[7; HELLO_DATAGRAM_BYTES]);
    waiting.put(CHALLENGE_MAX_NS, said(1, true, false), &[8; HELLO_DATAGRAM_BYTES]);
    assert_eq!(next(&mut waiting, CHALLENGE_MAX_NS, None), Some((1, true, 8)), "what nobody would take gives way");
    waiting.put(0, said(1, false, false), &[9; HELLO_DATAGRAM_BYTES]);
    assert_eq!(next(&mut waiting, CHALLENGE_MAX_NS, None), None, "or is dropped");
}

#[test]
fn nothing_is_sealed_to_an_incarnation_while_the_reply_waits_by_which_it_can_be_opened() {
    let [mut a, mut b, _] = three();
    acquaint(&mut b, &mut a);
    let waiting = HelloQueue::new(&a.all);
    assert_eq!((a.all.known(), a.all.reached()), (0b10, 0b10));
    a.all.reply_waits(1);
    waiting.left(said(1, false, false));
    assert_eq!((a.all.known(), a.all.reached()), (0b10, 0), "a question is no reply");
    waiting.left(said(1, true, false));
    assert_eq!(a.all.reached(), 0b10);
}

#[test]
fn nothing_waits_for_a_reply_that_is_lost() {
    let [mut a, mut b, _] = three();
    acquaint(&mut b, &mut a);
    let gate = Gate::new(&a.all, [7; 32]);
    gate.waits(said(1, true, true), || false);
    assert_eq!(a.all.reached(), 0b10, "there was no room for it");
    gate.waits(said(1, true, true), || true);
    gate.waits(said(1, true, true), || false);
    assert_eq!(a.all.reached(), 0, "the first still waits");
    let mut waiting = HelloQueue::new(&a.all);
    waiting.put(0, said(1, true, true), &[1; HELLO_DATAGRAM_BYTES]);
    assert_eq!(next(&mut waiting, CHALLENGE_MAX_NS, None), None);
    assert_eq!(a.all.reached(), 0b10, "it was too old, and dropped");
}

#[test]
fn what_was_overheard_is_not_proven_afterwards() {
    let [mut a, mut b, _] = three();
    let hellos = [b.ask(0)];
    // What `a` says between its answer and the moment when `b` has it.
    let answer = a.greet(&hellos[0]).unwrap().1.unwrap();
    let between = [(); 3].map(|()| a.seal(Port::Time, 1, b"now").unwrap());
    assert!(overhears(&mut b, &between[1]).is_ok());
    let mut other = in_slots(Router::new(0, 101));
    let old = other.seal(Port::Time, 1, b"old").unwrap();
    assert!(overhears(&mut b, &old).is_ok(), "another incarnation meanwhile");
    let last_word = b.greet(&answer).unwrap().1.unwrap();
    a.greet(&last_word).unwrap();
    assert_eq!(b.all.incarnation(0), Some(100));
    for said in &between[..2] {
        assert_eq!(b.open(Port::Time, said), Err(Rejection::Replay.into()));
    }
    assert!(b.open(Port::Time, &between[2]).is_ok());
}

#[test]
fn what_is_forged_takes_nobodys_place() {
    let [mut a, _, _] = three();
    let said = a.seal(Port::Time, 1, b"now").unwrap();
    let (head, _) = FrameHead::read(&said).unwrap();
    let (mut overheard, peer) = (unverified::UnverifiedIncarnations::default(), Router::new(1, 200));
    let seal = |incarnation| {
        let from = keys::Endpoint { node: 0, incarnation };
        peer.all.keys.derive(0, &peer.all.binding(Port::Time, from, peer.all.own()))
    };
    assert!(overheard.open((&head, 0), &mut said.clone(), || seal(100)).is_some());
    for incarnation in 1..9 {
        let forged = FrameHead { incarnation, ..head };
        assert!(overheard.open((&forged, 0), &mut said.clone(), || seal(incarnation)).is_none());
    }
    let is_known = || panic!("its key is derived a second time");
    assert!(overheard.open((&head, 0), &mut said.clone(), is_known).is_some());
    assert_eq!((overheard.next(100), overheard.next(1)), (1, 0));
}
