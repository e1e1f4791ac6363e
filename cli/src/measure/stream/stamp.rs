//! Stamps as seconds with nine decimals, exact both ways, and times to look for, as people and programs write them.

use rohrpost_config::parse_duration;
use rohrpost_mailbox::Stamp;

const BILLION: u64 = 1_000_000_000;
const DECIMALS: usize = 9;

/// Nanoseconds as seconds.
pub(crate) fn stamp_text(ns: u64) -> String {
    format!("{}.{:09}", ns / BILLION, ns % BILLION)
}

/// Reads seconds, with at most nine decimals.
pub(crate) fn parse_stamp(text: &str) -> Result<u64, String> {
    let wrong = || "write seconds, with at most nine decimals, such as 1700000000.25".to_owned();
    let (seconds, decimals) = text.split_once('.').unwrap_or((text, "0"));
    let is_number = |digits: &str| !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    if !is_number(seconds) || !is_number(decimals) || decimals.len() > DECIMALS {
        return Err(wrong());
    }
    let seconds: u64 = seconds.parse().map_err(|_| wrong())?;
    let ns: u64 = format!("{decimals:0<DECIMALS$}").parse().map_err(|_| wrong())?;
    seconds.checked_mul(BILLION).and_then(|whole| whole.checked_add(ns)).ok_or_else(wrong)
}

/// How far a time is from another one, ns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Offset {
    /// Before it: `-1.5s`.
    Before(u64),
    /// Behind it: `+1.5s`.
    After(u64),
}

/// Reads a duration with its sign; none for a text that begins with no sign.
pub(crate) fn parse_offset(text: &str) -> Result<Option<Offset>, String> {
    let ns = |text: &str| {
        let duration = parse_duration(text).map_err(|error| error.to_string())?;
        u64::try_from(duration.as_nanos()).map_err(|_| format!("`{text}` is too long"))
    };
    match (text.strip_prefix('-'), text.strip_prefix('+')) {
        (Some(before), _) => ns(before).map(|ns| Some(Offset::Before(ns))),
        (_, Some(after)) => ns(after).map(|ns| Some(Offset::After(ns))),
        (None, None) => Ok(None),
    }
}

/// A time to look for in a stream.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum StreamMoment {
    /// ns since 1970.
    At(u64),
    /// So far from the newest record.
    FromNewest(Offset),
}

impl StreamMoment {
    /// With this newest stamp; of the newest record's epoch, unless another is asked for.
    pub(super) fn stamp(self, newest: Stamp, epoch: Option<u64>) -> Stamp {
        let ns = match self {
            Self::At(ns) => ns,
            Self::FromNewest(Offset::Before(by_ns)) => newest.ns.saturating_sub(by_ns),
            Self::FromNewest(Offset::After(by_ns)) => newest.ns.saturating_add(by_ns),
        };
        Stamp { epoch: epoch.unwrap_or(newest.epoch), ns }
    }
}

/// Reads a stamp in seconds, a whole number of nanoseconds, or a duration with its sign. A whole number that is too
/// large for seconds is one of nanoseconds: those of each time later than 18.4 s after the beginning of 1970 are.
pub(super) fn parse_moment(text: &str) -> Result<StreamMoment, String> {
    if let Some(offset) = parse_offset(text)? {
        return Ok(StreamMoment::FromNewest(offset));
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
    fn stamps_are_read_back_exactly_as_they_are_printed() {
        for ns in [0, 1, 999_999_999, 1_700_000_000_250_000_000, u64::MAX] {
            assert_eq!(parse_stamp(&stamp_text(ns)), Ok(ns));
        }
        assert_eq!((parse_stamp("7"), parse_stamp("7.25")), (Ok(7_000_000_000), Ok(7_250_000_000)));
    }

    #[test]
    fn what_is_no_stamp_is_refused() {
        for wrong in
            ["", ".", "1.", ".5", "-1", "+1", "1e9", "now", "1.0000000001", "1.2.3", "99999999999", "18446744074"]
        {
            let told = parse_stamp(wrong).unwrap_err();
            assert_eq!(told, "write seconds, with at most nine decimals, such as 1700000000.25", "{wrong}");
        }
    }

    #[test]
    fn times_are_read_as_they_are_printed_and_from_the_newest() {
        for (text, moment) in [
            ("1700000000.25", StreamMoment::At(1_700_000_000_250_000_000)),
            ("1700000000250000000", StreamMoment::At(1_700_000_000_250_000_000)),
            ("2", StreamMoment::At(2_000_000_000)),
            ("18446744073", StreamMoment::At(18_446_744_073_000_000_000)),
            ("18446744074", StreamMoment::At(18_446_744_074)),
            ("-1.5s", StreamMoment::FromNewest(Offset::Before(1_500_000_000))),
            ("-20 ms", StreamMoment::FromNewest(Offset::Before(20_000_000))),
            ("+1 ns", StreamMoment::FromNewest(Offset::After(1))),
            ("-0s", StreamMoment::FromNewest(Offset::Before(0))),
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
        assert_eq!(StreamMoment::FromNewest(Offset::Before(30)).stamp(newest, None), Stamp { epoch: 4, ns: 70 });
        assert_eq!(StreamMoment::FromNewest(Offset::Before(300)).stamp(newest, None), Stamp { epoch: 4, ns: 0 });
        assert_eq!(StreamMoment::FromNewest(Offset::After(30)).stamp(newest, Some(3)), Stamp { epoch: 3, ns: 130 });
        assert_eq!(StreamMoment::At(7).stamp(newest, None), Stamp { epoch: 4, ns: 7 });
    }
}
