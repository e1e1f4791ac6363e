//! What was found of one thing, and how good that is.

/// How good something is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Grade {
    Ok,
    /// A robot runs, and may be late.
    Warn,
    /// It does not run, or not for long.
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

/// One thing that was looked at.
#[derive(Debug)]
pub(super) struct Finding {
    pub(super) what: &'static str,
    pub(super) state: Grade,
    /// What is.
    pub(super) is: String,
    /// Why it matters.
    pub(super) why: &'static str,
    /// What fixes it: a command, if one does.
    pub(super) fix: Option<String>,
}

impl Finding {
    pub(super) fn ok(what: &'static str, is: impl Into<String>, why: &'static str) -> Self {
        Self { what, state: Grade::Ok, is: is.into(), why, fix: None }
    }

    /// Something that is not as it should be, and what fixes it.
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
