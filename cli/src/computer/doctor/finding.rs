//! One finding, and how good it is.

/// How good something is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
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
#[derive(Debug)]
pub(super) struct Finding {
    pub(super) what: &'static str,
    pub(super) state: Grade,
    /// What was found.
    pub(super) is: String,
    /// Why it matters.
    pub(super) why: &'static str,
    /// The fix: a command, if there is one.
    pub(super) fix: Option<String>,
}

impl Finding {
    pub(super) fn ok(what: &'static str, is: impl Into<String>, why: &'static str) -> Self {
        Self { what, state: Grade::Ok, is: is.into(), why, fix: None }
    }

    /// A problem, and its fix.
    pub(super) fn not(
        state: Grade,
        what: &'static str,
        is: impl Into<String>,
        why: &'static str,
        fix: impl Into<String>,
    ) -> Self {
        Self { what, state, is: is.into(), why, fix: Some(fix.into()) }
    }
}
