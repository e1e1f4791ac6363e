//! A time in a recording, as people write it.

use crate::measure::stream::{Offset, parse_offset, parse_stamp};
use rohrpost_recording::Info;

/// A time in a recording.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum RecordTime {
    /// ns since 1970.
    At(u64),
    /// So many ns after its first message.
    FromBegin(u64),
    /// So many ns before its last message.
    BeforeEnd(u64),
}

impl RecordTime {
    /// In ns since 1970.
    pub(super) fn in_file(self, info: &Info) -> u64 {
        match self {
            Self::At(ns) => ns,
            Self::FromBegin(ns) => info.first_ns.unwrap_or_default().saturating_add(ns),
            Self::BeforeEnd(ns) => info.last_ns.unwrap_or_default().saturating_sub(ns),
        }
    }
}

/// Reads seconds since 1970, or a duration with its sign.
pub(super) fn parse_time(text: &str) -> Result<RecordTime, String> {
    match parse_offset(text)? {
        Some(Offset::After(ns)) => return Ok(RecordTime::FromBegin(ns)),
        Some(Offset::Before(ns)) => return Ok(RecordTime::BeforeEnd(ns)),
        None => {}
    }
    let wrong = "write seconds since 1970 (1700000000.25), from the start (+10s), or before the end (-10s)";
    parse_stamp(text).map(RecordTime::At).map_err(|_| wrong.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_from_1970_from_the_begin_and_before_the_end() {
        for (text, time) in [
            ("1700000000.25", RecordTime::At(1_700_000_000_250_000_000)),
            ("+10s", RecordTime::FromBegin(10_000_000_000)),
            ("-1.5s", RecordTime::BeforeEnd(1_500_000_000)),
        ] {
            assert_eq!(parse_time(text), Ok(time), "{text}");
        }
        for (wrong, words) in
            [("now", "before the end (-10s)"), ("+10", "has no unit"), ("--1s", "begin with a number")]
        {
            let told = parse_time(wrong).unwrap_err();
            assert!(told.contains(words), "{wrong}: {told}");
        }
    }
}
