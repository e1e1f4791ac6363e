//! How lives begin, and how they do not.

use super::*;

#[test]
fn two_that_never_met_know_each_other_after_question_answer_and_last_word() {
    let (mut a, mut b) = (Router::new(0, 100), Router::new(1, 200));
    assert_eq!(a.seal(Port::Packages, 1, b"too early"), Err(NoSession));
    let question = a.ask(1);
    let (began, answer) = b.greet(&question).unwrap();
    assert!(!began && b.all.incarnation(0).is_none(), "a question proves nothing");
    let (began, last_word) = a.greet(&answer.unwrap()).unwrap();
    assert!(began && a.all.incarnation(1) == Some(200));
    assert_eq!(b.greet(&last_word.unwrap()), Ok((true, None)), "and there it ends");
    assert_eq!(b.all.incarnation(0), Some(100));
    for port in [Port::Packages, Port::Time] {
        let there = a.seal(port, 1, b"there").unwrap();
        assert_eq!(b.open(port, &there).unwrap().1, b"there");
        let back = b.seal(port, 0, b"back").unwrap();
        assert_eq!(a.open(port, &back).unwrap().1, b"back");
    }
}

#[test]
fn whichever_hellos_are_lost_asking_again_joins_them() {
    // Both ask in each round; of what is said, the bits tell what is lost, until the last rounds, in which nothing is.
    for lost in 0..1 << 10_u32 {
        let (mut a, mut b) = (Router::new(0, 100), Router::new(1, 200));
        let (mut said, mut joined) = (0, false);
        for round in 0..8 {
            let mut wire = vec![(true, a.ask(1)), (false, b.ask(0))];
            while let Some((is_for_b, hello)) = wire.pop() {
                said += 1;
                if round < 5 && said <= 10 && lost >> (said - 1) & 1 == 1 {
                    continue;
                }
                let to = if is_for_b { &mut b } else { &mut a };
                wire.extend(to.greet(&hello).unwrap().1.map(|answer| (!is_for_b, answer)));
            }
            let (there, back) = (a.seal(Port::Packages, 1, b"there"), b.seal(Port::Packages, 0, b"back"));
            joined = there.is_ok_and(|there| b.open(Port::Packages, &there).is_ok())
                && back.is_ok_and(|back| a.open(Port::Packages, &back).is_ok());
        }
        assert!(joined, "lost: {lost:010b}");
    }
}

#[test]
fn a_router_that_was_started_anew_is_known_after_it_has_asked() {
    let (mut a, mut b) = pair();
    let old = a.seal(Port::Packages, 1, b"of the old incarnation").unwrap();
    let mut a = Router::new(0, 101);
    acquaint(&mut a, &mut b);
    assert_eq!(b.all.incarnation(0), Some(101));
    assert_eq!(b.open(Port::Packages, &old), Err(Rejection::OtherIncarnation.into()), "it came too late");
    let new = a.seal(Port::Packages, 1, b"of the new").unwrap();
    assert_eq!(b.open(Port::Packages, &new).unwrap().1, b"of the new");
}

#[test]
fn until_the_new_incarnation_has_answered_the_old_one_is_heard() {
    let (mut a, mut b) = pair();
    let hello = Router::new(0, 101).ask(1);
    assert!(!b.greet(&hello).unwrap().0);
    let still = a.seal(Port::Packages, 1, b"still here").unwrap();
    assert!(b.open(Port::Packages, &still).is_ok());
}

/// All hellos that ever were, said again to a router that lives, begin nothing and end nothing.
#[test]
fn only_a_living_incarnation_begins() {
    let mut kept = Vec::new();
    let mut b = Router::new(1, 200);
    for incarnation in 0..40 {
        let mut a = Router::new(0, 100 + incarnation);
        kept.extend(acquaint(&mut a, &mut b));
    }
    // B itself begins anew as well, and A once more.
    let (mut a, mut b) = (Router::new(0, 300), Router::new(1, 400));
    kept.extend(acquaint(&mut a, &mut b));
    let challenge = b.all.challenge(0);
    for hello in &kept {
        if let Ok((began, _)) = b.greet(hello) {
            assert!(!began, "an incarnation began by what was recorded");
        }
    }
    assert_eq!((b.all.incarnation(0), b.all.challenge(0)), (Some(300), challenge));
    let still = a.seal(Port::Packages, 1, b"still here").unwrap();
    assert!(b.open(Port::Packages, &still).is_ok());
}

