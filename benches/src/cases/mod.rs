//! The cases. To add one: something that has a name and gives rows, and a line in [`all`].

mod case;
mod cost;
mod flood;
#[cfg(feature = "lan")]
pub mod lan;
#[cfg(feature = "languages")]
pub mod languages;
mod latency;
mod many;
mod memory;
mod proof;
mod rates;
#[cfg(feature = "recording")]
pub mod recording;
mod rivals;
mod startup;
pub mod streams;
#[cfg(feature = "lan")]
pub mod tcp;
#[cfg(feature = "lan")]
pub mod tdma;

pub use case::Case;

use crate::harness::{Failure, Scheduling};

/// If this process was started as one of the hidden programs of a case: does what it has to. Call it first thing in
/// `main`.
///
/// # Errors
/// When it does not do that.
pub fn run_hidden_program() -> Option<Result<(), Failure>> {
    #[cfg(any(feature = "languages", feature = "recording"))]
    if let Some(done) = crate::motor::run_hidden_module() {
        return Some(done);
    }
    #[cfg(feature = "languages")]
    if let Some(done) = crate::player::run_hidden_module() {
        return Some(done);
    }
    startup::run_hidden_program()
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
