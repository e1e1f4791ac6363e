//! Hundreds of simulated networks, and the same with a mistake switched on: `ROHRPOST_SIM_SEEDS=10000` for more of them,
//! `ROHRPOST_SIM_SEED=n` to see one line by line.

use rohrpost_modules::call::{Fault, Once, Request, Verdict};
use rohrpost_routers::broken::Broken;
use rohrpost_routers::sim::calls::{Attempt, Guard, Ruling};
use rohrpost_routers::sim::plan::Plan;
use rohrpost_routers::sim::run::{Mistake, Outcome, run, run_broken};
use rohrpost_routers::time;
use std::collections::BTreeMap;

/// Networks without being asked for more.
const SEEDS: u64 = 400;
const REPLAY: &str = "cargo test -p rohrpost-routers --test simulation networks -- --nocapture";

/// The real guard of commands.
struct RealGuard(Once);

fn request(attempt: &Attempt) -> Request {
    Request {
        from: attempt.from,
        incarnation: attempt.incarnation,
        sequence: attempt.sequence,
        valid_for_ns: attempt.valid_for_ns,
        age_ns: attempt.age_ns,
        repeat: attempt.repeat,
        redelivered: attempt.redelivered,
        idempotent: false,
    }
}

impl Guard for RealGuard {
    fn judge(&mut self, attempt: &Attempt, now_ns: u64) -> Ruling {
        match self.0.judge(&request(attempt), now_ns) {
            Verdict::Run => Ruling::Run,
            Verdict::Again(_, body) => Ruling::Again(body.iter().fold(0, |run, byte| run << 8 | u32::from(*byte))),
            Verdict::Refuse(Fault::Interrupted) => Ruling::Interrupted,
            Verdict::Refuse(_) => Ruling::Refuse,
            Verdict::Ignore => Ruling::Ignore,
        }
    }

    fn done(&mut self, attempt: &Attempt, now_ns: u64, run: u32) {
        self.0.done(&request(attempt), now_ns, false, &run.to_be_bytes());
    }
}

fn guard(started_ns: u64) -> Box<dyn Guard> {
    Box::new(RealGuard(Once::new(started_ns)))
}

fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok()?.parse().ok()
}

fn simulate(seed: u64) -> Outcome {
    run(Plan::new(seed), guard, false)
}

/// Ends the test with what it takes to see a seed again.
fn fail(seed: u64, outcome: &Outcome) -> ! {
    panic!("seed {seed}: {:#?}\nreplay: ROHRPOST_SIM_SEED={seed} {REPLAY}", outcome.problems);
}

#[test]
fn networks_keep_their_promises() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        let plan = Plan::new(seed);
        eprintln!("{plan:#?}");
        let outcome = run(plan, guard, true);
        outcome.trace.iter().for_each(|line| eprintln!("{line}"));
        eprintln!("{:#?}", outcome.seen);
        if !outcome.problems.is_empty() {
            fail(seed, &outcome);
        }
        return;
    }
    let mut seen: BTreeMap<&str, u64> = BTreeMap::new();
    let mut bad = Vec::new();
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS);
    for seed in 0..seeds {
        let t = std::time::Instant::now();
        let outcome = simulate(seed);
        let d = t.elapsed();
        if d.as_millis() > 200 {
            eprintln!("seed {seed} {} nodes {d:?} {:?}", Plan::new(seed).nodes.len(), outcome.seen["accepted"]);
        }
        if !outcome.problems.is_empty() {
            eprintln!("seed {seed}: {:?}", outcome.problems[0]);
            bad.push(seed);
        }
        outcome.seen.iter().for_each(|(what, count)| *seen.entry(what).or_default() += count);
    }
    eprintln!("{seen:#?}");
    eprintln!("{} of {seeds} bad: {bad:?}", bad.len());
}

#[test]
fn mistakes_are_noticed() {
    let packages = Broken::ALL.into_iter().map(Mistake::Packages);
    let time = time::Broken::ALL.into_iter().map(Mistake::Time);
    for mistake in packages.chain(time) {
        let t = std::time::Instant::now();
        let noticed = (0..number("SEEDS").unwrap_or(100)).find_map(|seed| {
            let outcome = run_broken(Plan::new(seed), guard, mistake);
            outcome.problems.first().map(|problem| (seed, problem.promise, problem.text.clone()))
        });
        eprintln!("{mistake:?} {noticed:?} {:?}", t.elapsed());
    }
}
