//! Supervised control: how long commands take through the wormhole, how late it brakes, what its check of a command
//! costs, and how soon launch ends a module that hangs.

mod deadline;
mod envelope;
mod hop;
mod promise;
mod robot;
mod watchdog;

use rohrpost_bench_local::Case;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    let cases = [vec![promise::case()], envelope::cases().into(), deadline::cases().into(), watchdog::cases().into()];
    cases.into_iter().flatten().collect()
}