#[test]
fn a_response_serves_once_and_only_its_receiver() {
    let (mut a, mut b) = (Router::new(0, 100), Router::new(1, 200));
    let answer = b.greet(&a.ask(1)).unwrap().1.unwrap();
    let mut other = Router::new(0, 101);
    assert_eq!(other.greet(&answer), Ok((false, None)), "the challenge was another incarnation's");
    assert!(a.greet(&answer).unwrap().0);
    assert_eq!(a.greet(&answer), Ok((false, None)));
    // Said again after the incarnation that it began has ended.
    let mut next = Router::new(1, 201);
    acquaint(&mut next, &mut a);
    assert_eq!((a.greet(&answer), a.all.incarnation(1)), (Ok((false, None)), Some(201)));
}

#[test]
fn an_incarnation_that_comes_back_is_heard_from_where_it_is_now() {
    let (mut a, mut b) = pair();
    let taken = a.seal(Port::Packages, 1, b"taken").unwrap();
    let kept_back = a.seal(Port::Packages, 1, b"kept back").unwrap();
    b.open(Port::Packages, &taken).unwrap();
    acquaint(&mut Router::new(0, 101), &mut b);
    assert_eq!(b.open(Port::Packages, &kept_back), Err(Rejection::OtherIncarnation.into()));
    // The first was only frozen, and is there again.
    acquaint(&mut a, &mut b);
    assert_eq!(b.all.incarnation(0), Some(100));
    for old in [&taken, &kept_back] {
        assert_eq!(b.open(Port::Packages, old), Err(Rejection::Replay.into()), "from before it came back");
    }
    let now = a.seal(Port::Packages, 1, b"now").unwrap();
    assert!(b.open(Port::Packages, &now).is_ok());
}

#[test]
fn keys_are_changed_node_by_node_without_a_gap() {
    for (of_a, of_b, knows) in [
        (&[1][..], &[1][..], true),
        (&[2, 1], &[1], true),
        (&[1], &[2, 1], true),
        (&[2, 1], &[2, 1], true),
        (&[2], &[2, 1], true),
        (&[2, 1], &[2], true),
        (&[2], &[2], true),
        (&[1], &[2], false),
    ] {
        let (mut a, mut b) = (Router::with_keys(0, 100, ring(of_a)), Router::with_keys(1, 200, ring(of_b)));
        let mut why = None;
        // Two questions: one with each key.
        for _ in 0..2 {
            let (mut hello, mut is_for_b) = (Some(a.ask(1)), true);
            while let Some(said) = hello.take() {
                match if is_for_b { &mut b } else { &mut a }.greet(&said) {
                    Ok((_, answer)) => hello = answer,
                    Err(rejected) => why = Some(rejected),
                }
                is_for_b = !is_for_b;
            }
        }
        let there = a.seal(Port::Packages, 1, b"there");
        let came = there.is_ok_and(|there| b.open(Port::Packages, &there).is_ok());
        let back = b.seal(Port::Packages, 0, b"back");
        let went = back.is_ok_and(|back| a.open(Port::Packages, &back).is_ok());
        assert_eq!((came, went), (knows, knows), "{of_a:?}, {of_b:?}");
        assert!(knows || why == Some(Rejection::OtherKey.into()));
    }
}

#[test]
fn each_peer_is_asked_with_each_key_in_turn() {
    let a = Router::with_keys(0, 100, ring(&[2, 1]));
    let asked: Vec<_> = [1, 2, 1, 2].map(|peer| (peer, a.ask(peer)[7])).into();
    assert_eq!(asked, [(1, 2), (2, 2), (1, 1), (2, 1)]);
}

#[test]
fn two_that_asked_at_once_with_different_keys_take_what_either_seals() {
    let (mut a, mut b) = (Router::with_keys(0, 100, ring(&[2, 1])), Router::with_keys(1, 200, ring(&[2, 1])));
    let _ = b.ask(0);
    let (of_a, of_b) = (a.ask(1), b.ask(0));
    assert_ne!(of_a[7], of_b[7]);
    let (to_a, to_b) = (b.greet(&of_a).unwrap().1.unwrap(), a.greet(&of_b).unwrap().1.unwrap());
    a.greet(&to_a).unwrap();
    b.greet(&to_b).unwrap();
    let (there, back) = (a.seal(Port::Packages, 1, b"x").unwrap(), b.seal(Port::Packages, 0, b"x").unwrap());
    assert_ne!(there[7], back[7]);
    assert!(b.open(Port::Packages, &there).is_ok() && a.open(Port::Packages, &back).is_ok());
}

#[test]
fn recorded_questions_cost_a_bounded_number_of_answers() {
    let (a, mut b) = pair();
    let question = a.ask(1);
    let mut answer_at = |now_ns| {
        let (mut datagram, mut room) = (question.clone(), [0; HELLO_DATAGRAM_BYTES]);
        let Ok(Opened::Hello(head, hello)) = b.opening[0].open(&mut datagram) else { panic!() };
        b.handshake.receive(now_ns, &head, &hello, &mut room).reply_bytes.is_some()
    };
    let mut answered_in = |from_ns: u64| (0..1000).filter(|later| answer_at(from_ns + later)).count();
    assert_eq!(answered_in(PER_NS), ANSWERS_MAX as usize);
    assert_eq!(answered_in(PER_NS + 1000), 0);
    assert!((1..=ANSWERS_MAX as usize).contains(&answered_in(2 * PER_NS)), "then again");
    assert_eq!(answered_in(10 * PER_NS), ANSWERS_MAX as usize, "after a pause, too");
}

