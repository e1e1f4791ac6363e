//! The text form: `loss=5%,delay=2ms,jitter=1ms,duplicate=1%,reorder=5%,rate=10MiB,corrupt=0.1%,seed=7`.

use super::{DELAY_MAX, ImpairmentSettings, Probability};
use rohrpost_config::{duration_text, nearest, parse_duration, parse_size, size_text};
use std::fmt::{self, Display};
use std::str::FromStr;
use std::time::Duration;

const KEYS: [&str; 8] = ["loss", "delay", "jitter", "duplicate", "reorder", "rate", "corrupt", "seed"];
const PERCENT: u32 = Probability::ALL / 100;

/// Why a text does not say how bad a network is.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImpairmentSettingsError {
    /// A part without a `=`.
    #[error("`{0}` has no value; write key=value, separated by commas, such as loss=5%,delay=2ms")]
    NoValue(String),
    /// A key that there is not.
    #[error("`{0}`: there is no `{1}`; {2}")]
    Key(String, String, String),
    /// The same key again.
    #[error("`{0}`: `{1}` is given twice; drop one")]
    Twice(String, &'static str),
    /// No share.
    #[error("`{0}`: write a share from 0% to 100%, such as {1}=5%")]
    Share(String, &'static str),
    /// No duration, or too long a one.
    #[error("`{0}`: write a duration of at most 10s, such as {1}=2ms")]
    Duration(String, &'static str),
    /// No size.
    #[error("`{0}`: write bytes a second with their unit (B, KiB, MiB), such as rate=10MiB")]
    Rate(String),
    /// No number.
    #[error("`{0}`: write a whole number, such as seed=7")]
    Seed(String),
}

impl FromStr for ImpairmentSettings {
    type Err = ImpairmentSettingsError;

    /// Reads the text form; an empty text is a network without faults.
    fn from_str(text: &str) -> Result<Self, ImpairmentSettingsError> {
        let mut settings = Self::default();
        let mut known: Vec<&'static str> = Vec::new();
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            let (key, value) = part.split_once('=').ok_or_else(|| ImpairmentSettingsError::NoValue(part.into()))?;
            let (key, value) = (key.trim(), value.trim());
            let Some(key) = KEYS.into_iter().find(|known| *known == key) else {
                let right = match nearest(key, KEYS) {
                    Some(known) => format!("did you mean `{known}`?"),
                    None => format!("there are {}", KEYS.join(", ")),
                };
                return Err(ImpairmentSettingsError::Key(part.into(), key.into(), right));
            };
            if known.contains(&key) {
                return Err(ImpairmentSettingsError::Twice(part.into(), key));
            }
            known.push(key);
            settings.set(part, key, value)?;
        }
        Ok(settings)
    }
}

impl ImpairmentSettings {
    fn set(&mut self, part: &str, key: &'static str, value: &str) -> Result<(), ImpairmentSettingsError> {
        let share = || share(value).ok_or_else(|| ImpairmentSettingsError::Share(part.into(), key));
        let duration = || {
            let duration = parse_duration(value).ok().filter(|duration| *duration <= DELAY_MAX);
            duration.ok_or_else(|| ImpairmentSettingsError::Duration(part.into(), key))
        };
        match key {
            "loss" => self.loss = share()?,
            "duplicate" => self.duplicate = share()?,
            "reorder" => self.reorder = share()?,
            "corrupt" => self.corrupt = share()?,
            "delay" => self.delay = duration()?,
            "jitter" => self.jitter = duration()?,
            "rate" => {
                let rate = parse_size(value).ok().filter(|rate| *rate > 0);
                self.rate_bytes_s = Some(rate.ok_or_else(|| ImpairmentSettingsError::Rate(part.into()))?);
            }
            _ => self.seed = value.parse().map_err(|_| ImpairmentSettingsError::Seed(part.into()))?,
        }
        Ok(())
    }
}

/// A percentage of at most four decimals, by its digits: 0.1% is exactly 1000 millionths.
fn share(text: &str) -> Option<Probability> {
    let number = text.strip_suffix('%')?.trim_end();
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(whole) || !digits(fraction) || fraction.len() > 4 {
        return None;
    }
    let fraction: u32 = format!("{fraction:0<4}").parse().ok()?;
    let millionths = whole.parse::<u32>().ok()?.checked_mul(PERCENT)?.checked_add(fraction)?;
    (millionths <= Probability::ALL).then_some(Probability(millionths))
}

impl Display for Probability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (whole, fraction) = (self.0 / PERCENT, self.0 % PERCENT);
        if fraction == 0 {
            return write!(f, "{whole}%");
        }
        write!(f, "{whole}.{}%", format!("{fraction:04}").trim_end_matches('0'))
    }
}

impl Display for ImpairmentSettings {
    /// What differs from a network without faults, and the seed.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shares = |key, share: Probability| (share.0 > 0).then(|| format!("{key}={share},"));
        let durations = |key, duration: Duration| {
            (!duration.is_zero()).then(|| format!("{key}={},", duration_text(duration).replace(' ', "")))
        };
        let parts = [
            shares("loss", self.loss),
            durations("delay", self.delay),
            durations("jitter", self.jitter),
            shares("duplicate", self.duplicate),
            shares("reorder", self.reorder),
            self.rate_bytes_s.map(|rate| format!("rate={},", size_text(rate).replace(' ', ""))),
            shares("corrupt", self.corrupt),
        ];
        for part in parts.into_iter().flatten() {
            f.write_str(&part)?;
        }
        write!(f, "seed={}", self.seed)
    }
}
