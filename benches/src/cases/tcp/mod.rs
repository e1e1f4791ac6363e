//! The TCP router: how long a package takes through it, its throughput beside other load, and what a client costs.

mod clients;
mod hop;
mod idle;

pub(super) use hop::TcpSegment;

use rohrpost_bench_local::Case;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    [hop::cases(), clients::cases(), idle::cases()].into_iter().flatten().collect()
}
