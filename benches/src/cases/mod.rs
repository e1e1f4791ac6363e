//! The cases. To add one: a `Case` with a name and what measures its rows, and a line in [`all`].

mod cost;
mod errors;
mod flood;
pub mod grid;
pub mod lan;
pub mod languages;
mod latency;
mod many;
mod memory;
pub mod plan;
mod proof;
mod rates;
pub mod recording;
mod rivals;
mod startup;
pub mod streams;
pub mod supervision;
pub mod tcp;
pub mod tdma;
pub mod team;

use rohrpost_bench_local::{Case, Failure};

/// If this process was started as one of the hidden programs of a case: does what it has to. Call it first thing in
/// `main`.
///
/// # Errors
/// When it does not do that.
pub fn run_hidden_program() -> Option<Result<(), Failure>> {
    if let Some(done) = crate::motor::run_hidden_module() {
        return Some(done);
    }
    if let Some(done) = crate::player::run_hidden_module() {
        return Some(done);
    }
    startup::run_hidden_program()
}

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
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
