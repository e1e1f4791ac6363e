//! A time to look for, as people and programs write it.

use super::stamp::{Offset, parse_offset, parse_stamp};
use rohrpost_mailbox::Stamp;

/// A time to look for in a stream.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum StreamMoment {
    /// ns since 1970.
    At(u64),
    /// So many ns before the newest record.
    BeforeNewest(u64),
    /// So many ns after the newest record.
    AfterNewest(u64),
}

impl StreamMoment {
    /// With this newest stamp; of the newest record's epoch, unless another is asked for.
    pub(super) fn stamp(self, newest: Stamp, epoch: Option<u64>) -> Stamp {
        let ns = match self {
            Self::At(ns) => ns,
            Self::BeforeNewest(by_ns) => newest.ns.saturating_sub(by_ns),
            Self::AfterNewest(by_ns) => newest.ns.saturating_add(by_ns),
        };
        Stamp { epoch: epoch.unwrap_or(newest.epoch), ns }
    }
}

/// Reads a stamp in seconds, a whole number of nanoseconds, or a duration with its sign. A whole number that is too
/// large for seconds is one of nanoseconds: those of each time later than 18.4 s after the beginning of 1970 are.
pub(super) fn parse_moment(text: &str) -> Result<StreamMoment, String> {
    match parse_offset(text)? {
        Some(Offset::Before(ns)) => return Ok(StreamMoment::BeforeNewest(ns)),
        Some(Offset::After(ns)) => return Ok(StreamMoment::AfterNewest(ns)),
        None => {}
    }
    let whole = || text.parse().ok().filter(|_| text.bytes().all(|digit| digit.is_ascii_digit()));
    parse_stamp(text).ok().or_else(whole).map(StreamMoment::At).ok_or_else(|| {
        "write seconds as stamps are printed (1700000000.25), ns since 1970, or how far from the newest record (-1.5s)"
            .into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_as_they_are_printed_and_from_the_newest() {
        for (text, moment) in [
            ("1700000000.25", StreamMoment::At(1_700_000_000_250_000_000)),
            ("1700000000250000000", StreamMoment::At(1_700_000_000_250_000_000)),
            ("2", StreamMoment::At(2_000_000_000)),
            ("18446744073", StreamMoment::At(18_446_744_073_000_000_000)),
            ("18446744074", StreamMoment::At(18_446_744_074)),
            ("-1.5s", StreamMoment::BeforeNewest(1_500_000_000)),
            ("-20 ms", StreamMoment::BeforeNewest(20_000_000)),
            ("+1 ns", StreamMoment::AfterNewest(1)),
            ("-0s", StreamMoment::BeforeNewest(0)),
        ] {
            assert_eq!(parse_moment(text), Ok(moment), "{text}");
        }
        for (wrong, words) in [
            ("", "write seconds as stamps are printed"),
            ("1.5s", "write seconds as stamps are printed"),
            ("now", "how far from the newest record (-1.5s)"),
            ("99999999999999999999", "ns since 1970"),
            ("-1.5", "has no unit"),
            ("--1s", "does not begin with a number"),
        ] {
            let told = parse_moment(wrong).unwrap_err();
            assert!(told.contains(words), "{wrong}: {told}");
        }
    }

    #[test]
    fn a_time_is_counted_from_the_newest_record_and_of_its_epoch() {
        let newest = Stamp { epoch: 4, ns: 100 };
        assert_eq!(StreamMoment::BeforeNewest(30).stamp(newest, None), Stamp { epoch: 4, ns: 70 });
        assert_eq!(StreamMoment::BeforeNewest(300).stamp(newest, None), Stamp { epoch: 4, ns: 0 });
        assert_eq!(StreamMoment::AfterNewest(30).stamp(newest, Some(3)), Stamp { epoch: 3, ns: 130 });
        assert_eq!(StreamMoment::At(7).stamp(newest, None), Stamp { epoch: 4, ns: 7 });
    }
}
