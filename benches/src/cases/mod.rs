//! The cases. To add one: something that has a name and gives rows, and a line in [`all`].

mod cost;
mod flood;
#[cfg(feature = "lan")]
pub mod lan;
mod latency;
mod many;
mod memory;
mod proof;
mod rates;
mod rivals;
mod startup;
#[cfg(feature = "lan")]
pub mod tcp;
#[cfg(feature = "lan")]
pub mod tdma;

pub use startup::run_hidden_program;

use crate::harness::{Failure, Scheduling};
use crate::rounds::Row;
use crate::settings::Settings;

/// What goes wrong in a turn that does many different things.
type Done<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// As a turn has to say it. What was skipped remains so.
fn as_failure(what: &str) -> impl Fn(Box<dyn std::error::Error + Send + Sync>) -> Failure {
    move |error| match error.downcast::<Failure>() {
        Ok(failure) => *failure,
        Err(error) => Failure::of(what, error),
    }
}

/// Something that is measured, against whom, and with which target.
pub trait Case {
    /// As `--only` and the table call it.
    fn name(&self) -> String;

    /// Measures. A contender that fails or is skipped is a row that says so; `Err` is for what hits the whole case.
    ///
    /// # Errors
    /// When the case cannot be begun.
    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure>;
}

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Box<dyn Case>> {
    let all = [
        latency::cases(),
        rates::cases(),
        flood::cases(),
        cost::cases(),
        proof::cases(),
        memory::cases(),
        many::cases(),
        startup::cases(),
    ];
    all.into_iter().flatten().collect()
}

/// The few that tell in seconds how this computer does: blocking and spinning beside the two floors.
pub fn self_test(scheduling: Scheduling) -> Vec<Box<dyn Case>> {
    latency::self_test(scheduling)
}
