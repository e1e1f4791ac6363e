//! Teams of robots: what a hello takes to be read and handled, what it takes to join views, and how soon groups that
//! merge see the same, what routers of the team cost.

mod hello;
mod merge;
mod router;
mod timed;
mod view;
// The teams that tests simulate, in virtual time.
#[allow(dead_code, clippy::unwrap_used, reason = "its tests use all of it, and it is their code")]
#[path = "../../../../modules/team/tests/simulation/world.rs"]
mod world;

use rohrpost_bench_local::Case;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    let cases = [hello::cases().into(), vec![view::case(), merge::case()], router::cases()];
    cases.into_iter().flatten().collect()
}
