//! Whether, when and how often a module that has ended is started again.

use crate::reader::Item;
use crate::units::duration_text;
use std::fmt;
use std::time::Duration;

/// When an ended module is started again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestartPolicy {
    /// It stays ended.
    Never,
    /// When it failed: a signal, or an exit code that is not 0.
    OnFailure,
    /// However it ended.
    Always,
}

/// When, how soon and how often a module is started again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Restart {
    /// After which end.
    pub policy: RestartPolicy,
    /// Wait before it.
    pub backoff: Duration,
    /// Restarts within [`within`](Self::within) before launch gives the module up.
    pub at_most: u32,
    /// Time in which restarts are counted.
    pub within: Duration,
}

impl Default for Restart {
    fn default() -> Self {
        Self {
            policy: RestartPolicy::OnFailure,
            backoff: Duration::from_millis(200),
            at_most: 5,
            within: Duration::from_secs(60),
        }
    }
}

impl Restart {
    pub(crate) fn read(item: &Item<'_>, what: &str) -> Self {
        let mut restart = Self::default();
        let words = [
            ("never", RestartPolicy::Never),
            ("on-failure", RestartPolicy::OnFailure),
            ("always", RestartPolicy::Always),
        ];
        if !item.is_table() {
            restart.policy = item.choice(&words).unwrap_or(restart.policy);
            return restart;
        }
        let Some(section) = item.section(&format!("{what}, restart")) else { return restart };
        restart.policy = section.or("policy", restart.policy, |item| item.choice(&words));
        restart.backoff = section.or("backoff", restart.backoff, |item| item.duration("200 ms"));
        restart.at_most = section.whole_or("at-most", 1..=1000, restart.at_most);
        restart.within = section.or("within", restart.within, |item| item.duration_above_zero("60 s"));
        section.finish();
        restart
    }
}

impl fmt::Display for Restart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (backoff, within) = (duration_text(self.backoff), duration_text(self.within));
        let again = format!("starts again after {backoff}, at most {} times in {within}", self.at_most);
        match self.policy {
            RestartPolicy::Never => f.write_str("stays ended"),
            RestartPolicy::OnFailure => write!(f, "{again}; stays ended when it meant to end"),
            RestartPolicy::Always => f.write_str(&again),
        }
    }
}
