//! Time slots: how well they are kept, how well time is, what happens when the master dies, and whether bounds hold,
//! also beside replicas.

mod brisk;
mod clock;
mod contest;
mod flows;
mod goals;
mod junk;
mod observed;
mod pitch;
pub mod plans;
mod replicas;
mod slots;
mod takeover;

use rohrpost_bench_local::Case;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    let all = [
        slots::cases(),
        brisk::cases(),
        pitch::cases(),
        clock::cases(),
        takeover::cases(),
        flows::cases(),
        replicas::cases(),
        junk::cases(),
    ];
    all.into_iter().flatten().collect()
}
