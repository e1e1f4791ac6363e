//! Single rules as tables, then all of them together in the simulation.

use super::simulation::{Broken, Call, World};
use super::{CALLERS_MAX, Deduplicator, Fault, Name, Principal, Request, VALIDITY_MAX, Verdict};
use std::collections::BTreeMap;

const MS: u64 = 1_000_000;
const CALLER: Name = Name::new(1, 9, 0, 1);

fn request(sequence: u32) -> Request {
    Request {
        from: CALLER,
        principal: Principal::Unknown,
        incarnation: 7,
        sequence,
        valid_for_ns: 1000 * MS,
        age_ns: 0,
        repeat: false,
        redelivered: false,
        idempotent: false,
    }
}

/// Validates, and runs if it may.
fn serve(once: &mut Deduplicator, request: &Request, now_ns: u64) -> &'static str {
    let said = match once.validate(request, now_ns) {
        Verdict::Run => "run",
        Verdict::Again(..) => "again",
        Verdict::Ignore => "ignore",
        Verdict::Refuse(Fault::Interrupted) => "interrupted",
        Verdict::Refuse(Fault::Expired) => "expired",
        Verdict::Refuse(Fault::Busy) => "busy",
        Verdict::Refuse(Fault::EarlierIncarnation) => "earlier incarnation",
        Verdict::Refuse(other) => panic!("{other}"),
    };
    if said == "run" {
        once.done(request, now_ns, false, &request.sequence.to_le_bytes());
    }
    said
}

#[test]
fn what_another_server_may_have_run_before_this_one_took_over_is_interrupted() {
    let mut once = Deduplicator::new(0, &[]);
    once.takes_over(9_900 * MS);
    let repeat = |sequence, idempotent| Request { repeat: true, age_ns: 500 * MS, idempotent, ..request(sequence) };
    assert_eq!(serve(&mut once, &repeat(1, false), 10_000 * MS), "interrupted");
    assert_eq!(serve(&mut once, &repeat(2, true), 10_000 * MS), "run", "it may be run twice");
    assert_eq!(serve(&mut once, &request(3), 10_000 * MS), "run", "nobody has it tried before");
    assert_eq!(serve(&mut once, &repeat(4, false), 90_000 * MS), "run", "the first try was lost on its way here");
}

#[test]
fn what_was_run_is_not_run_again_whatever_its_order() {
    for first in [1, u32::MAX - 100] {
        let mut once = Deduplicator::new(0, &[]);
        // Backwards, then on: the answers that are kept are no longer those with the highest numbers.
        let backwards = (0..8).rev().map(|n| first.wrapping_add(n));
        let onwards = (8..300).map(|n| first.wrapping_add(n));
        let mut run = Vec::new();
        for sequence in backwards.chain(onwards) {
            assert_eq!(serve(&mut once, &request(sequence), 10_000 * MS), "run", "number {sequence} is new");
            run.push(sequence);
            for old in &run {
                let said = serve(&mut once, &request(*old), 10_000 * MS);
                assert!(matches!(said, "again" | "ignore"), "number {old} after {sequence}: {said}");
            }
        }
    }
}

#[test]
fn numbers_that_come_round_are_new_and_get_their_own_answers() {
    let answer = |once: &mut Deduplicator, sequence| match once.validate(&request(sequence), 0) {
        Verdict::Again(_, body) => body.to_vec(),
        other => panic!("{sequence}: {other:?}"),
    };
    for step in [1 << 31, 3 << 29] {
        let mut once = Deduplicator::new(0, &[]);
        for round in 0..4_u32 {
            let sequence = 7_u32.wrapping_add(round.wrapping_mul(step));
            // Half way round, both sides are equally far: what follows is new.
            assert_eq!(once.validate(&request(sequence), 0), Verdict::Run, "step {step}, round {round}");
            once.done(&request(sequence), 0, false, &round.to_le_bytes());
            assert_eq!(answer(&mut once, sequence), round.to_le_bytes(), "step {step}, round {round}");
        }
    }
}

#[test]
fn each_rule_decides_as_it_says() {
    let base = request(1);
    let day = 86_400_000 * MS;
    for (change, now_ns, says, why) in [
        (base, 0, "run", "a first try"),
        (Request { age_ns: 1000 * MS, ..base }, day, "run", "the edge of validity is inside"),
        (Request { age_ns: 1000 * MS + 1, ..base }, day, "expired", "too old, and surely not run"),
        (Request { age_ns: 1000 * MS + 1, repeat: true, ..base }, day, "ignore", "too old; was its first try run?"),
        (Request { age_ns: 900 * MS, ..base }, 100 * MS, "run", "waited in the mailbox for the restart"),
        (Request { age_ns: 900 * MS, repeat: true, ..base }, 100 * MS, "interrupted", "first tried before the start"),
        (Request { age_ns: 900 * MS, repeat: true, ..base }, 2899 * MS, "interrupted", "or so it may be, by the wire"),
        (
            Request { age_ns: 900 * MS, repeat: true, ..base },
            2901 * MS,
            "run",
            "surely first tried in this incarnation",
        ),
        (Request { age_ns: 900 * MS, repeat: true, idempotent: true, ..base }, 100 * MS, "run", "does no harm"),
        (Request { redelivered: true, ..base }, day, "interrupted", "somebody died with it in hand"),
        (Request { redelivered: true, idempotent: true, ..base }, day, "run", "does no harm"),
        (Request { age_ns: u64::MAX, valid_for_ns: u64::MAX, repeat: true, ..base }, day, "interrupted", "no overflow"),
    ] {
        assert_eq!(serve(&mut Deduplicator::new(0, &[]), &change, now_ns), says, "{why}");
    }
}

