//! Streams: how long a record is on its way, what it costs to write, to find and to open, and how many go in a second.

mod around;
mod copied;
mod cost;
mod latency;
mod open;
mod rate;

use rohrpost_bench_local::Case;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    let all = [latency::cases(), copied::cases(), cost::cases(), rate::cases(), around::cases(), open::cases()];
    all.into_iter().flatten().collect()
}
