//! How short a slot for 1400 B can be, and how much of its end must be kept free: tables by the shortest slots that
//! `check` lets pass, and how far into the guard the latest frame began. A table that was not kept is none that can be
//! had.

use super::contest::{ALWAYS, Contest, Figure, Held, WatchedContender};
use super::goals::{Goal, NONE, figure};
use super::observed::Observed;
use super::plans::{SHORT_PITCH, SHORTEST_PITCH, WIDE_GUARD};
use super::slots::{OMITTED, OMITTED_MUST};
use crate::tdma::plan::Plan;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::Failure;
use rohrpost_bench_local::rounds::{Row, Subject};
use rohrpost_bench_local::settings::Settings;

const INTO_GUARD: Figure =
    Figure { what: "into the guard", unit: "us in", of: |seen| seen.kept.into_guard_us, goals: &[] };

/// From slot to slot, as RTnet has it; and what of it nobody may send in.
const PITCH: [Goal; 2] = [Goal { name: "must 250 us", most: 250.0 }, Goal { name: "hoped 200 us", most: 200.0 }];
const GUARD: [Goal; 2] = [Goal { name: "must 150 us", most: 150.0 }, Goal { name: "hoped 100 us", most: 100.0 }];

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("pitch", None, "us", pitch)]
}

fn pitch(settings: &Settings, _: &Subject) -> Result<Vec<Row>, Failure> {
    let tables =
        [("250 us, guard 80", SHORT_PITCH), ("320 us, guard 150", WIDE_GUARD), ("210 us, guard 40", SHORTEST_PITCH)];
    let contest = Contest {
        case: "pitch",
        watched: tables.map(|(contender, plan)| WatchedContender::new(contender, plan, true)).into(),
        with_goals: tables.len(),
        bounds: Vec::new(),
        figures: [&[INTO_GUARD, OMITTED][..], &ALWAYS[..]].concat(),
    };
    let Held { mut rows, seen, .. } = contest.hold(settings);
    for ((contender, plan), seen) in tables.into_iter().zip(seen) {
        let not_kept: Vec<f64> = seen.iter().map(|seen| if is_kept(&plan, seen) { 0.0 } else { 100.0 }).collect();
        rows.extend(figure(&contest.subject("%", Some("not kept")), contender, &not_kept, &NONE));
        // A round that failed has a row of its own.
        if not_kept.len() == settings.rounds.max(1) && not_kept.iter().all(|percent| *percent == 0.0) {
            let Plan { pitch_us, guard_us, .. } = plan;
            rows.extend(figure(&contest.subject("us", Some("slot")), contender, &[pitch_us as f64], &PITCH));
            rows.extend(figure(&contest.subject("us", Some("guard")), contender, &[guard_us as f64], &GUARD));
        }
    }
    Ok(rows)
}

/// Whether nobody sent where it must not, and hardly a slot was left out.
fn is_kept(plan: &Plan, seen: &Observed) -> bool {
    let Observed { kept, .. } = seen;
    kept.outside == 0 && kept.into_guard_us <= plan.guard_us as f64 && seen.omitted_percent() <= OMITTED_MUST.most
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tdma::counts::Counts;
    use crate::tdma::kept::Kept;

    #[test]
    fn a_table_is_kept_when_nothing_is_outside_nothing_behind_the_guard_and_few_slots_left_out() {
        let is_kept = |outside, into_guard_us, late| {
            let kept = Kept { outside, into_guard_us, frames: 1_000, ..Kept::default() };
            let counts = Counts { used: 1_000 - late, late, ..Counts::default() };
            super::is_kept(&SHORT_PITCH, &Observed { kept, counts, steal_percent: 0.0, waited_ms_s: 0.0, junk_s: None })
        };
        assert!(is_kept(0, 80.0, 5));
        assert!(!is_kept(1, 0.0, 0) && !is_kept(0, 80.5, 0) && !is_kept(0, 0.0, 6));
    }
}
