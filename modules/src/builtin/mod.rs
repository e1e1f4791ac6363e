//! Modules that come with Rohrpost. Each is a thin shell around logic in [`crate::robot`].

mod carmen;
mod mapper;
mod output;
mod pilot;
mod sim;

use crate::runtime::{Start, StartError, run_started};

/// Runs a built-in module by its name in the configuration (`builtin = "sim"`).
///
/// # Errors
/// None for an unknown name; else what starting it brought.
pub fn run(name: &str, start: Start) -> Option<Result<(), StartError>> {
    Some(match name {
        "sim" => run_started::<sim::Sim>(start),
        "carmen" => run_started::<carmen::Carmen>(start),
        "mapper" => run_started::<mapper::MapModule>(start),
        "pilot" => run_started::<pilot::PilotModule>(start),
        "output" => run_started::<output::OutputModule>(start),
        _ => return None,
    })
}
