//! Slots that are omitted while 500 000 foreign datagrams a second arrive at each port of a node, from an address that
//! no node has; and without.
//!
//! The junk goes to the node that is no master, in place of the load of the other cases. Its sender shares a processor
//! with other processes. The floor: bare threads that wake up for the same slots beside the same junk.

use super::contest::BARE;
use super::goals::{Goal, figure};
use super::observed::{Observed, PORTS, RunConditions, watched};
use super::plans::LOADED;
use crate::tdma::bare::BareThreads;
use crate::tdma::rights::Rights;
use crate::tdma::stage::Stage;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::Failure;
use rohrpost_bench_local::rounds::{Row, Subject};
use rohrpost_bench_local::settings::Settings;

/// A turn is long.
const ROUNDS_MAX: usize = 3;
const OF_NO_JUNK: [Goal; 1] = [Goal { name: "must 1.2", most: 1.2 }];

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("slots, junk", None, "%", slot_junk)]
}

fn slot_junk(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let stage = Stage::new()?;
    let turn = |junk| {
        let way = RunConditions { rights: Rights::RealTime, loaded: false, junk };
        Observed::turn(&stage, &LOADED, way, settings)
    };
    let bare = |junk: bool| {
        let load = || junk.then(|| stage.junk(&PORTS)).transpose();
        BareThreads::beside(&LOADED, load, watched(settings)).map(|bare| bare.omitted_percent())
    };
    let (mut seen, mut floor) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
    for _ in 0..settings.rounds.min(ROUNDS_MAX) {
        for (at, junk) in [true, false].into_iter().enumerate() {
            seen[at].push(turn(junk)?);
            floor[at].push(bare(junk)?);
        }
    }
    let [junk, quiet] = seen.each_ref().map(|all| all.iter().map(Observed::omitted_percent).collect::<Vec<_>>());
    let sent: Vec<f64> = seen[0].iter().filter_map(|seen| seen.junk_s).collect();
    let subject = |unit, what| Subject { case: format!("{}, {what}", subject.case), bytes: None, unit };
    // A round without omitted slots and without junk says nothing about the ratio.
    let both = junk.iter().zip(&quiet).filter(|(_, quiet)| **quiet > 0.0);
    let ratios: Vec<f64> = both.map(|(junk, quiet)| junk / quiet).collect();
    Ok([
        figure(&subject("%", "omitted"), "rohrpost", &junk, &[]),
        figure(&subject("%", "omitted"), "no junk", &quiet, &[]),
        figure(&subject("of no junk", "omitted"), "rohrpost", &ratios, &OF_NO_JUNK),
        figure(&subject("%", "omitted"), BARE, &floor[0], &[]),
        figure(&subject("%", "omitted"), "bare threads, no junk", &floor[1], &[]),
        figure(&subject("datagrams/s", "to each port"), "junk", &sent, &[]),
    ]
    .concat())
}
