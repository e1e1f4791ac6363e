//! The two records around a time, or exactly why there are none.

use super::stamp::stamp_text;
use crate::terminal::{Failure, say};
use rohrpost_mailbox::{Around, RecordInfo, Stamp};
use std::process::ExitCode;
use std::time::Duration;

/// Why there are no two records around a time, or no value.
#[derive(Debug, serde::Serialize)]
pub(super) struct AroundRefusal {
    answer: &'static str,
    /// How far it is.
    by_ns: Option<u64>,
    newest_epoch: Option<u64>,
    text: String,
    /// Whether records that are still to be written can change it.
    #[serde(skip)]
    pub(super) may_change: bool,
}

impl AroundRefusal {
    fn new(answer: &'static str, by_ns: Option<u64>, text: impl Into<String>) -> Self {
        Self { answer, by_ns, newest_epoch: None, text: text.into(), may_change: false }
    }

    pub(super) fn empty() -> Self {
        Self { may_change: true, ..Self::new("empty", None, "nothing was written yet") }
    }

    pub(super) fn before_oldest(at: Stamp, by_ns: u64) -> Self {
        let first = stamp_text(at.ns.saturating_add(by_ns));
        let text = format!("the record before that time is not there; the first time with two around it is {first}");
        Self::new("before oldest", Some(by_ns), text)
    }

    fn not_yet(by_ns: u64) -> Self {
        let by = stamp_text(by_ns);
        let text = format!("not yet: nearer records may come until stamps are at most {by} s further");
        Self { may_change: true, ..Self::new("not yet", Some(by_ns), text) }
    }

    /// The two records are too far apart.
    pub(super) fn gap(gap_ns: u64, longest: Duration) -> Self {
        let text = format!(
            "that time lies in a gap of {} s; --gap allows {}",
            stamp_text(gap_ns),
            rohrpost_config::duration_text(longest)
        );
        Self::new("gap", Some(gap_ns), text)
    }

    fn other_epoch(at: Stamp, newest: u64) -> Self {
        let text = format!(
            "no two records of epoch {} are around that time, and none will be; the newest record is of epoch \
             {newest}, see --epoch",
            at.epoch
        );
        Self { newest_epoch: Some(newest), ..Self::new("other epoch", None, text) }
    }

    /// Prints it: an object, or an error about this stream.
    pub(super) fn told(&self, stream: &str, json: bool) -> Result<ExitCode, Failure> {
        if json {
            say(serde_json::to_string(self)?);
            return Ok(ExitCode::FAILURE);
        }
        Err(format!("stream {stream}: {}", self.text).into())
    }
}

/// The two records around a time; or why not, and how far it is.
pub(super) fn around_or_refusal(at: Stamp, answer: &Around) -> Result<(RecordInfo, RecordInfo), AroundRefusal> {
    match *answer {
        Around::Records { before, after } => Ok((before, after)),
        Around::Empty => Err(AroundRefusal::empty()),
        Around::BeforeOldest { by_ns } => Err(AroundRefusal::before_oldest(at, by_ns)),
        Around::NotYet { by_ns } => Err(AroundRefusal::not_yet(by_ns)),
        Around::OtherEpoch { newest } => Err(AroundRefusal::other_epoch(at, newest)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_answer_that_is_no_record_says_exactly_why() {
        let at = Stamp { epoch: 3, ns: 2_000_000_000 };
        for (answer, may_change, words) in [
            (Around::Empty, true, "nothing was written yet"),
            (
                Around::BeforeOldest { by_ns: 5 },
                false,
                "the record before that time is not there; the first time with two around it is 2.000000005",
            ),
            (
                Around::NotYet { by_ns: 1_500_000_000 },
                true,
                "not yet: nearer records may come until stamps are at most 1.500000000 s further",
            ),
            (
                Around::OtherEpoch { newest: 4 },
                false,
                "no two records of epoch 3 are around that time, and none will be; the newest record is of epoch 4, \
                 see --epoch",
            ),
        ] {
            let refusal = around_or_refusal(at, &answer).unwrap_err();
            assert_eq!((refusal.text.as_str(), refusal.may_change), (words, may_change), "{answer:?}");
        }
        let gap = AroundRefusal::gap(1_500_000_000, Duration::from_millis(200));
        assert_eq!(gap.text, "that time lies in a gap of 1.500000000 s; --gap allows 200 ms");
    }

    #[test]
    fn the_two_records_are_handed_on() {
        let record = |sequence| RecordInfo {
            sequence,
            stamp: Stamp { epoch: 3, ns: 1 },
            written_ns: 1,
            len_bytes: 0,
            incarnation: 1,
        };
        let answer = Around::Records { before: record(4), after: record(5) };
        let (before, after) = around_or_refusal(Stamp { epoch: 3, ns: 1 }, &answer).unwrap();
        assert_eq!((before.sequence, after.sequence), (4, 5));
    }
}
