//! The one-way times of a round trip, by system time. Pure.
//!
//! Two nodes share a time if both follow the master's clock in the same epoch, and each knows its error bound; the
//! error of a difference of their times is at most the sum of both bounds. A figure below its bound means nothing, and
//! is not shown.

use crate::terminal::units::short;
use rohrpost::common::TimeReport;
use serde_json::{Value, json};

/// The name of the source of time, where nodes share one.
const MASTER: &str = "master";

/// System time when the command was sent, when it was run, and when the answer arrived.
pub(super) struct Moments<'a> {
    pub(super) before: &'a TimeReport,
    pub(super) there: &'a TimeReport,
    pub(super) after: &'a TimeReport,
}

/// The one-way times of the command and of its answer.
#[derive(Debug, PartialEq)]
pub(super) struct RoundTrip {
    pub(super) there_s: f64,
    pub(super) back_s: f64,
    /// Bound of each one's error; if one is too long, the other is too short by the same amount.
    pub(super) error_s: f64,
}

impl RoundTrip {
    /// Modules of one node share its clock; `pace` is that clock's rate.
    pub(super) fn new(moments: &Moments<'_>, one_clock: bool, pace: f64) -> Result<Self, String> {
        let Moments { before, there, after } = moments;
        if !one_clock {
            for (place, time) in [("this node", before), ("its node", there)] {
                if time.source != MASTER {
                    return Err(format!("{place} does not have the master's time, but its own ({})", time.source));
                }
            }
        }
        if (before.epoch, before.epoch) != (there.epoch, after.epoch) {
            return Err(format!(
                "time was set again, or not on all nodes (epochs {}, {}, {})",
                before.epoch, there.epoch, after.epoch
            ));
        }
        if one_clock && pace == 0.0 {
            return Err("the time of this node stands still".into());
        }
        let error_s = if one_clock {
            0.0
        } else {
            before.error_ns.max(after.error_ns).saturating_add(there.error_ns) as f64 / 1e9
        };
        let way = |from: &TimeReport, to: &TimeReport| {
            (i128::from(to.ns) - i128::from(from.ns)) as f64 / 1e9 / pace.max(1e-3)
        };
        let (there_s, back_s) = (way(before, there), way(there, after));
        if there_s.min(back_s) < error_s || there_s.min(back_s) < 0.0 {
            return Err(format!(
                "the clocks of both nodes may differ by {}, which is more than the one-way time",
                short(error_s)
            ));
        }
        Ok(Self { there_s, back_s, error_s })
    }

    pub(super) fn text(&self) -> String {
        let error = if self.error_s > 0.0 { format!(", each ± {}", short(self.error_s)) } else { String::new() };
        format!("there {}, back {}{error}", short(self.there_s), short(self.back_s))
    }
}

/// One direction of all rounds.
#[derive(Default)]
pub(super) struct DirectionSum {
    count: u64,
    sum_s: f64,
    least_s: f64,
    most_s: f64,
    error_s: f64,
}

impl DirectionSum {
    pub(super) fn add(&mut self, way_s: f64, error_s: f64) {
        self.least_s = if self.count == 0 { way_s } else { self.least_s.min(way_s) };
        self.most_s = self.most_s.max(way_s);
        self.error_s = self.error_s.max(error_s);
        self.sum_s += way_s;
        self.count += 1;
    }

    fn mean_s(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum_s / self.count as f64)
    }

    /// None if no one-way time is known.
    pub(super) fn text(&self) -> Option<String> {
        let mean_s = self.mean_s()?;
        let error = if self.error_s > 0.0 { format!("  each ± {}", short(self.error_s)) } else { String::new() };
        Some(format!("min {}  mean {}  max {}{error}", short(self.least_s), short(mean_s), short(self.most_s)))
    }

    pub(super) fn json(&self) -> Value {
        match self.mean_s() {
            Some(mean_s) => json!({
                "known": self.count, "min_s": self.least_s, "mean_s": mean_s, "max_s": self.most_s,
                "error_s": self.error_s,
            }),
            None => Value::Null,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn time(us: u64, epoch: u64, error_us: u64, source: &str) -> TimeReport {
        TimeReport { ns: 1_000_000_000 + us * 1000, epoch, error_ns: error_us * 1000, source: source.into() }
    }

    fn round_trip(there: TimeReport, one_clock: bool) -> Result<RoundTrip, String> {
        let (before, after) = (time(0, 3, 2, MASTER), time(150, 3, 2, MASTER));
        RoundTrip::new(&Moments { before: &before, there: &there, after: &after }, one_clock, 1.0)
    }

    #[test]
    fn a_one_way_time_appears_only_where_it_is_known() {
        let told =
            |round_trip: Result<RoundTrip, String>| round_trip.map_or_else(|why| why, |round_trip| round_trip.text());
        for (there, one_clock, words) in [
            (time(100, 3, 5, MASTER), false, "there 100 µs, back 50 µs, each ± 7 µs"),
            (time(100, 3, 5, "local"), true, "there 100 µs, back 50 µs"),
            (time(100, 3, 5, "local"), false, "its node does not have the master's time, but its own (local)"),
            (time(100, 4, 5, MASTER), false, "time was set again, or not on all nodes (epochs 3, 4, 3)"),
            (
                time(100, 3, 60, MASTER),
                false,
                "the clocks of both nodes may differ by 62 µs, which is more than the one-way time",
            ),
            (
                time(151, 3, 0, MASTER),
                false,
                "the clocks of both nodes may differ by 2 µs, which is more than the one-way time",
            ),
        ] {
            assert_eq!(told(round_trip(there, one_clock)), words);
        }
    }

    #[test]
    fn times_of_a_faster_simulation_are_in_real_time() {
        let (before, there, after) = (time(0, 1, 0, "local"), time(100, 1, 0, "local"), time(300, 1, 0, "local"));
        let round_trip = RoundTrip::new(&Moments { before: &before, there: &there, after: &after }, true, 2.0).unwrap();
        assert_eq!((round_trip.there_s, round_trip.back_s), (50e-6, 100e-6));
    }

    #[test]
    fn a_time_that_stands_still_tells_no_one_way_times() {
        let still = time(0, 1, 0, "log");
        let round_trip = RoundTrip::new(&Moments { before: &still, there: &still, after: &still }, true, 0.0);
        assert_eq!(round_trip, Err("the time of this node stands still".into()));
    }
}
