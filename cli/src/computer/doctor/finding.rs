//! One finding, and how good it is.

use serde::Serialize;

/// How good something is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Grade {
    Ok,
    /// A robot runs, but may be late.
    Warn,
    /// A robot does not run, or not for long.
    Bad,
}

impl Grade {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Bad => "bad",
        }
    }
}

/// The result of one check.
#[derive(Debug, Serialize)]
pub(super) struct Finding {
    pub(super) what: &'static str,
    pub(super) state: Grade,
    /// What was found.
    pub(super) is: String,
    pub(super) why: &'static str,
    /// The fix: a command, if there is one.
    pub(super) fix: Option<String>,
}

/// What is checked, and why it matters.
#[derive(Clone, Copy)]
pub(super) struct Check(pub(super) &'static str, pub(super) &'static str);

impl Check {
    pub(super) fn ok(self, is: impl Into<String>) -> Finding {
        Finding { what: self.0, state: Grade::Ok, is: is.into(), why: self.1, fix: None }
    }

    pub(super) fn warn(self, is: impl Into<String>, fix: impl Into<String>) -> Finding {
        Finding { state: Grade::Warn, fix: Some(fix.into()), ..self.ok(is) }
    }

    pub(super) fn bad(self, is: impl Into<String>, fix: impl Into<String>) -> Finding {
        Finding { state: Grade::Bad, ..self.warn(is, fix) }
    }
}
