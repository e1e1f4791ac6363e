//! Slots that are left out while somebody sends 500 000 datagrams a second to each port of a node, from an address that no node has; and without.
//!
//! The junk goes to the node that is no master, in place of the load of the other cases. Who sends it has a processor with what else runs there.

use super::observed::{Observed, Way};
use super::plans::LOADED;
use crate::cases::Case;
use crate::harness::Failure;
use crate::rounds::{Row, Subject};
use crate::settings::Settings;
use crate::statistics::{Summary, median};
use crate::tdma::rights::Rights;
use crate::tdma::stage::Stage;

/// A turn lasts long.
const ROUNDS_MAX: usize = 3;

pub(super) fn cases() -> Vec<Box<dyn Case>> {
    vec![Box::new(Junked)]
}

struct Junked;

impl Case for Junked {
    fn name(&self) -> String {
        "slots, junk".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let stage = Stage::new()?;
        let turn = |junk| {
            let way = Way { rights: Rights::RealTime, loaded: false, junk };
            Observed::turn(&stage, &LOADED, way, settings)
        };
        let mut seen = [Vec::new(), Vec::new()];
        for _ in 0..settings.rounds.min(ROUNDS_MAX) {
            seen[0].push(turn(true)?);
            seen[1].push(turn(false)?);
        }
        let row = |who, unit, all: &[Observed], of: fn(&Observed) -> f64| {
            let subject = Subject { case: self.name(), bytes: None, unit };
            median(all.iter().map(of)).map(|median| Row::alone(subject, who, Ok(Summary::single(median))))
        };
        let [junk, quiet] = &seen;
        let rows = [
            row("left out, junk", "%", junk, Observed::omitted_percent),
            row("left out, no junk", "%", quiet, Observed::omitted_percent),
            row("junk to each port", "datagrams/s", junk, |seen| seen.junk_s.unwrap_or_default()),
        ];
        Ok(rows.into_iter().flatten().collect())
    }
}