#[test]
fn an_earlier_incarnation_is_refused_until_it_cannot_matter_any_more() {
    let mut once = Deduplicator::new(0, &[]);
    let newer = Request { incarnation: 8, ..request(1) };
    assert_eq!(serve(&mut once, &request(1), 0), "run");
    assert_eq!(serve(&mut once, &newer, 0), "run", "numbers begin anew in a new incarnation");
    assert_eq!(serve(&mut once, &request(2), 3000 * MS), "earlier incarnation");
    assert_eq!(
        serve(&mut once, &request(2), 3001 * MS),
        "run",
        "the caller's clock was reset: its incarnations begin anew"
    );
    let far = request(3 + (1 << 31));
    assert_eq!(serve(&mut once, &far, 6000 * MS), "ignore", "looks old");
    assert_eq!(serve(&mut once, &far, 9000 * MS), "run", "so many calls to others in between");
}

#[test]
fn a_command_is_valid_for_a_minute_whatever_its_caller_says() {
    let base = Request { valid_for_ns: u64::MAX, ..request(1) };
    let valid_ns = VALIDITY_MAX.as_nanos() as u64;
    for (age_ns, says) in [(valid_ns, "run"), (valid_ns + 1, "expired")] {
        assert_eq!(serve(&mut Deduplicator::new(0, &[]), &Request { age_ns, ..base }, 0), says, "after {age_ns} ns");
    }
    // Nor is it remembered for longer: one principal takes its share of places, and loses them again.
    let mut once = Deduplicator::new(0, &[]);
    let caller = |n: usize| Request { from: Name::new(1, 16, n as u8, 1), ..base };
    let ran = (0..CALLERS_MAX).filter(|n| serve(&mut once, &caller(*n), 0) == "run").count();
    assert_eq!(ran, CALLERS_MAX / 2);
    let over_ns = valid_ns + 2000 * MS;
    assert_eq!(serve(&mut once, &caller(100), over_ns), "busy");
    assert_eq!(serve(&mut once, &caller(100), over_ns + 1), "run");
}

#[test]
fn memory_is_bounded_and_never_given_to_another_too_early() {
    let mut once = Deduplicator::new(0, &[]);
    // Each is of a principal of its own, but that nobody could fill all places else.
    let principal = |n: usize| Principal::Tools(n);
    let caller = |n: usize| Request { from: Name::new(1, 1, n as u8, 1), principal: principal(n), ..request(1) };
    for n in 0..CALLERS_MAX {
        assert_eq!(serve(&mut once, &caller(n), n as u64), "run");
    }
    assert_eq!(serve(&mut once, &caller(CALLERS_MAX), 3000 * MS), "busy");
    assert_eq!(serve(&mut once, &caller(CALLERS_MAX), 3000 * MS + 1), "run", "the first can have no repeats any more");
    assert_eq!(serve(&mut once, &caller(CALLERS_MAX + 1), 3000 * MS + 1), "busy", "the second still can");
    assert_eq!(once.callers.len(), CALLERS_MAX);
}

fn seeds(all: u64) -> std::ops::Range<u64> {
    match std::env::var("SIM_SEED").ok().and_then(|seed| seed.parse().ok()) {
        Some(seed) => seed..seed + 1,
        None => 0..all,
    }
}

#[test]
fn at_most_once_whatever_the_network_and_death_do() {
    let mut seen: BTreeMap<&str, u64> = BTreeMap::new();
    for seed in seeds(2000) {
        let world = World::new(seed, Broken::Nothing).run();
        let replay = "cargo test -p rohrpost-modules at_most_once";
        assert!(world.problems.is_empty(), "{:#?}\nreplay: SIM_SEED={seed} {replay}", world.problems);
        for (what, count) in world.seen {
            *seen.entry(what).or_default() += count;
        }
    }
    if std::env::var("SIM_SEED").is_err() {
        for what in ["run", "again", "interrupted", "expired", "busy", "ignored", "lives"] {
            assert!(seen.get(what).is_some_and(|count| *count > 500), "too few of `{what}` to prove much: {seen:?}");
        }
        let (calls, answered) = (seen["calls"], seen["answered"]);
        assert!(answered * 3 > calls, "{answered} of {calls} answered: it refuses what it should run: {seen:?}");
        assert!(seen["unknowable"] * 200 < calls, "the one thing nobody can tell is not that rare: {seen:?}");
    }
}

#[test]
fn the_simulation_notices_what_is_left_out() {
    for broken in [
        Broken::Forgets,
        Broken::NoBeforeStart,
        Broken::RunsRedelivered,
        Broken::NamesNobody,
        Broken::SharesByCaller,
        Broken::SharesNothing,
        Broken::BelievesValidity,
        Broken::TakesItsPlaceAgain,
    ] {
        let noticed = (0..500).find(|seed| !World::new(*seed, broken).run().problems.is_empty());
        assert!(noticed.is_some(), "{broken:?} went unnoticed");
    }
}

#[test]
fn without_loss_and_death_every_call_is_answered() {
    for seed in 0..200 {
        let mut world = World::new(seed, Broken::Nothing);
        (world.delay_max_ns, world.loss_percent, world.death_percent) = (0, 0, 0);
        let few = world.callers.len() < CALLERS_MAX;
        let world = world.run();
        let restarted = |call: &Call| world.callers[call.caller].0 != call.incarnation;
        // Those that are over before their turn comes are not meant.
        let meant = |call: &&Call| call.outcome.is_none() && !restarted(call) && call.valid_for_ns > 100 * MS;
        let lost = world.calls.iter().filter(meant).count();
        assert!(!few || lost == 0, "seed {seed}: {lost} calls without answer");
    }
}
