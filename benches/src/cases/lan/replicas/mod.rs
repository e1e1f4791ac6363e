//! Replicas: how many records go in a second, how long a pose takes, and what the readers of one replica cost the wire.

mod hop;
mod rate;
mod readers;

use rohrpost_bench_local::Case;

/// All cases of this folder.
pub(super) fn cases() -> Vec<Case> {
    [rate::cases(), hop::cases(), readers::cases()].into_iter().flatten().collect()
}
