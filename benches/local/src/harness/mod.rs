//! Two processes that send to each other: forked, pinned, scheduled, timed, and never left behind.

mod alone;
mod asleep;
mod child;
mod cycles;
mod interrupt;
mod machine;
mod ping_pong;
mod place;
mod samples;
mod scratch;
mod shared;

pub use alone::{Alone, alone};
pub use asleep::{given_away, require_asleep};
pub use child::{Child, check_children};
pub use cycles::CycleCounter;
pub use interrupt::{heed, interrupted, look_for, rest};
pub use machine::Machine;
pub use ping_pong::{
    Cell, GRACE, Link, Meetings, Pause, SAMPLES_MIN, SECOND_ENDS, check_echo, copy_whole, fill, ping, pong,
    time_two_processes, time_two_threads,
};
pub use place::{End, Placement, Scheduling, processors, refusals, settle};
pub use samples::{Samples, sample_in_child};
pub use scratch::{Scratch, sweep};
pub use shared::{Gate, Shared, Zeroable};

/// Why a contender has no figure.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Failure {
    /// It cannot run here; nothing is wrong with it.
    #[error("skipped: {0}")]
    Skipped(String),
    /// It ran, and did not do what it should.
    #[error("FAILED: {0}")]
    Failed(String),
}

impl Failure {
    /// Something that went wrong while doing `what`.
    pub fn of(what: &str, error: impl std::fmt::Display) -> Self {
        Self::Failed(format!("{what}: {error}"))
    }
}

/// Results with errors of all kinds.
pub trait OrFail<T> {
    /// The error as one of doing `what`.
    ///
    /// # Errors
    /// When it is one.
    fn or_fail(self, what: &str) -> Result<T, Failure>;
}

impl<T, E: std::fmt::Display> OrFail<T> for Result<T, E> {
    fn or_fail(self, what: &str) -> Result<T, Failure> {
        self.map_err(|error| Failure::of(what, error))
    }
}
