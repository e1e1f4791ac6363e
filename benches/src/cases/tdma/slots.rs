//! How far off their nominal begin slots start, under load, without load, and with routers without real-time
//! scheduling.

use super::contest::{ALWAYS, BARE, Contest, Figure, Held, ObservedRounds, WatchedContender};
use super::goals::{Goal, figure};
use super::observed::{Observed, RunConditions};
use super::plans::LOADED;
use crate::tdma::bare::BareThreads;
use crate::tdma::rights::Rights;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::Failure;
use rohrpost_bench_local::rounds::{Row, Subject, Target, at_most};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;

const fn bounds(p50: f64, p99: f64, p999: f64) -> Summary {
    Summary { p50, p99: Some(p99), p999: Some(p999), max: None }
}

const MUST: (&str, Summary) = ("20, 50, 150 us", bounds(20.0, 50.0, 150.0));
const HOPED: (&str, Summary) = ("5, 25, 60 us", bounds(5.0, 25.0, 60.0));
pub(super) const UNLOADED: &str = "unloaded";
const ORDINARY: &str = "ordinary";
/// Further off than this, a slot would meet the next one even with a wide guard.
const FAR_US: f64 = 250.0;

/// 99.9 % quantile of how far off, µs.
fn p999_us(seen: &Observed) -> f64 {
    seen.summary().ok().and_then(|summary| summary.p999).unwrap_or_default()
}

/// With more omitted slots, slots are not kept.
pub(super) const OMITTED_MUST: Goal = Goal { name: "must 0.5 %", most: 0.5 };

/// Of the routers' own counts.
pub(super) const OMITTED: Figure = Figure {
    what: "omitted",
    unit: "%",
    of: Observed::omitted_percent,
    goals: &[OMITTED_MUST, Goal { name: "hoped 0.2 %", most: 0.2 }],
};

const FIGURES: [Figure; 3] = [
    Figure {
        what: "p99.9",
        unit: "us",
        of: p999_us,
        goals: &[Goal { name: "must 150 us", most: 150.0 }, Goal { name: "hoped 60 us", most: 60.0 }],
    },
    OMITTED,
    Figure {
        what: "over 100 us off",
        unit: "%",
        of: |seen| seen.further_off_percent(100.0),
        goals: &[Goal { name: "must 0.1 %", most: 0.1 }, Goal { name: "hoped 0.02 %", most: 0.02 }],
    },
];

/// What the same code must do to this without real-time scheduling.
const FEWER: [Goal; 2] =
    [Goal { name: "must 1/50", most: 1.0 / 50.0 }, Goal { name: "hoped 1/100", most: 1.0 / 100.0 }];

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("slots", None, "us", slots)]
}

fn slots(settings: &Settings, _: &Subject) -> Result<Vec<Row>, Failure> {
    let watched = |contender, loaded| WatchedContender::new(contender, LOADED, loaded);
    let ordinary = watched(ORDINARY, true).beside(&[[None; 2]]);
    let way = RunConditions { rights: Rights::Ordinary, ..ordinary.way };
    let contest = Contest {
        case: "slots",
        watched: vec![
            watched("loaded", true),
            watched(UNLOADED, false).beside(&[[None, Some(Target::AtMost(2.5))], [None, Some(Target::AtMost(1.5))]]),
            WatchedContender { way, ..ordinary },
        ],
        with_goals: 1,
        bounds: [MUST, HOPED].map(|(name, bounds)| (name, bounds, [at_most(1.0); 2])).into(),
        figures: [&FIGURES[..], &ALWAYS[..]].concat(),
    };
    let Held { mut rows, seen, bare } = contest.hold(settings);
    let [loaded, _, ordinary] = seen.as_slice() else { return Ok(rows) };
    let not_kept_subject = contest.subject("of ordinary", Some(NOT_KEPT));
    let floor: Vec<f64> = bare.iter().zip(ordinary).map(|(bare, ordinary)| floor(bare, ordinary)).collect();
    rows.extend(figure(&not_kept_subject, BARE, &floor, &FEWER));
    for (what, far) in [("over 250 us off", far_off as Far), (NOT_KEPT, not_kept)] {
        rows.extend(figure(
            &contest.subject("of ordinary", Some(what)),
            "loaded",
            &ratios(loaded, ordinary, far),
            &FEWER,
        ));
    }
    Ok(rows)
}

/// Slots that were not kept, of how many.
type Far = fn(&Observed) -> (u64, u64);

const NOT_KEPT: &str = "left out or over 250 us off";

/// Slots that bare threads would omit, divided by slots that are not kept without real-time scheduling: no router is
/// better.
fn floor(bare: &BareThreads, ordinary: &Observed) -> f64 {
    let (some, all) = not_kept(ordinary);
    bare.omitted_percent() / 100.0 * all.max(1) as f64 / some.max(1) as f64
}

/// Of used slots.
fn far_off(seen: &Observed) -> (u64, u64) {
    (seen.kept.further_off(FAR_US) as u64, seen.kept.off_us.len() as u64)
}

/// Of all slots. A late wake-up does not send. So without real-time scheduling most slots are omitted, and few begin
/// late.
fn not_kept(seen: &Observed) -> (u64, u64) {
    (far_off(seen).0 + seen.counts.omitted(), seen.counts.all())
}

/// Our share divided by the other's, in each round. None counts as one.
fn ratios(ours: &ObservedRounds, others: &ObservedRounds, far: Far) -> Vec<f64> {
    let share = |seen| {
        let (some, all) = far(seen);
        some.max(1) as f64 / all.max(1) as f64
    };
    ours.iter().zip(others).map(|(our, other)| share(our) / share(other)).collect()
}
