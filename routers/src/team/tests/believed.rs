//! Which incarnations are believed, and what of them is taken.

use super::*;

#[test]
fn systems_that_share_a_key_believe_each_other_after_two_beats() {
    let (mut one, mut two) = (End::new(1, 11, Some(1)), End::new(2, 22, Some(1)));
    let early = one.data(ALL_SYSTEMS, b"early");
    two.take(0, &early);
    assert_eq!((two.bodies().len(), two.refused(TeamRefusal::Unproven)), (0, 1));
    let first = one.beat(0).unwrap();
    two.take(MS, &first);
    assert!(!two.mate().is_proven, "a beat alone may be a replay");
    let answer = two.beat(MS).unwrap();
    one.take(2 * MS, &answer);
    assert!(one.mate().is_proven && one.mate().hears_us, "it repeats the challenge of this incarnation");
    let second = one.beat(300 * MS).expect("somebody new was heard: it hurries");
    two.take(300 * MS, &second);
    assert!(two.mate().is_proven && two.mate().hears_us);
    let now = one.data(ALL_SYSTEMS, b"now");
    two.take(300 * MS, &now);
    two.take(300 * MS, &now);
    two.take(300 * MS, &early);
    assert_eq!(two.bodies(), [b"now"], "once, and nothing from before the proof");
    assert_eq!(two.refused(TeamRefusal::Duplicate), 2);
}

#[test]
fn another_key_none_and_one_too_many_open_nothing() {
    for (ours, theirs, why) in [
        (Some(1), Some(2), TeamRefusal::Unsealed),
        (Some(1), None, TeamRefusal::Unsealed),
        (None, Some(1), TeamRefusal::Sealed),
    ] {
        let (mut one, mut two) = (End::new(1, 11, ours), End::new(2, 22, theirs));
        meet(0, &mut [&mut one, &mut two]);
        let data = two.data(ALL_SYSTEMS, b"data");
        one.take(5 * SECOND, &data);
        assert!(one.router.teammates().is_empty() && one.bodies().is_empty(), "{why:?}");
        assert!(one.refused(why) > 0, "{why:?}");
    }
}

#[test]
fn where_nothing_is_sealed_each_is_believed_at_once() {
    let (mut one, mut two) = (End::new(1, 11, None), End::new(2, 22, None));
    let data = two.data(1, b"data");
    one.take(0, &data);
    one.take(0, &data);
    assert_eq!((one.bodies(), one.refused(TeamRefusal::Duplicate)), (vec![&b"data"[..]], 1));
    let next = End::new(2, 23, None).data(1, b"next");
    one.take(MS, &next);
    assert_eq!((one.bodies().len(), one.mate().incarnations), (2, 2), "its next incarnation");
    let late = two.data(1, b"late");
    one.take(2 * MS, &late);
    assert_eq!((one.bodies().len(), one.refused(TeamRefusal::Ended)), (2, 1), "what was delayed flips nothing");
    let back = two.data(1, b"back");
    one.take(9 * SECOND, &back);
    assert_eq!((one.bodies().len(), one.mate().returns), (3, 1), "two computers with one name are told");
}

