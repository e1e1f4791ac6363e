//! Contenders of a case, one after the other, round after round; and their rows.

use crate::harness::{Failure, alone, interrupted, processors};
use crate::settings::Settings;
use crate::statistics::{Ratio, Summary, median};
use std::time::Duration;

/// A pause between two turns for the kernel's fair server and other processes.
const PAUSE: Duration = Duration::from_millis(50);

/// A contender of a case.
pub struct Contender<'a> {
    /// Name in the table.
    pub name: &'static str,
    /// One turn.
    pub turn: Box<dyn Fn() -> Result<Summary, Failure> + 'a>,
    /// How ours is compared with it: a row for each.
    pub versus: Vec<Versus>,
}

impl<'a> Contender<'a> {
    /// A contender that ours is not compared with.
    pub fn new(name: &'static str, turn: impl Fn() -> Result<Summary, Failure> + 'a) -> Self {
        Self { name, turn: Box::new(turn), versus: Vec::new() }
    }

    /// A contender with turns of samples, of which the quantiles count.
    pub fn sampled(name: &'static str, turn: impl Fn() -> Result<Vec<f64>, Failure> + 'a) -> Self {
        Self::new(name, move || Summary::of(&mut turn()?).ok_or_else(|| Failure::Failed("not one sample".into())))
    }

    /// A contender with turns of one figure each, a rate say.
    pub fn single(name: &'static str, turn: impl Fn() -> Result<f64, Failure> + 'a) -> Self {
        Self::new(name, move || turn().map(Summary::single))
    }

    /// Figures that are known beforehand: a limit, or what others have measured.
    pub fn fixed(name: &'static str, figures: Summary) -> Self {
        Self::new(name, move || Ok(figures))
    }

    /// Ours stands beside this one, with targets for the ratios of the medians and of the 99 % quantiles.
    #[must_use]
    pub fn beside(mut self, p50: Option<Target>, p99: Option<Target>) -> Self {
        self.versus.push(Versus { name: self.name, p50, p99 });
        self
    }
}

/// A target for times and sizes.
pub fn at_most(bound: f64) -> Option<Target> {
    Some(Target::AtMost(bound))
}

/// A target for rates.
pub fn at_least(bound: f64) -> Option<Target> {
    Some(Target::AtLeast(bound))
}

/// The target, as a ratio to another contender.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Target {
    /// For times and sizes.
    AtMost(f64),
    /// For figures with an absolute limit: in each round.
    EachAtMost(f64),
    /// For rates.
    AtLeast(f64),
}

impl Target {
    /// The ratio itself.
    pub fn bound(self) -> f64 {
        match self {
            Self::AtMost(bound) | Self::EachAtMost(bound) | Self::AtLeast(bound) => bound,
        }
    }

    /// Whether this ratio reaches it.
    pub fn is_met(self, ratio: Ratio) -> bool {
        match self {
            Self::AtMost(bound) => ratio.median <= bound,
            Self::EachAtMost(bound) => ratio.max <= bound,
            Self::AtLeast(bound) => ratio.median >= bound,
        }
    }
}

/// A contender to compare ours with.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Versus {
    /// Its name in the same case.
    pub name: &'static str,
    /// What the ratio of the medians must reach; none: for information.
    pub p50: Option<Target>,
    /// What the ratio of the 99 % quantiles must reach.
    pub p99: Option<Target>,
}

/// One line of the table: the figures of a contender, and the comparison with another.
#[derive(Clone, PartialEq, Debug)]
pub struct Row {
    /// Which case.
    pub case: String,
    /// Size of a message, where there is one.
    pub bytes: Option<usize>,
    /// Name of the contender.
    pub contender: &'static str,
    /// Unit of the figures, `us` or `packages/s` say.
    pub unit: &'static str,
    /// Medians over rounds (of the maximum: the largest), or why there are none.
    pub result: Result<Summary, Failure>,
    /// The contender that it is compared with.
    pub versus: Option<Versus>,
    /// Of the medians, taken within each round.
    pub ratio_p50: Option<Ratio>,
    /// Of the 99 % quantiles.
    pub ratio_p99: Option<Ratio>,
}

impl Row {
    /// A row without a comparison.
    pub fn alone(subject: Subject, contender: &'static str, result: Result<Summary, Failure>) -> Self {
        let Subject { case, bytes, unit } = subject;
        Self { case, bytes, contender, unit, result, versus: None, ratio_p50: None, ratio_p99: None }
    }

    /// Whether every target is met; none without a target, or if the other contender was skipped.
    pub fn met(&self) -> Option<bool> {
        let versus = self.versus?;
        if versus.p50.is_none() && versus.p99.is_none() {
            return None;
        }
        if matches!(self.result, Err(Failure::Failed(_))) {
            return Some(false);
        }
        let reached = |target: Option<Target>, ratio: Option<Ratio>| match (target, ratio) {
            (None, _) => Some(true),
            (Some(target), Some(ratio)) => Some(target.is_met(ratio)),
            (Some(_), None) => None,
        };
        Some(reached(versus.p50, self.ratio_p50)? && reached(versus.p99, self.ratio_p99)?)
    }
}

