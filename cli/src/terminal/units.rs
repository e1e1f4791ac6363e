//! Times, rates and bytes: parsed from arguments, and formatted for output.

use crate::terminal::Failure;
use crate::terminal::table::time;
use rohrpost_builtin::format::iso;
use rohrpost_config::{parse_size, size_text};
use rohrpost_launch::{Event, events};
use std::sync::mpsc::Receiver;
use std::time::Duration;

/// Longest sleep without a check for Ctrl-C.
pub(crate) const LOOK: Duration = Duration::from_millis(50);
/// Upper limit of a time; clocks can add it without an overflow.
const SECONDS_MAX: f64 = 365.0 * 86_400.0;
/// Lowest rate: packages carry the period as whole microseconds in 32 bits, at most 71 minutes.
const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=1e6;

/// A moment to the second, such as `2026-11-21 10:40:12 UTC`.
pub(crate) fn date(time_ns: u64) -> String {
    let text = iso(time_ns).replace('T', " ");
    format!("{} UTC", text.split('.').next().unwrap_or_default())
}

/// A time argument in seconds.
pub(crate) fn seconds(seconds: f64) -> Result<Duration, Failure> {
    if (0.0..=SECONDS_MAX).contains(&seconds) {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err(format!("{seconds} s is no time to wait; write 0 to {SECONDS_MAX} (a year), such as 1.5").into())
    }
}

/// A rate argument, a second.
pub(crate) fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| RATES_HZ.contains(rate));
    rate.ok_or_else(|| format!("write {} to {} a second", RATES_HZ.start(), RATES_HZ.end()))
}

/// The same, where 0 means all.
pub(crate) fn rate_or_all(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(0.0) => Ok(0.0),
        _ => rate(text).map_err(|why| format!("write 0 for each value, or {}", why.trim_start_matches("write "))),
    }
}

/// A size argument: bytes, or a number with its unit.
pub(crate) fn size_argument(text: &str) -> Result<u32, String> {
    let bytes = text.parse::<u64>().or_else(|_| parse_size(text)).map_err(|error| error.to_string())?;
    u32::try_from(bytes).map_err(|_| format!("at most {}", size_text(u32::MAX.into())))
}

/// Signals, and whether Ctrl-C was pressed.
pub(crate) struct Stop(Receiver<Event>);

impl Stop {
    pub(crate) fn new() -> Result<Self, Failure> {
        Ok(Self(events()?))
    }

    /// Waits, and returns whether the end was requested meanwhile.
    pub(crate) fn within(&self, wait: Duration) -> bool {
        matches!(self.0.recv_timeout(wait), Ok(Event::Stop))
    }
}

/// So many of a thing, in words: `1 day`, `2 mailboxes`.
pub(crate) fn counted(count: impl Into<u128>, one: &str) -> String {
    let (count, end) = (count.into(), if one.ends_with('x') { "es" } else { "s" });
    if count == 1 { format!("1 {one}") } else { format!("{count} {one}{end}") }
}

/// A short time given in seconds, in the unit that suits it.
pub(crate) fn short(seconds: f64) -> String {
    time(Duration::try_from_secs_f64(seconds).unwrap_or_default())
}

/// Four digits or more: jitter is small compared to the interval.
pub(crate) fn fine(seconds: f64) -> String {
    let us = seconds * 1e6;
    match us {
        us if us < 999.95 => format!("{us:.1} µs"),
        us if us < 9_999.5 => format!("{:.3} ms", us / 1e3),
        us if us < 9_999_500.0 => format!("{:.2} ms", us / 1e3),
        us => format!("{:.2} s", us / 1e6),
    }
}

/// A rate with two digits or more.
pub(crate) fn per_second(rate: f64) -> String {
    match rate {
        rate if rate < 0.95 => format!("{rate:.2}/s"),
        rate if rate < 9.5 => format!("{rate:.1}/s"),
        rate => format!("{rate:.0}/s"),
    }
}

/// Bytes in the unit that suits them: powers of 1000, as rates are given.
pub(crate) fn bytes(bytes: f64) -> String {
    match bytes {
        b if b < 999.5 => format!("{b:.0} B"),
        b if b < 999_500.0 => format!("{:.2} kB", b / 1e3),
        b => format!("{:.2} MB", b / 1e6),
    }
}

/// A size in its largest unit, with at most one decimal: powers of 1024, as memory is given.
pub(crate) fn size(bytes: u64) -> String {
    let (unit, one) = [("GiB", 1u64 << 30), ("MiB", 1 << 20), ("KiB", 1 << 10)]
        .into_iter()
        .find(|(_, one)| bytes >= *one)
        .unwrap_or(("B", 1));
    if bytes.is_multiple_of(one) { size_text(bytes) } else { format!("{:.1} {unit}", bytes as f64 / one as f64) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_has_a_unit_or_is_in_bytes() {
        for (text, bytes) in [("2048", 2048), ("0", 0), ("1MiB", 1 << 20), ("1.5 KiB", 1536), ("8 B", 8)] {
            assert_eq!(size_argument(text), Ok(bytes), "{text}");
        }
        for (wrong, words) in [
            ("4GiB", "at most 4294967295 B"),
            ("1MB", "`MB` is no unit here; write a size with its unit (B, KiB, MiB)"),
            ("big", "does not begin with a number"),
            ("-1", "does not begin with a number"),
            ("1.5", "has no unit"),
        ] {
            let told = size_argument(wrong).unwrap_err();
            assert!(told.contains(words), "{wrong}: {told}");
        }
    }

    #[test]
    fn times_and_rates_have_bounds() {
        for wrong in [-1.0, -1e-9, 1e19, SECONDS_MAX * 1.01, f64::NAN, f64::INFINITY] {
            let told = seconds(wrong).unwrap_err().to_string();
            assert!(told.contains("is no time to wait; write 0 to 31536000 (a year)"), "{told}");
        }
        assert_eq!(seconds(0.0).unwrap(), Duration::ZERO);
        assert_eq!(seconds(SECONDS_MAX).unwrap(), Duration::from_secs(31_536_000));
        for wrong in ["0", "-1", "1e-19", "1e7", "nan", "inf", "fast"] {
            assert_eq!(rate(wrong).unwrap_err(), "write 0.001 to 1000000 a second");
        }
        assert_eq!((rate("0.001"), rate("1e6"), rate_or_all("0")), (Ok(0.001), Ok(1e6), Ok(0.0)));
        assert_eq!(rate_or_all("-1").unwrap_err(), "write 0 for each value, or 0.001 to 1000000 a second");
    }
}
