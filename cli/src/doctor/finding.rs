//! What was found of one thing, and how good that is.

/// How good something is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum State {
    Ok,
    /// A robot runs, and may be late.
    Warn,
    /// It does not run, or not for long.
    Bad,
}

impl State {
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
    pub(super) state: State,
    /// What is.
    pub(super) is: String,
    /// Why it matters.
    pub(super) why: &'static str,
    /// What fixes it: a command, if one does.
    pub(super) fix: Option<String>,
}

impl Finding {
    pub(super) fn ok(what: &'static str, is: impl Into<String>, why: &'static str) -> Self {
        Self { what, state: State::Ok, is: is.into(), why, fix: None }
    }

    /// Something that is not as it should be, and what fixes it.
    pub(super) fn not(
        state: State,
        what: &'static str,
        is: impl Into<String>,
        why: &'static str,
        fix: impl Into<String>,
    ) -> Self {
        Self { what, state, is: is.into(), why, fix: Some(fix.into()) }
    }
}
