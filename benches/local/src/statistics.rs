//! Quantiles of one turn, and medians over rounds.

/// What one contender did in one turn, in the unit of its case.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Summary {
    /// Median; or the one figure there is (a rate, a size).
    pub p50: f64,
    /// 99 of 100 are at most this.
    pub p99: Option<f64>,
    /// 999 of 1 000 are at most this.
    pub p999: Option<f64>,
    /// Largest.
    pub max: Option<f64>,
}

impl Summary {
    /// Of many samples; none without any.
    pub fn of(samples: &mut [f64]) -> Option<Self> {
        samples.sort_unstable_by(f64::total_cmp);
        let max = *samples.last()?;
        let at = |q| quantile(samples, q);
        Some(Self { p50: at(0.5)?, p99: at(0.99), p999: at(0.999), max: Some(max) })
    }

    /// A figure that is there once in a turn.
    pub fn single(value: f64) -> Self {
        Self { p50: value, p99: None, p999: None, max: None }
    }
}

/// The quantile `q` (0 to 1) of sorted samples; none of none.
fn quantile(sorted: &[f64], q: f64) -> Option<f64> {
    sorted.get(((sorted.len() as f64 * q) as usize).min(sorted.len().checked_sub(1)?)).copied()
}

/// The middle one; of an even number the mean of the two in the middle. None of none.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_unstable_by(f64::total_cmp);
    let upper = *values.get(values.len() / 2)?;
    if values.len() % 2 == 1 {
        return Some(upper);
    }
    Some((values.get(values.len() / 2 - 1)? + upper) / 2.0)
}

/// A ratio, taken in each round, over all rounds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ratio {
    /// Median over rounds.
    pub median: f64,
    /// Least of a round.
    pub min: f64,
    /// Largest of a round.
    pub max: f64,
}

impl Ratio {
    /// Of the ratios of the rounds; none of none. What is not finite (a floor of 0) does not count.
    pub fn of(rounds: impl IntoIterator<Item = f64>) -> Option<Self> {
        let rounds: Vec<f64> = rounds.into_iter().filter(|ratio| ratio.is_finite()).collect();
        let min = rounds.iter().copied().reduce(f64::min)?;
        let max = rounds.iter().copied().reduce(f64::max)?;
        Some(Self { median: median(rounds)?, min, max })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_samples_and_the_last_one_is_the_largest() {
        let mut samples: Vec<f64> = (1..=1000).rev().map(f64::from).collect();
        let summary = Summary::of(&mut samples).unwrap();
        assert_eq!(summary, Summary { p50: 501.0, p99: Some(991.0), p999: Some(1000.0), max: Some(1000.0) });
        assert_eq!(Summary::of(&mut [7.0]).unwrap().p999, Some(7.0));
        assert_eq!(Summary::of(&mut []), None);
    }

    #[test]
    fn medians_and_spread_over_rounds() {
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median([]), None);
        assert_eq!(Ratio::of([2.0, 1.0, f64::INFINITY, 4.0]), Some(Ratio { median: 2.0, min: 1.0, max: 4.0 }));
        assert_eq!(Ratio::of([f64::NAN]), None);
    }
}
