//! Teams of robots in virtual time, from seeds: merges, splits, chains, deaths, restarts, losses, clocks.
//!
//! `ROHRPOST_TEAM_SEEDS=2000 cargo test -p rohrpost-team --test simulation -- --nocapture` is the long run; 200 are the
//! rule. A test that fails says its seed; `ROHRPOST_TEAM_FIRST=SEED ROHRPOST_TEAM_SEEDS=1` runs that one again.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod chains;
mod clocks;
mod counter_examples;
mod lives;
mod merges;
mod routed;
mod seed_algorithm;
mod world;
