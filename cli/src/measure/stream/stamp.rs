//! Stamps as seconds with nine decimals, exact both ways.

use rohrpost_config::parse_duration;

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
}
