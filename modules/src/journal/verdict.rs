//! What an exact replay found.

use crate::output::plain::line;
use serde::{Deserialize, Serialize};

/// What an exact replay found, and how far it came.
///
/// ```
/// use rohrpost_modules::journal::{ReplayReport, ReplayVerdict};
///
/// let verdict = ReplayVerdict::Identical { is_whole: true };
/// let report = ReplayReport { verdict, events: 3, outputs: 1, ..ReplayReport::default() };
/// assert_eq!(report.to_string(), "identical: 3 events, 1 outputs");
/// ```
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ReplayReport {
    /// How it ended.
    pub verdict: ReplayVerdict,
    /// Events that were replayed.
    pub events: u64,
    /// Outputs that were compared, all the same.
    pub outputs: u64,
    /// System time of the first event, ns.
    pub first_ns: u64,
    /// And of the last one.
    pub last_ns: u64,
    /// Why the module was not made; none if it was.
    pub not_made: Option<String>,
}

/// How an exact replay ended.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum ReplayVerdict {
    /// All that was noted is the same.
    Identical {
        /// The journal goes on to the module's end; else it was killed, or is recorded no further.
        is_whole: bool,
    },
    /// The first thing that is not.
    Differs(Difference),
    /// From here on nothing can be said; why.
    Refused(String),
}

impl Default for ReplayVerdict {
    fn default() -> Self {
        Self::Refused("it told no result".into())
    }
}

/// A difference between two runs.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Difference {
    /// What the module is called with.
    pub event: String,
    /// What it did then.
    pub recorded: String,
    /// What it does now.
    pub replayed: String,
}

impl ReplayReport {
    /// Nothing was replayed.
    pub fn refused(why: impl Into<String>) -> Self {
        Self { verdict: ReplayVerdict::Refused(why.into()), ..Self::default() }
    }

    /// As the program wrote it.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        postcard::from_bytes(bytes).ok()
    }
}

impl std::fmt::Display for ReplayReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { verdict, events, outputs, last_ns, not_made, .. } = self;
        match verdict {
            ReplayVerdict::Identical { is_whole } => {
                write!(f, "identical: {events} events, {outputs} outputs")?;
                match not_made {
                    Some(why) => write!(f, "; the module was not made: {}", line(why)),
                    None if *is_whole => Ok(()),
                    None => f.write_str(" (the journal ends before the module did)"),
                }
            }
            ReplayVerdict::Differs(Difference { event, recorded, replayed }) => write!(
                f,
                "differs at event {events}, at {last_ns} ns, where the module {}:\n  recorded: {}\n  replayed: {}",
                line(event),
                line(recorded),
                line(replayed)
            ),
            ReplayVerdict::Refused(why) => write!(f, "refused from event {events} on, at {last_ns} ns: {}", line(why)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_modules_stay_in_their_lines() {
        let text = || "all is well\nFORGED \u{1b}[2J".to_owned();
        let verdict = ReplayVerdict::Identical { is_whole: true };
        let told = ReplayReport { verdict, not_made: Some(text()), ..ReplayReport::default() }.to_string();
        assert!(told.lines().count() == 1 && !told.contains('\u{1b}'), "{told}");
        let difference = Difference { event: text(), recorded: text(), replayed: text() };
        for (verdict, lines) in [(ReplayVerdict::Differs(difference), 3), (ReplayVerdict::Refused(text()), 1)] {
            let told = ReplayReport { verdict, ..ReplayReport::default() }.to_string();
            assert!(told.lines().count() == lines && !told.contains('\u{1b}'), "{told}");
        }
    }
}
