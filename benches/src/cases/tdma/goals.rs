//! Rows that stand beside what must be reached, and beside what may be hoped for.

use rohrpost_bench_local::rounds::{Row, Subject, Target, Versus};
use rohrpost_bench_local::statistics::{Ratio, Summary, median};

/// A bound of a figure.
#[derive(Clone, Copy, Debug)]
pub(super) struct Goal {
    /// As the table has it: `must 0.5 %`.
    pub name: &'static str,
    /// At most so much, in each round.
    pub most: f64,
}

/// Where nothing at all is allowed.
pub(super) const NONE: [Goal; 1] = [Goal { name: "must none", most: 0.0 }];

/// A figure that is there once in a round, beside each of its goals, which its worst round must meet; without goals,
/// alone. None without any round.
pub(super) fn figure(subject: &Subject, contender: &'static str, rounds: &[f64], goals: &[Goal]) -> Vec<Row> {
    let Some(middle) = median(rounds.iter().copied()) else { return Vec::new() };
    let row = |goal: Option<&Goal>| {
        let ratio = goal.and_then(|goal| Ratio::of(rounds.iter().map(|value| value / base(goal))));
        let versus = goal.map(|goal| Versus { name: goal.name, p50: Some(target(goal)), p99: None });
        Row { versus, ratio_p50: ratio, ..Row::alone(subject.clone(), contender, Ok(Summary::single(middle))) }
    };
    if goals.is_empty() { vec![row(None)] } else { goals.iter().map(Some).map(row).collect() }
}

/// A row's case and unit; its figures are of no size.
pub(super) fn subject(case: &str, unit: &'static str) -> Subject {
    Subject { case: case.into(), bytes: None, unit }
}

/// Many figures of all rounds, for information. None without any.
pub(super) fn spread(subject: &Subject, contender: &'static str, mut samples: Vec<f64>) -> Option<Row> {
    Some(Row::alone(subject.clone(), contender, Ok(Summary::of(&mut samples)?)))
}

/// What the ratio is taken to: where nothing at all is allowed, one.
fn base(goal: &Goal) -> f64 {
    if goal.most == 0.0 { 1.0 } else { goal.most }
}

fn target(goal: &Goal) -> Target {
    Target::EachAtMost(if goal.most == 0.0 { 0.0 } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_meets_what_its_worst_round_is_within_and_nothing_is_within_nothing() {
        let subject = Subject { case: "slots, omitted".into(), bytes: None, unit: "%" };
        let goals = [Goal { name: "must 0.5 %", most: 0.5 }, Goal { name: "none", most: 0.0 }];
        let met = |rounds: &[f64]| figure(&subject, "loaded", rounds, &goals).iter().map(Row::met).collect::<Vec<_>>();
        assert_eq!(met(&[0.1, 0.4, 9.0]), [Some(false), Some(false)]);
        assert_eq!(met(&[0.1, 0.4, 0.5]), [Some(true), Some(false)]);
        assert_eq!(met(&[0.0, 0.0, 0.1]), [Some(true), Some(false)]);
        assert_eq!(met(&[0.0, 0.0, 0.0]), [Some(true), Some(true)]);
        assert_eq!(met(&[0.6]), [Some(false), Some(false)]);
        assert!(met(&[]).is_empty());
        let ratio = figure(&subject, "loaded", &[0.25], &goals)[0].ratio_p50.unwrap();
        assert_eq!(ratio.median, 0.5);
    }
}