#[test]
fn an_answer_that_is_kept_back_begins_nothing() {
    for (after_ns, begins) in [(CHALLENGE_MAX_NS - 1, true), (CHALLENGE_MAX_NS, false), (3 * CHALLENGE_MAX_NS, false)] {
        let (mut a, mut b) = (Router::new(0, 100), Router::new(1, 200));
        let answer = a.greet(&b.ask(0)).unwrap().1.unwrap();
        // A knows B; its last word is kept back as well.
        let of_b = b.greet(&a.ask(1)).unwrap().1.unwrap();
        let last_word = a.greet(&of_b).unwrap().1.unwrap();
        let command = a.seal(Port::Packages, 1, b"a command").unwrap();
        // That incarnation ends, and only then B gets what it said.
        drop(a);
        for kept in [&answer, &last_word] {
            assert_eq!(b.greet_at(after_ns, kept).unwrap().0, begins && kept == &answer, "after {after_ns} ns");
        }
        assert_eq!(b.open(Port::Packages, &command).is_ok(), begins);
    }
}

#[test]
fn nothing_is_sealed_to_an_incarnation_before_the_last_word_has_left() {
    let (mut a, mut b) = (Router::new(0, 100), Router::new(1, 200));
    let mut answer = b.greet(&a.ask(1)).unwrap().1.unwrap();
    let mut room = [0; HELLO_DATAGRAM_BYTES];
    let Ok(Opened::Hello(head, hello)) = a.opening[0].open(&mut answer) else { panic!() };
    let greeted = a.handshake.receive(0, &head, &hello, &mut room);
    assert!(greeted.begins && greeted.reply_bytes.is_some());
    assert_eq!((a.all.known(), a.seal(Port::Packages, 1, b"too early")), (0, Err(NoSession)));
    assert_eq!((a.handshake.begin(), a.all.known()), (Some(1), 0b10));
    let first = a.seal(Port::Packages, 1, b"first").unwrap();
    b.greet(&room).unwrap();
    assert!(b.open(Port::Packages, &first).is_ok());
}

#[test]
fn hellos_are_counted_for_each_peer() {
    let a = Router::new(0, 100);
    let number = |peer| FrameHead::read(&a.ask(peer)).unwrap().0.sequence;
    assert_eq!([1, 1, 1, 2, 2, 1].map(number), [0, 1, 2, 0, 1, 3]);
}

#[test]
#[should_panic(expected = "2^32 hellos")]
fn an_incarnation_that_has_said_all_its_hellos_ends() {
    let a = Router::new(0, 100);
    a.all.has_said(1, u32::MAX.into());
    assert_eq!(FrameHead::read(&a.ask(1)).unwrap().0.sequence, u64::from(u32::MAX), "the last one");
    a.ask(1);
}

#[test]
fn replayed_challenges_do_not_keep_a_living_peer_from_its_response() {
    let (mut a, mut b) = (Router::new(0, 100), Router::new(1, 200));
    let recorded = Router::new(0, 99).ask(1);
    for _ in 0..1000 {
        b.greet(&recorded).unwrap();
    }
    assert_eq!(b.greet(&recorded), Ok((false, None)), "enough were answered");
    let answer = a.greet(&b.ask(0)).unwrap().1.unwrap();
    let (began, last_word) = b.greet(&answer).unwrap();
    assert!(began && last_word.is_some_and(|last_word| a.greet(&last_word).unwrap().0));
}

#[test]
fn of_many_questions_not_the_first_alone_are_answered() {
    let mut b = Router::new(1, 200);
    let question = Router::new(0, 100).ask(1);
    // Of each time, where in it the answered ones lie.
    let mut answered = |time: u64| -> Vec<u64> {
        let came = (0..1000).map(|n| (n, time * PER_NS + n));
        came.filter(|(_, now_ns)| b.greet_at(*now_ns, &question).unwrap().1.is_some()).map(|(n, _)| n).collect()
    };
    assert_eq!(answered(1), (0..u64::from(ANSWERS_MAX)).collect::<Vec<_>>(), "as long as nobody knows of a flood");
    let later: Vec<_> = (2..42).flat_map(answered).collect();
    assert!(later.len() <= 40 * ANSWERS_MAX as usize);
    for quarter in 0..4 {
        assert!(later.iter().any(|n| n / 250 == quarter), "{later:?}");
    }
}
