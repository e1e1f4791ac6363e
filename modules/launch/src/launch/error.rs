//! Why a node could not be launched.

use rohrpost_mailbox::{NodeError, ProcessError};
use rohrpost_modules::runtime::ClientError;
use rohrpost_supervision::lease::BadTerms;

/// Why a node could not be launched.
#[derive(Debug, thiserror::Error)]
pub enum LaunchError {
    /// Several nodes, or another one.
    #[error("which node? the configuration has {0}; say --node NAME")]
    WhichNode(String),
    /// One that is not there.
    #[error("the configuration has no node `{0}`; it has {1}")]
    NoNode(String, String),
    /// The node.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// Launch's own mailboxes.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// Leases of modules with several nodes.
    #[error(transparent)]
    Lease(#[from] LeaseError),
    /// Signals.
    #[error("signal handlers: {0}")]
    Signals(std::io::Error),
    /// Programs that are not there.
    #[error("{0}")]
    Programs(String),
    /// A module of an earlier launch.
    #[error("module {0} of an earlier launch, process {1}, cannot be killed; end it by hand (is it another user's?)")]
    Leftover(String, u32),
    /// A process that has the name of a module, and that launch must not end.
    #[error("module {module} runs already, as process {pid}; launch ends only what a launch has started, and {why}")]
    NotStarted {
        /// The module.
        module: String,
        /// The number of the process in its own pid namespace.
        pid: u32,
        /// Why it is left alone.
        why: NotStarted,
    },
    /// A module that would not start.
    #[error("module {module} did not become ready: {why}{}", below(notes))]
    NotReady {
        /// Which.
        module: String,
        /// How it ended, and what it had printed.
        why: String,
        /// What else there is to say: of its earlier tries, of the others, and of their end.
        notes: Vec<String>,
    },
    /// Told to stop before all modules were on.
    #[error("module {module} did not become ready: told to stop{}", below(notes))]
    Stopped {
        /// The module that it waited for.
        module: String,
        /// As in [`NotReady`](Self::NotReady).
        notes: Vec<String>,
    },
}

/// Why launch can take no part in leases.
#[derive(Debug, thiserror::Error)]
pub enum LeaseError {
    /// No timer.
    #[error("a timer for the lease of a module with several nodes: {0}")]
    Timer(#[from] std::io::Error),
    /// Times that do not fit together, which configuration refuses.
    #[error(transparent)]
    Terms(#[from] BadTerms),
}

/// Why launch leaves a process alone that has the name of one of its modules.
#[derive(Debug, thiserror::Error)]
pub enum NotStarted {
    /// Nobody knows which process it is.
    #[error("{0}; end it where it runs, or launch under another ROHRPOST_DIR, or another `installation`")]
    Unknown(ProcessError),
    /// Somebody has started it.
    #[error("this one was started by hand: end it (kill {0}), and launch again")]
    ByHand(u32),
}

/// Each note on a line of its own, below what was said before.
fn below(notes: &[String]) -> String {
    notes.iter().map(|note| format!("\n  {note}")).collect()
}

impl LaunchError {
    /// This error, with what else is to be told of a start that failed.
    pub(super) fn with(mut self, told: Vec<String>) -> Self {
        match &mut self {
            Self::NotReady { module, why, notes } => {
                // Its last end is the error.
                let same = format!("{module} {why}");
                notes.extend(told.into_iter().filter(|note| *note != same));
            }
            Self::Stopped { notes, .. } => notes.extend(told),
            _ => {}
        }
        self
    }
}
