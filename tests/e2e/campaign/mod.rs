//! A campaign of faults against the supervised robot: whatever dies, hangs or lies, the robot moves towards nothing
//! that it touches, and its program has control again in time. Physics and referee are a process that no fault reaches.
//!
//! `cargo xtask campaign --runs 150 --seed 1` is a long one. A run that fails prints its seed and its faults.

mod fault;
mod observer;
mod stage;

use crate::harness::{times, until};
use fault::{Plan, Victim};
use observer::{Observer, SEEN_WITHIN};
use rohrpost_mailbox::monotonic_ns;
use rohrpost_testbed::stalls::{Late, Stalls, unless_stalled};
use stage::{PHYSICS_STEP, Refereed, Stage, Supervision, Times};
use std::cell::Cell;
use std::time::{Duration, Instant};

/// From a stall until a touch that it explains: after so long the robot would have stood.
const STOPPED_WITHIN: Duration = Duration::from_secs(2);

fn runs() -> std::ops::Range<u64> {
    let seed: u64 = times("ROHRPOST_CAMPAIGN_SEED", 0);
    seed..seed + times("ROHRPOST_CAMPAIGN_RUNS", 10)
}

/// What is late, unless a stall of a processor explains it.
fn in_time(what: &str, since: Instant, at: Instant, within: Duration) -> Result<(), Late> {
    let took = at.saturating_duration_since(since);
    if took <= within {
        return Ok(());
    }
    let what = format!("{what} after {took:?}, not within {within:?}");
    Err(Late { what, since, until: at, by: took - within })
}

#[test]
fn whatever_fails_the_robot_touches_nothing_and_its_program_regains_control() {
    let way_m = Cell::new(0.0);
    for seed in runs() {
        unless_stalled(|stalls| {
            let plan = Plan::draw(seed);
            println!("{plan}");
            let way = supervised(plan, stalls)?;
            way_m.set(way_m.get() + way);
            Ok(())
        });
    }
    let count = runs().count() as f64;
    println!("{count} runs, 0 touches that count against the robot, {:.1} m driven", way_m.get());
    // A single run may end where it began.
    assert!(way_m.get() > 0.2 * count || count < 10.0, "the robot hardly drives: {:.1} m", way_m.get());
}

/// One run; the way that the robot made, metres.
fn supervised(mut plan: Plan, stalls: &Stalls) -> Result<f64, Late> {
    let Some(mut stage) = Stage::begin(&mut plan, Supervision::Wormhole) else { return Ok(0.0) };
    let times = stage.times();
    let observer = Observer::begin(&stage);
    until("the program drives", || observer.now().is_some_and(|(_, has_control)| has_control));
    let began = Instant::now();
    let mut injected = Vec::new();
    let mut restarted = Vec::new();
    for (at, fault) in &plan.faults {
        until("the fault's time", || began.elapsed() >= *at);
        if matches!(fault.victim(), Victim::Launch | Victim::Network) {
            restarted.extend(stage.restarted());
        }
        let since = Instant::now();
        stage.inject(*fault);
        injected.push((since, Instant::now(), *fault));
    }
    let first = injected[0].0;
    // The first of a pair may have made a longer promise than the second one ends.
    let longest = injected.iter().filter_map(|(_, _, fault)| fault.lost_within(&times)).max();
    for (_, since, fault) in &injected {
        if let Some(within) = fault.lost_within(&times).and(longest) {
            let limit = within + times.start;
            let lost = stalls.wait(&format!("control is lost ({fault})"), limit, || observer.first(first, false));
            in_time(&format!("{fault}: control was lost"), *since, lost, within + SEEN_WITHIN)?;
        }
    }
    let mut repaired = first;
    for (_, since, fault) in injected.iter().rev() {
        until("its time is over", || since.elapsed() >= fault.lasts(&times));
        repaired = stage.repair(*fault);
    }
    let within: Duration = injected.iter().map(|(_, _, fault)| fault.regained_within(&times)).sum();
    let regained = stalls.wait("control is regained", 2 * within, || regained(&observer, repaired));
    in_time("control was regained", repaired, regained, within + SEEN_WITHIN)?;
    restarted.extend(stage.restarted());
    restarted.dedup();
    assert_causes(&plan, &restarted);
    drop(observer);
    refereed(stage.end(), &times, stalls)
}

/// Since when the program has control, for so long that it is not a remainder from before.
fn regained(observer: &Observer, since: Instant) -> Option<Instant> {
    const STEADY: Duration = Duration::from_millis(300);
    let (at, _) = observer.now().filter(|(at, has_control)| *has_control && at.elapsed() > STEADY)?;
    (since.elapsed() > STEADY).then(|| at.max(since))
}

/// Each restart of the program has one cause, and each cause that needs one has one restart.
fn assert_causes(plan: &Plan, restarted: &[String]) {
    let of_all = plan.faults.iter().map(|(_, fault)| fault.restarts());
    let (least, most) = of_all.fold((0, 0), |(least, most), one| (least + one.start(), most + one.end()));
    // With a second fault the first may be over before it is noticed.
    let least = if plan.is_pair() { 0 } else { least };
    let count = restarted.len() as u32;
    assert!((least..=most).contains(&count), "{count} restarts, {least} to {most} causes: {restarted:#?}");
}

/// Nothing counts against the robot, unless the computer stood still for longer than the wormhole counts on.
fn refereed(refereed: Refereed, times: &Times, stalls: &Stalls) -> Result<f64, Late> {
    let Refereed { report, touches, is_clean } = refereed;
    assert_eq!(is_clean, report.counted == 0, "its exit code and its list agree: {report:?}");
    if let Some(touch) = touches.iter().find(|touch| touch.is_towards) {
        let until = Instant::now() - Duration::from_nanos(monotonic_ns().saturating_sub(touch.at_ns));
        let late = Late { what: format!("{touch:?}"), since: until - STOPPED_WITHIN, until, by: times.late };
        assert!(stalls.stalled(late.since, late.until) >= late.by, "the robot drove against something: {touch:?}");
        return Err(late);
    }
    // Also without a touch: in another place there would have been one.
    let (went_on, most) = (Duration::from_nanos(report.went_on_ns), times.look + PHYSICS_STEP);
    assert!(went_on <= most, "the wheels went on for {went_on:?} after a command, not for {most:?} at most");
    Ok(report.way_m)
}

/// What the campaign does, done to a robot without a wormhole at the same times.
#[test]
fn without_the_wormhole_the_same_faults_let_the_robot_touch() {
    let mut counted = 0;
    let plans = runs().map(Plan::draw).filter(|plan| !plan.has(Victim::Network));
    // In a short campaign only some of those in which the program drives at full speed.
    let (wild, most) = if runs().count() > 10 { (false, usize::MAX) } else { (true, 2) };
    for mut plan in plans.filter(|plan| !wild || plan.drives_on()).take(most) {
        let Some(mut stage) = Stage::begin(&mut plan, Supervision::Bare) else { return };
        let began = Instant::now();
        for (at, fault) in &plan.faults {
            until("the fault's time", || began.elapsed() >= *at);
            stage.inject(*fault);
        }
        let last = Instant::now();
        until("its time is over", || last.elapsed() >= Duration::from_secs(4));
        for (_, fault) in plan.faults.iter().rev() {
            stage.repair(*fault);
        }
        let refereed = stage.end();
        println!("without the wormhole, {plan}: {} touches", refereed.report.counted);
        counted += refereed.report.counted;
    }
    assert!(counted > 0 || runs().count() < 10, "nothing was touched: the faults are too weak to show anything");
}
