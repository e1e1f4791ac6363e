//! The shortest cycle that there is.

use super::contest::{ALWAYS, Contest, Figure, WatchedContender};
use super::goals::Goal;
use super::observed::RunConditions;
use super::plans::BRISK;
use super::slots::{OMITTED, UNLOADED};
use crate::tdma::rights::Rights;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::Failure;
use rohrpost_bench_local::rounds::{Row, Target, Versus};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;

/// Nobody has to reach such a cycle.
const HOPED: (&str, Summary) = ("p99 25 us", Summary { p50: 25.0, p99: Some(25.0), p999: None, max: None });

const OMITTED_HOPED: Figure = Figure { goals: &[Goal { name: "hoped 0.5 %", most: 0.5 }], ..OMITTED };

pub(super) fn cases() -> Vec<Box<dyn Case>> {
    vec![Box::new(Brisk)]
}

struct Brisk;

impl Case for Brisk {
    fn name(&self) -> String {
        "cycle-1ms".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let watched = |contender, loaded| WatchedContender {
            contender,
            plan: BRISK,
            way: RunConditions { rights: Rights::RealTime, loaded, junk: false },
        };
        let contest = Contest {
            case: "cycle-1ms",
            watched: vec![watched("loaded", true), watched(UNLOADED, false)],
            with_goals: 1,
            bounds: vec![HOPED],
            versus: vec![
                Versus { name: HOPED.0, p50: None, p99: Some(Target::AtMost(1.0)) },
                Versus { name: UNLOADED, p50: None, p99: None },
            ],
            figures: [&[OMITTED_HOPED][..], &ALWAYS[..]].concat(),
        };
        Ok(contest.hold(settings).rows)
    }
}
