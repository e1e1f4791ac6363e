//! Two nodes on a network of their own: how long a package takes over two routers, how many go, what is urgent past a
//! flood.

pub(super) mod clock;
pub(super) mod ground;
mod hop;
mod junk;
mod rates;
mod replicas;
mod sealed;
mod urgent;

use rohrpost_bench_local::Case;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    let all = [
        hop::cases(),
        sealed::cases(),
        rates::cases(),
        urgent::cases(),
        replicas::cases(),
        junk::cases(),
        clock::cases(),
    ];
    all.into_iter().flatten().collect()
}