#[test]
fn nothing_that_was_recorded_is_taken_by_another_incarnation_of_either_end() {
    let (mut one, mut two) = (End::new(1, 11, Some(1)), End::new(2, 22, Some(1)));
    let mut recorded = Vec::new();
    for step in 0..30 {
        let now_ns = step * 200 * MS;
        for (from, to) in [(true, false), (false, true)] {
            let end = if from { &mut two } else { &mut one };
            let said = end.beat(now_ns).into_iter().chain([end.data(ALL_SYSTEMS, b"data")]);
            for datagram in said.collect::<Vec<_>>() {
                if to { &mut two } else { &mut one }.take(now_ns, &datagram);
                recorded.push(datagram);
            }
        }
    }
    assert!(one.bodies().len() > 20, "they met: {}", one.bodies().len());
    // A restarted router hears all of it again, forwards and backwards, and answers.
    let mut restarted = End::new(1, 12, Some(1));
    for (step, datagram) in recorded.iter().chain(recorded.iter().rev()).enumerate() {
        restarted.take(10 * SECOND + step as u64 * 50 * MS, datagram);
        restarted.beat(10 * SECOND + step as u64 * 50 * MS);
    }
    assert!(restarted.bodies().is_empty() && restarted.router.teammates().iter().all(|mate| !mate.is_proven));
    // The end that goes on takes nothing twice, also after the other's next incarnation was heard.
    let taken = one.bodies().len();
    let mut next = End::new(2, 23, Some(1));
    let now_ns = meet(7 * SECOND, &mut [&mut one, &mut next]);
    assert_eq!(one.mate().incarnations, 2);
    recorded.iter().for_each(|datagram| one.take(now_ns, datagram));
    assert_eq!((one.bodies().len(), one.mate().incarnations, one.mate().returns), (taken, 2, 0));
}

#[test]
fn the_old_proof_of_an_ended_incarnation_proves_nothing_while_its_challenge_still_holds() {
    let (mut one, mut two) = (End::new(1, 11, Some(1)), End::new(2, 22, Some(1)));
    let first = two.beat(0).unwrap();
    one.take(0, &first);
    let ours = one.beat(MS).unwrap();
    two.take(MS, &ours);
    let proof = two.beat(300 * MS).unwrap();
    one.take(300 * MS, &proof);
    let data = two.data(1, b"data");
    one.take(310 * MS, &data);
    let mut next = End::new(2, 23, Some(1));
    meet(400 * MS, &mut [&mut one, &mut next]);
    assert_eq!(one.mate().incarnations, 2);
    for datagram in [&first, &proof, &data] {
        one.take(2 * SECOND, datagram);
    }
    assert_eq!((one.bodies().len(), one.mate().incarnations), (1, 2));
}

#[test]
fn three_systems_meet_and_loss_is_what_was_lost() {
    let mut ends = [1, 2, 3].map(|system| End::new(system, 10 + u64::from(system), Some(1)));
    let [one, two, three] = &mut ends;
    let now_ns = meet(0, &mut [one, two, three]);
    for end in [&*one, two, three] {
        assert!(end.router.teammates().iter().all(|mate| mate.is_proven && mate.hears_us));
        assert_eq!(end.router.teammates().len(), 2);
    }
    let before = two.router.teammates()[0];
    for number in 0..100 {
        let data = one.data(ALL_SYSTEMS, b"data");
        if number % 4 != 0 {
            two.take(now_ns, &data);
        }
    }
    let beat = one.beat(now_ns + 3 * SECOND).unwrap();
    two.take(now_ns + 3 * SECOND, &beat);
    let after = two.router.teammates()[0];
    assert_eq!((after.sent - before.sent, after.lost - before.lost), (101, 25));
}

#[test]
fn one_direction_alone_proves_nothing_and_is_shown() {
    let (mut one, mut two) = (End::new(1, 11, Some(1)), End::new(2, 22, Some(1)));
    for step in 0..50 {
        if let Some(beat) = one.beat(step * 500 * MS) {
            two.take(step * 500 * MS, &beat);
        }
    }
    assert!(!two.mate().is_proven && one.router.teammates().is_empty());
    let now_ns = meet(25 * SECOND, &mut [&mut one, &mut two]);
    // Once proved it goes on, whether the other end still hears it or not.
    for step in 0..100 {
        let beat = one.beat(now_ns + step * SECOND);
        beat.iter().for_each(|beat| two.take(now_ns + step * SECOND, beat));
    }
    let data = one.data(2, b"data");
    two.take(now_ns + 100 * SECOND, &data);
    assert_eq!((two.bodies().len(), two.mate().hears_us), (1, false));
}
