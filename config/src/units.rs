//! Durations, sizes and rates of links as a file writes them, a number and its unit: `"200 ms"`, `"1 KiB"`, `"100
//! Mbit/s"`.
//!
//! A bare number is refused: a mix-up of milliseconds and seconds moves robots.

use std::time::Duration;

/// Units of time and what one is in nanoseconds, largest first.
const TIME: [(&str, u64); 6] = [
    ("h", 3_600_000_000_000),
    ("min", 60_000_000_000),
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1_000),
    ("ns", 1),
];

/// Units of size and what one is in bytes, largest first.
const SIZE: [(&str, u64); 4] = [("GiB", 1 << 30), ("MiB", 1 << 20), ("KiB", 1 << 10), ("B", 1)];

/// Units of a link's rate and what one is in bits a second, largest first; thousands, as on the box.
const RATE: [(&str, u64); 4] = [("Gbit/s", 1_000_000_000), ("Mbit/s", 1_000_000), ("kbit/s", 1_000), ("bit/s", 1)];

/// Why a text is not a duration, a size or a rate.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// It does not begin with a number.
    #[error("`{0}` does not begin with a number; write {1}")]
    Number(String, &'static str),
    /// A number alone.
    #[error("`{0}` has no unit; write {1}")]
    NoUnit(String, &'static str),
    /// A unit that is not known.
    #[error("`{0}`: `{1}` is no unit here; write {2}")]
    Unit(String, String, &'static str),
    /// More than 64 bits hold.
    #[error("`{0}` is too large; write {1}")]
    TooLarge(String, &'static str),
    /// A fraction of the smallest unit.
    #[error("`{0}` is finer than one {1}; write a coarser value")]
    TooFine(String, &'static str),
}

/// Reads a duration: a number, then h, min, s, ms, us (or µs) or ns.
///
/// ```
/// # use rohrpost_config::parse_duration;
/// # use std::time::Duration;
/// assert_eq!(parse_duration("1.5 ms"), Ok(Duration::from_micros(1500)));
/// assert!(parse_duration("200").is_err());
/// ```
pub fn parse_duration(text: &str) -> Result<Duration, UnitError> {
    parse(
        &text.replace('µ', "u"),
        text,
        &TIME,
        "ns",
        "a duration with its unit (h, min, s, ms, us), such as \"200 ms\"",
    )
    .map(Duration::from_nanos)
}

/// Reads a size in bytes: a number, then B, KiB, MiB or GiB.
///
/// ```
/// # use rohrpost_config::parse_size;
/// assert_eq!(parse_size("2 KiB"), Ok(2048));
/// assert!(parse_size("2 KB").is_err());
/// ```
pub fn parse_size(text: &str) -> Result<u64, UnitError> {
    parse(text, text, &SIZE, "B", "a size with its unit (B, KiB, MiB), such as \"1 KiB\"")
}

/// Reads the rate of a link in bits a second: a number, then bit/s, kbit/s, Mbit/s or Gbit/s.
///
/// ```
/// # use rohrpost_config::parse_rate;
/// assert_eq!(parse_rate("2.5 Gbit/s"), Ok(2_500_000_000));
/// assert!(parse_rate("100 MB/s").is_err());
/// ```
pub fn parse_rate(text: &str) -> Result<u64, UnitError> {
    parse(text, text, &RATE, "bit/s", "a rate with its unit (kbit/s, Mbit/s, Gbit/s), such as \"100 Mbit/s\"")
}

/// Writes a duration as [`parse_duration`] reads it, in the largest unit that keeps it whole.
pub fn duration_text(duration: Duration) -> String {
    let nanos = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
    // Two minutes and less in seconds: "60 s" is what people write.
    let units = if nanos <= 120_000_000_000 { &TIME[2..] } else { &TIME };
    if nanos == 0 { "0 s".into() } else { whole(nanos, units) }
}

/// Writes a duration as people say it, with a fraction: "5.46 ms". [`parse_duration`] reads it back.
///
/// ```
/// # use rohrpost_config::duration_decimal;
/// # use std::time::Duration;
/// assert_eq!(duration_decimal(Duration::from_micros(5460)), "5.46 ms");
/// assert_eq!(duration_decimal(Duration::from_micros(460)), "460 us");
/// ```
pub fn duration_decimal(duration: Duration) -> String {
    let nanos = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
    let Some((unit, one)) = TIME[2..].iter().find(|(_, one)| nanos >= *one) else { return "0 s".into() };
    let fraction = format!("{:0width$}", nanos % one, width = one.ilog10() as usize);
    let number = format!("{}.{}", nanos / one, if *one == 1 { "" } else { &fraction });
    format!("{} {unit}", number.trim_end_matches('0').trim_end_matches('.'))
}

/// Writes a size as [`parse_size`] reads it, in the largest unit that keeps it whole.
pub fn size_text(bytes: u64) -> String {
    if bytes == 0 { "0 B".into() } else { whole(bytes, &SIZE) }
}

/// Writes a size that need not be exact: down to whole KiB.
pub(crate) fn size_about(bytes: u64) -> String {
    size_text(bytes / 1024 * 1024)
}

/// Writes a rate as [`parse_rate`] reads it, in the largest unit that keeps it whole.
pub fn rate_text(bits_s: u64) -> String {
    if bits_s == 0 { "0 bit/s".into() } else { whole(bits_s, &RATE) }
}

/// A number of things, such as "1 module" and "3 modules".
pub(crate) fn count_text(number: usize, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}

fn whole(value: u64, units: &[(&str, u64)]) -> String {
    let (unit, one) = units.iter().find(|(_, one)| value.is_multiple_of(*one)).unwrap_or(&("", 1));
    format!("{} {unit}", value / one)
}

fn parse(
    text: &str,
    written: &str,
    units: &[(&str, u64)],
    smallest: &'static str,
    right: &'static str,
) -> Result<u64, UnitError> {
    let text = text.trim();
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = (&text[..end], text[end..].trim_start());
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    if whole.is_empty() || fraction.is_empty() || fraction.contains('.') {
        return Err(UnitError::Number(written.into(), right));
    }
    if unit.is_empty() {
        return Err(UnitError::NoUnit(written.into(), right));
    }
    let Some((_, one)) = units.iter().find(|(name, _)| *name == unit) else {
        return Err(UnitError::Unit(written.into(), unit.into(), right));
    };
    let too_large = || UnitError::TooLarge(written.into(), right);
    let whole: u64 = whole.parse().map_err(|_| too_large())?;
    // Decimal digits by hand: 0.1 s is exactly 100 ms, which binary fractions do not promise.
    let fraction = fraction.trim_end_matches('0');
    let mut part = u128::from(*one);
    let digits: u128 = if fraction.is_empty() { 0 } else { fraction.parse().map_err(|_| too_large())? };
    let scale = 10u128.checked_pow(fraction.len() as u32).ok_or_else(too_large)?;
    part = part.checked_mul(digits).ok_or_else(too_large)?;
    if !part.is_multiple_of(scale) {
        return Err(UnitError::TooFine(written.into(), smallest));
    }
    let part = u64::try_from(part / scale).map_err(|_| too_large())?;
    whole.checked_mul(*one).and_then(|whole| whole.checked_add(part)).ok_or_else(too_large)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn durations_mean_what_they_say() {
        for (text, nanos) in [
            ("200 ms", 200_000_000),
            ("2s", 2_000_000_000),
            ("500 us", 500_000),
            ("500 µs", 500_000),
            ("0.1 s", 100_000_000),
            ("1 min", 60_000_000_000),
            ("0 s", 0),
        ] {
            assert_eq!(parse_duration(text), Ok(Duration::from_nanos(nanos)), "{text}");
        }
    }

    #[test]
    fn mistakes_show_an_example() {
        let right = "write a duration with its unit (h, min, s, ms, us), such as \"200 ms\"";
        for (text, message) in [
            ("200", format!("`200` has no unit; {right}")),
            ("200 mz", format!("`200 mz`: `mz` is no unit here; {right}")),
            ("soon", format!("`soon` does not begin with a number; {right}")),
            ("-1 s", format!("`-1 s` does not begin with a number; {right}")),
            ("1..2 s", format!("`1..2 s` does not begin with a number; {right}")),
            ("", format!("`` does not begin with a number; {right}")),
            ("99999999999999999999 s", format!("`99999999999999999999 s` is too large; {right}")),
            ("9999999999 h", format!("`9999999999 h` is too large; {right}")),
            ("0.5 ns", "`0.5 ns` is finer than one ns; write a coarser value".into()),
        ] {
            assert_eq!(parse_duration(text).unwrap_err().to_string(), message);
        }
        for (text, message) in [
            ("1024", "`1024` has no unit; write a size with its unit (B, KiB, MiB), such as \"1 KiB\""),
            ("1 KB", "`1 KB`: `KB` is no unit here; write a size with its unit (B, KiB, MiB), such as \"1 KiB\""),
            ("0.3 KiB", "`0.3 KiB` is finer than one B; write a coarser value"),
        ] {
            assert_eq!(parse_size(text).unwrap_err().to_string(), message);
        }
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(value: u64) {
            let duration = Duration::from_nanos(value);
            prop_assert_eq!(parse_duration(&duration_text(duration)), Ok(duration));
            prop_assert_eq!(parse_duration(&duration_decimal(duration)), Ok(duration));
            prop_assert_eq!(parse_size(&size_text(value)), Ok(value));
            prop_assert_eq!(parse_rate(&rate_text(value)), Ok(value));
        }

        #[test]
        fn no_text_brings_it_down(text: String) {
            let _ = (parse_duration(&text), parse_size(&text), parse_rate(&text));
        }
    }
}
