//! The shortest cycle that there is.

use super::contest::{ALWAYS, Contest, Figure, WatchedContender};
use super::goals::Goal;
use super::plans::BRISK;
use super::slots::{OMITTED, UNLOADED};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::Failure;
use rohrpost_bench_local::rounds::{Row, Subject, at_most};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;

/// Nobody has to reach such a cycle.
const HOPED: (&str, Summary) = ("p99 25 us", Summary { p50: 25.0, p99: Some(25.0), p999: None, max: None });

const OMITTED_HOPED: Figure = Figure { goals: &[Goal { name: "hoped 0.5 %", most: 0.5 }], ..OMITTED };

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("cycle-1ms", None, "us", brisk)]
}

fn brisk(settings: &Settings, _: &Subject) -> Result<Vec<Row>, Failure> {
    let unloaded = WatchedContender::new(UNLOADED, BRISK, false).beside(&[[None; 2]]);
    let contest = Contest {
        case: "cycle-1ms",
        watched: vec![WatchedContender::new("loaded", BRISK, true), unloaded],
        with_goals: 1,
        bounds: vec![(HOPED.0, HOPED.1, [None, at_most(1.0)])],
        figures: [&[OMITTED_HOPED][..], &ALWAYS[..]].concat(),
    };
    Ok(contest.hold(settings).rows)
}
