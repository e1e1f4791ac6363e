//! A log played back: its records in the order of the file, each with its own time, and with that at which it is due.
//!
//! Stamps of a log are not to be trusted alone:
//!
//! - More than [`BEHIND_MAX_S`] behind the largest stamp so far: the record is discarded and counted. The Intel log has
//!   an ODOM line after each scan, with a stamp next to 0.
//! - Behind by less: the record is kept where the file has it, with its own stamp (the writers of a log take turns as
//!   they please; the Intel log has 1709 such). Only its due time is held at the largest so far: due times never go
//!   back.
//! - More than [`GAP_MAX_S`] ahead: discarded too, since believing one wrong stamp would cost the rest of the log. If
//!   the next stamp agrees with it, it was a pause, which is played as one of `GAP_MAX_S`.

use super::carmen::{LogError, LogRecord, Reader};
use std::io::BufRead;
use thiserror::Error;

/// A record further behind the largest stamp so far is discarded.
pub const BEHIND_MAX_S: f64 = 1.0;
/// Longest pause that is played as it was.
pub const GAP_MAX_S: f64 = 10.0;

/// A record and when to play it.
#[derive(Clone, Debug, PartialEq)]
pub struct Due {
    /// Since the start of the playback: time in the log divided by the speed. Never less than that of the record
    /// before.
    pub due_ns: u64,
    /// The record's own time, likewise since the start. Before `due_ns` if the record is behind others; negative if it
    /// is behind the first one. That of a record without a stamp is `due_ns`.
    pub stamp_ns: i64,
    /// What to play.
    pub record: LogRecord,
}

/// What became of the lines so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Scans played.
    pub scans: u64,
    /// Odometry played.
    pub odometries: u64,
    /// Records with stamps that are not believed.
    pub discarded: u64,
    /// Lines that are broken.
    pub malformed: u64,
    /// Lines of no kind we read.
    pub skipped: u64,
}

/// The speed is not a positive number.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("a log can't be played at {0} times its speed")]
pub struct BadSpeed(pub f64);

/// Plays a log. An item that is an error ends it: the file can't be read further. Broken lines are counted only.
///
/// ```
/// use rohrpost_robot::{carmen::{Reader, Settings}, playback::Playback};
/// let log = "ODOM 0 0 0 0 0 0 7 h 7\nODOM 0 0 0 0 0 0 6e-62 h 0\nODOM 1 0 0 0 0 0 8 h 8\n";
/// let mut playback = Playback::new(Reader::new(log.as_bytes(), Settings::default()), 2.0).unwrap();
/// let due: Vec<u64> = playback.by_ref().map(|item| item.unwrap().due_ns).collect();
/// assert_eq!((due, playback.counters().discarded), (vec![0, 500_000_000], 1));
/// ```
pub struct Playback<R> {
    reader: Reader<R>,
    speed: f64,
    span: Option<Span>,
    counters: Counters,
}

/// The stretch of the log's time that is believed so far.
struct Span {
    /// What counts as the start; pauses that were shortened move it on.
    start_s: f64,
    /// The largest stamp.
    latest_s: f64,
    /// A stamp far ahead that the next one may confirm.
    ahead_s: Option<f64>,
}

impl Span {
    /// Whether a record with this stamp is played.
    fn believe(&mut self, stamp_s: f64) -> bool {
        let confirmed = self.ahead_s.take().is_some_and(|ahead_s| (stamp_s - ahead_s).abs() <= GAP_MAX_S);
        if stamp_s < self.latest_s - BEHIND_MAX_S {
            return false;
        }
        let gap_s = stamp_s - self.latest_s;
        if gap_s > GAP_MAX_S {
            if !confirmed {
                self.ahead_s = Some(stamp_s);
                return false;
            }
            self.start_s += gap_s - GAP_MAX_S;
        }
        self.latest_s = self.latest_s.max(stamp_s);
        true
    }
}

impl<R: BufRead> Playback<R> {
    /// Plays at `speed` times the speed of the log.
    pub fn new(reader: Reader<R>, speed: f64) -> Result<Self, BadSpeed> {
        if !(speed.is_finite() && speed > 0.0) {
            return Err(BadSpeed(speed));
        }
        Ok(Self { reader, speed, span: None, counters: Counters::default() })
    }

    /// What became of the lines so far.
    pub fn counters(&self) -> Counters {
        Counters { skipped: self.reader.skipped(), ..self.counters }
    }

    /// A record, after it was believed.
    fn due(&self, record: LogRecord) -> Due {
        let (start_s, latest_s) = self.span.as_ref().map_or((0.0, 0.0), |span| (span.start_s, span.latest_s));
        let since_start_ns = |stamp_s: f64| ((stamp_s - start_s) / self.speed * 1e9).round();
        let stamp_ns = since_start_ns(record.stamp_s().unwrap_or(latest_s)) as i64;
        Due { due_ns: since_start_ns(latest_s) as u64, stamp_ns, record }
    }
}

