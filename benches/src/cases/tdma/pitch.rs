//! How short a slot for 1400 B can be, and how much of its end must be kept free: tables by the shortest slots that `check` lets pass, and
//! how far into the guard the latest frame began.

use super::contest::{ALWAYS, Contest, Figure, Watched};
use super::goals::{Goal, figure};
use super::observed::Way;
use super::plans::{SHORT_PITCH, SHORTEST_PITCH, WIDE_GUARD};
use super::slots::OMITTED;
use crate::cases::Case;
use crate::harness::Failure;
use crate::rounds::Row;
use crate::settings::Settings;
use crate::tdma::plan::Plan;
use crate::tdma::rights::Rights;

const INTO_GUARD: Figure =
    Figure { what: "into the guard", unit: "us in", of: |seen| seen.kept.into_guard_us, goals: &[] };

/// From slot to slot, as RTnet has it; and what of it nobody may send in.
const PITCH: [Goal; 2] = [Goal { name: "must 250 us", most: 250.0 }, Goal { name: "hoped 200 us", most: 200.0 }];
const GUARD: [Goal; 2] = [Goal { name: "must 150 us", most: 150.0 }, Goal { name: "hoped 100 us", most: 100.0 }];

pub(super) fn cases() -> Vec<Box<dyn Case>> {
    vec![Box::new(Pitch)]
}

struct Pitch;

impl Case for Pitch {
    fn name(&self) -> String {
        "pitch".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let watched = |who, plan| Watched { who, plan, way: Way { rights: Rights::RealTime, loaded: true } };
        let tables = [
            ("250 us, guard 80", SHORT_PITCH),
            ("320 us, guard 150", WIDE_GUARD),
            ("210 us, guard 40", SHORTEST_PITCH),
        ];
        let contest = Contest {
            case: "pitch",
            watched: tables.map(|(who, plan)| watched(who, plan)).into(),
            judged: tables.len(),
            bounds: Vec::new(),
            versus: Vec::new(),
            figures: [&[INTO_GUARD, OMITTED][..], &ALWAYS[..]].concat(),
        };
        let (mut rows, _) = contest.hold(settings);
        for (who, Plan { pitch_us, guard_us, .. }) in tables {
            rows.extend(figure(&contest.subject("us", Some("slot")), who, &[pitch_us as f64], &PITCH));
            rows.extend(figure(&contest.subject("us", Some("guard")), who, &[guard_us as f64], &GUARD));
        }
        Ok(rows)
    }
}
