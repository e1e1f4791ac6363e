//! Programs in C and in Python, beside the same in Rust and beside what else could be used.

mod c;
mod python;
mod remote;
mod turn;

use rohrpost_bench_local::Case;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    [c::cases(), python::cases(), remote::cases()].into_iter().flatten().collect()
}