/// What is measured: the columns that all rows of a case share.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The case's name.
    pub case: String,
    /// Size of a message, where there is one.
    pub bytes: Option<usize>,
    /// Unit of the figures.
    pub unit: &'static str,
}

/// Measures all contenders, interleaved, and compares the first one, which is ours, with those that it stands beside.
/// Rows: ours, once for each comparison (once without, if there is none), then the others.
pub fn compare(settings: &Settings, subject: &Subject, contenders: &[Contender]) -> Vec<Row> {
    let turns = interleave(settings, contenders);
    let row = |at: usize| Row::alone(subject.clone(), contenders[at].name, over_rounds(&turns[at]));
    let mut rows = Vec::new();
    for (other, turns_of_other) in contenders.iter().zip(&turns) {
        rows.extend(other.versus.iter().map(|versus| Row {
            versus: Some(*versus),
            ratio_p50: ratio(&turns[0], turns_of_other, |summary| Some(summary.p50)),
            ratio_p99: ratio(&turns[0], turns_of_other, |summary| summary.p99),
            ..row(0)
        }));
    }
    if rows.is_empty() {
        rows.push(row(0));
    }
    rows.extend((1..contenders.len()).map(row));
    rows
}

type Turns = Vec<Result<Summary, Failure>>;

/// The turns of each contender, one a round; each round begins with the next contender, so that none always comes after
/// the same one. A contender that failed or was skipped has no further turn.
fn interleave(settings: &Settings, contenders: &[Contender]) -> Vec<Turns> {
    let mut turns: Vec<Turns> = contenders.iter().map(|_| Vec::new()).collect();
    for round in 0..settings.rounds.max(1) {
        for step in 0..contenders.len() {
            let at = (round + step) % contenders.len();
            let (contender, turns) = (&contenders[at], &mut turns[at]);
            if !turns.iter().any(Result::is_err) && !interrupted() {
                std::thread::sleep(PAUSE);
                let turn = alone().and_then(|_alone| (contender.turn)());
                turns.push(turn.map_err(|failure| on(processors().len(), failure)));
            }
        }
    }
    turns
}

/// With one processor, nearly all that can fail does so since an end that needs a second one did not begin.
fn on(processors: usize, failure: Failure) -> Failure {
    match failure {
        Failure::Failed(text) if processors < 2 => {
            Failure::Skipped(format!("needs 2 processors, this program may use {processors} ({text})"))
        }
        failure => failure,
    }
}

/// Ratio of one figure to another's in the same round. None for a contender that did not do every round.
fn ratio(
    ours: &[Result<Summary, Failure>],
    others: &[Result<Summary, Failure>],
    figure: fn(&Summary) -> Option<f64>,
) -> Option<Ratio> {
    let pairs =
        ours.iter().zip(others).map(|(our, other)| Some(figure(our.as_ref().ok()?)? / figure(other.as_ref().ok()?)?));
    Ratio::of(pairs.collect::<Option<Vec<f64>>>()?)
}

fn over_rounds(turns: &[Result<Summary, Failure>]) -> Result<Summary, Failure> {
    let rounds = turns.iter().cloned().collect::<Result<Vec<Summary>, Failure>>()?;
    let middle = |figure: fn(&Summary) -> Option<f64>| median(rounds.iter().filter_map(figure));
    Ok(Summary {
        p50: middle(|round| Some(round.p50)).ok_or_else(|| Failure::Failed("not one round".into()))?,
        p99: middle(|round| round.p99),
        p999: middle(|round| round.p999),
        max: rounds.iter().filter_map(|round| round.max).reduce(f64::max),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;

    #[test]
    fn what_fails_on_one_processor_is_skipped_with_its_reason() {
        let hung = || Failure::Failed("hung".into());
        assert_eq!(on(2, hung()), hung());
        let told = "needs 2 processors, this program may use 1 (hung)".to_owned();
        assert_eq!(on(1, hung()), Failure::Skipped(told));
    }

    #[test]
    fn each_round_begins_with_the_next_contender_and_one_that_failed_has_no_further_turn() {
        let order = RefCell::new(String::new());
        let contender = |name: &'static str| {
            let order = &order;
            let turn = move || {
                order.borrow_mut().push_str(name);
                if name == "c" { Err(Failure::Failed("once".into())) } else { Ok(Summary::single(1.0)) }
            };
            Contender::new(name, turn)
        };
        let settings = Settings { rounds: 4, ..Settings::default() };
        let turns = interleave(&settings, &["a", "b", "c"].map(contender));
        assert_eq!(*order.borrow(), "abcbaabab");
        assert_eq!(turns.iter().map(Vec::len).collect::<Vec<_>>(), [4, 4, 1]);
    }
}
