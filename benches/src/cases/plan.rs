//! Ways for many robots: how long planning takes, and how much longer ways are than those of robots alone.

use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{End, Failure, OrFail, Placement, Scheduling, sample_in_child, settle};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use rohrpost_team::coordination::{Ways, plan_ways};
use std::time::{Duration, Instant};

// The maps that tests draw.
#[allow(dead_code, clippy::unwrap_used, reason = "it is the code of tests")]
#[path = "../../../modules/team/tests/ways/drawn.rs"]
mod drawn;

use drawn::Crossing;

const ROBOTS: usize = 64;
const SIDE: u32 = 32;
const PERCENT_WALLS: u64 = 20;
const MAPS: u64 = 200;
/// Of a quick run.
const FEW_MAPS: u64 = 2;
const LOOKS_MAX: u32 = 500;
/// Target of planning once, ms.
const TIME_MS: f64 = 50.0;
/// Target of steps to those of robots alone.
const STEPS: f64 = 1.3;
const PATIENCE: Duration = Duration::from_secs(120);
/// Between two plans.
const REST: Duration = Duration::from_millis(1);

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    let time = Case::new("ways of 64, 32 x 32, time", None, "ms", |settings, subject| {
        let contenders = [
            Contender::sampled("rohrpost", || times_ms(settings)),
            Contender::fixed("50 ms", Summary { p99: Some(TIME_MS), ..Summary::single(TIME_MS) })
                .beside(None, at_most(1.0)),
        ];
        Ok(compare(settings, subject, &contenders))
    });
    let steps = Case::new("ways of 64, 32 x 32, steps", None, "x alone", |settings, subject| {
        // Each round plans the same.
        let once = Settings { rounds: 1, ..settings.clone() };
        let contenders = [
            Contender::single("rohrpost", || steps(settings)),
            Contender::fixed("1.3 x alone", Summary::single(STEPS)).beside(at_most(1.0), None),
        ];
        Ok(compare(&once, subject, &contenders))
    });
    vec![time, steps]
}

fn crossings(settings: &Settings) -> impl Iterator<Item = (u64, Crossing)> {
    let maps = if settings.quick { FEW_MAPS } else { MAPS };
    (0..maps).map(|seed| (seed, Crossing::new(seed, SIDE, PERCENT_WALLS, ROBOTS)))
}

fn planned(seed: u64, Crossing { grid, trips, .. }: &Crossing) -> Result<Ways, Failure> {
    plan_ways(grid, &[], trips, LOOKS_MAX).or_fail(&format!("map {seed}"))
}

/// Time of each plan, ms.
fn times_ms(settings: &Settings) -> Result<Vec<f64>, Failure> {
    let crossings: Vec<_> = crossings(settings).collect();
    sample_in_child(PATIENCE, |samples| {
        settle(End::Ping, Placement::OneCore, Scheduling::Fifo)?;
        for (seed, crossing) in &crossings {
            let began = Instant::now();
            let ways = std::hint::black_box(planned(*seed, crossing)?);
            samples.push(began.elapsed().as_secs_f64() * 1e3);
            drop(ways);
            // A real-time process that never sleeps is killed.
            std::thread::sleep(REST);
        }
        Ok(())
    })
}

/// Steps of all plans, waiting included, to those of robots that are alone.
fn steps(settings: &Settings) -> Result<f64, Failure> {
    let (mut steps, mut alone) = (0, 0);
    for (seed, crossing) in crossings(settings) {
        steps += planned(seed, &crossing)?.steps();
        alone += crossing.alone();
    }
    Ok(steps as f64 / alone as f64)
}
