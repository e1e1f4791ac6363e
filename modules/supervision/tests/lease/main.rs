//! Leases in simulated installations, each from a seed: candidates, a witness and fences on clocks that drift, and a
//! network that loses, delays, doubles and reorders, while computers die, stop, go on and are cut off.
//!
//! `ROHRPOST_LEASE_SEEDS=10000 cargo test --release -p rohrpost-supervision --test lease` is the full run;
//! `ROHRPOST_LEASE_SEED=n` is the installation of one seed alone.

mod clock;
mod edges;
mod faults;
mod promises;
mod rules;
mod world;