impl<R: BufRead> Iterator for Playback<R> {
    type Item = Result<Due, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let record = match self.reader.next()? {
                Ok(record) => record,
                Err(LogError::Malformed { .. }) => {
                    self.counters.malformed += 1;
                    continue;
                }
                Err(end) => return Some(Err(end)),
            };
            if let Some(stamp_s) = record.stamp_s() {
                let first = || Span { start_s: stamp_s, latest_s: stamp_s, ahead_s: None };
                if !self.span.get_or_insert_with(first).believe(stamp_s) {
                    self.counters.discarded += 1;
                    continue;
                }
            }
            match &record {
                LogRecord::Scan { .. } => self.counters.scans += 1,
                LogRecord::Odometry { .. } => self.counters.odometries += 1,
                LogRecord::Param { .. } => {}
            }
            return Some(Ok(self.due(record)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::carmen::{Settings, open};
    use proptest::prelude::*;
    use std::path::Path;

    /// Due times in ms, and how many were discarded.
    fn play(stamps_s: &[f64], speed: f64) -> (Vec<u64>, u64) {
        let log: String = stamps_s.iter().map(|stamp| format!("ODOM 0 0 0 0 0 0 {stamp} h 0\n")).collect();
        let mut playback = Playback::new(Reader::new(log.as_bytes(), Settings::default()), speed).unwrap();
        let due = playback.by_ref().map(|item| item.unwrap().due_ns / 1_000_000).collect();
        (due, playback.counters().discarded)
    }

    #[test]
    fn due_times_follow_the_believable_stamps() {
        for (stamps_s, speed, due_ms, discarded, why) in [
            (vec![5.0, 5.5, 6.0], 1.0, vec![0, 500, 1000], 0, "as logged"),
            (vec![5.0, 5.5, 6.0], 4.0, vec![0, 125, 250], 0, "four times as fast"),
            (vec![5.0, 0.0, 5.5, 6e-62, 6.0], 1.0, vec![0, 500, 1000], 2, "stamps next to 0"),
            (vec![5.0, 5.5, 4.6, 5.75], 1.0, vec![0, 500, 500, 750], 0, "slightly behind is held"),
            (vec![5.0, 5.5, 4.4], 1.0, vec![0, 500], 1, "more than a second behind"),
            (vec![5.0, 5.5, 5.5, 5.5, 6.0], 1.0, vec![0, 500, 500, 500, 1000], 0, "equal stamps, each is played"),
            (vec![5.0, 5.5, 5.0, 5.5, 6.0], 1.0, vec![0, 500, 500, 500, 1000], 0, "two lines that stand there twice"),
            (vec![5.0, 1e9, 5.5], 1.0, vec![0, 500], 1, "one stamp of the far future"),
            (vec![5.0, 905.0, 905.5, 906.0], 1.0, vec![0, 10_000, 10_500], 1, "a pause of 900 s"),
            (vec![0.0, 1e9, 1e9, 1e9 + 1.0], 1.0, vec![0, 10_000, 11_000], 1, "the first stamp was wrong"),
        ] {
            assert_eq!(play(&stamps_s, speed), (due_ms, discarded), "{why}");
        }
    }

    #[test]
    fn stamps_are_the_records_own() {
        for (stamps_s, speed, own_ms, why) in [
            (vec![5.0, 5.5, 6.0], 2.0, vec![0, 250, 500], "twice as fast"),
            (vec![5.0, 5.5, 4.75, 6.0], 1.0, vec![0, 500, -250, 1000], "behind all others"),
            (vec![5.0, 905.0, 905.5, 905.25], 1.0, vec![0, 10_000, 9_750], "behind, after a pause of 900 s"),
        ] {
            let log: String = stamps_s.iter().map(|stamp| format!("ODOM 0 0 0 0 0 0 {stamp} h 0\n")).collect();
            let playback = Playback::new(Reader::new(log.as_bytes(), Settings::default()), speed).unwrap();
            let found: Vec<i64> = playback.map(|item| item.unwrap().stamp_ns / 1_000_000).collect();
            assert_eq!(found, own_ms, "{why}");
        }
    }

    #[test]
    fn speed_is_positive() {
        for speed in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Playback::new(Reader::new("".as_bytes(), Settings::default()), speed).is_err());
        }
    }

    #[test]
    fn a_log_with_wrong_stamps_is_played_and_counted() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/small.log.gz");
        let mut playback = Playback::new(open(&path, Settings::default()).unwrap(), 1.0).unwrap();
        let mut last_ns = 0;
        for item in playback.by_ref() {
            let due = item.unwrap();
            assert!(due.due_ns >= last_ns);
            last_ns = due.due_ns;
        }
        let expected = Counters { scans: 20, odometries: 100, discarded: 20, malformed: 2, skipped: 22 };
        assert_eq!(playback.counters(), expected);
    }

    proptest! {
        #[test]
        fn due_times_never_go_back(stamps_s in prop::collection::vec(-1e3..1e3, 0..60), speed in 0.1..10.0) {
            let (due_ms, discarded) = play(&stamps_s, speed);
            prop_assert!(due_ms.is_sorted());
            prop_assert_eq!(due_ms.len() as u64 + discarded, stamps_s.len() as u64);
        }
    }
}
