//! Single rules of the lease, without a network.

use rohrpost_supervision::lease::{
    ANSWER_BYTES, ASK_BYTES, Answer, Ask, BadTerms, CANDIDATES_MAX, Candidate, Fence, Fenced, LEASE_MAX_NS, Number,
    Terms, Wish, Witness,
};

fn terms() -> Terms {
    Terms::new(1_000, 100, 50, 0).expect("times that fit")
}

fn hold(place: u8, run: u32, asked_ns: u64) -> Ask {
    Ask { place, run, asked_ns, answered_ns: Some(asked_ns), wish: Wish::Hold }
}

fn granted(asked_ns: u64, count: u32) -> Answer {
    let newest = Number { witness: 9, count };
    Answer { run: 1, asked_ns, newest, holder: Some(0), granted_ns: Some(1_000) }
}

#[test]
fn times_that_do_not_fit_are_refused() {
    for (lease_ns, ask_every_ns, off_ns, error_ppm, bad, why) in [
        (0, 1, 0, 0, BadTerms::Lease(0), "no lease"),
        (LEASE_MAX_NS + 1, 1, 0, 0, BadTerms::Lease(LEASE_MAX_NS + 1), "a restarted witness would not wait for it"),
        (1_000, 100, 0, 100_001, BadTerms::RateError(100_001), "no clock"),
        (1_000, 0, 0, 0, BadTerms::Asks { held_ns: 1_000, ask_every_ns: 0 }, "all the time"),
        (1_000, 300, 200, 0, BadTerms::Asks { held_ns: 800, ask_every_ns: 300 }, "two lost questions end it"),
        (1_000, 1, 2_000, 0, BadTerms::Asks { held_ns: 0, ask_every_ns: 1 }, "it is never on"),
    ] {
        assert_eq!(Terms::new(lease_ns, ask_every_ns, off_ns, error_ppm), Err(bad), "{why}");
    }
}

#[test]
fn a_restarted_program_is_another_candidate() {
    let mut witness = Witness::new(0, terms(), 9);
    let now_ns = LEASE_MAX_NS;
    let first = witness.ask(now_ns, &hold(0, 1, 5)).unwrap();
    assert_eq!(first.granted_ns, Some(1_000));
    // The run before may be stopped, and still be on.
    assert_eq!(witness.ask(now_ns + 999, &hold(0, 2, 6)).unwrap().granted_ns, None);
    let second = witness.ask(now_ns + 1_000, &hold(0, 2, 7)).unwrap();
    assert_eq!((second.granted_ns, second.newest.count), (Some(1_000), first.newest.count + 1));
    let mut candidate = Candidate::new(terms(), 0, 2);
    candidate.set_ready(0, true);
    candidate.take(10, &granted(5, 1));
    assert_eq!(candidate.holds(10), None, "what the run before was granted");
}

#[test]
fn only_candidates_are_granted_anything() {
    let mut witness = Witness::new(0, terms(), 9);
    assert_eq!(witness.ask(LEASE_MAX_NS, &hold(CANDIDATES_MAX as u8, 1, 5)), None);
    let look = Ask { wish: Wish::Look, ..hold(0, 1, 6) };
    let answer = witness.ask(LEASE_MAX_NS, &look).unwrap();
    assert_eq!((answer.granted_ns, answer.holder, answer.newest), (None, None, Number { witness: 9, count: 0 }));
}

#[test]
fn an_answer_from_the_future_or_an_older_one_changes_nothing() {
    let mut candidate = Candidate::new(terms(), 0, 1);
    candidate.set_ready(0, true);
    candidate.take(10, &granted(11, 1));
    assert_eq!(candidate.until_ns(), None);
    candidate.take(300, &granted(200, 1));
    candidate.take(310, &granted(100, 1));
    assert_eq!(candidate.until_ns(), Some(1_150));
    let longer = Answer { granted_ns: Some(u64::MAX), ..granted(u64::MAX - 1, 2) };
    candidate.take(u64::MAX, &longer);
    assert_eq!(candidate.holds(u64::MAX), None, "no time is left");
}

#[test]
fn a_fence_asks_before_it_believes_another_witness() {
    let mut fence = Fence::new(1);
    let number = |witness, count| Number { witness, count };
    assert_eq!(fence.admit(number(7, 3)), Err(Fenced::Unconfirmed));
    let (old, new) = (fence.look(10), fence.look(11));
    let answer = |ask: &Ask, newest| Answer { run: ask.run, asked_ns: ask.asked_ns, newest, ..granted(0, 0) };
    assert!(!fence.take(&answer(&old, number(6, 9))));
    assert_eq!(fence.newest(), None, "only the last question counts");
    assert!(!fence.take(&answer(&Ask { run: 2, ..new }, number(6, 9))));
    assert_eq!(fence.newest(), None, "the question of another run");
    assert!(fence.take(&answer(&new, number(7, 3))));
    assert_eq!(fence.admit(number(7, 2)), Err(Fenced::Old { count: 2, newest: 3 }));
    assert_eq!((fence.admit(number(7, 3)), fence.admit(number(7, 4))), (Ok(()), Ok(())));
    assert_eq!(fence.admit(number(7, 3)), Err(Fenced::Old { count: 3, newest: 4 }));
}

#[test]
fn questions_and_answers_come_back_from_their_bytes_and_others_are_none() {
    for wish in [Wish::Hold, Wish::Release, Wish::Look] {
        for answered_ns in [None, Some(0), Some(u64::MAX - 1)] {
            let ask = Ask { place: 7, run: u32::MAX, asked_ns: 1 << 40, answered_ns, wish };
            assert_eq!(Ask::from_bytes(&ask.to_bytes()), Some(ask));
        }
    }
    for (holder, granted_ns) in [(None, None), (Some(0), Some(1)), (Some(7), Some(u64::MAX))] {
        let newest = Number { witness: 1 << 31, count: 3 };
        let answer = Answer { run: 5, asked_ns: u64::MAX, newest, holder, granted_ns };
        assert_eq!(Answer::from_bytes(&answer.to_bytes()), Some(answer));
    }
    assert!((0..ASK_BYTES + 2).all(|bytes| Ask::from_bytes(&[0; 30][..bytes]).is_none()), "no wish, or no length");
    assert!(
        [0, ANSWER_BYTES - 1, ANSWER_BYTES + 1].iter().all(|bytes| Answer::from_bytes(&[0; 40][..*bytes]).is_none())
    );
}
