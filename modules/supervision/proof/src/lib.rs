//! Models of the supervision core, checked over their whole state space with [stateright](https://docs.rs/stateright).
//!
//! ```text
//!  supervision/src ─┬─ unchanged ─────────────────────▶ real      each model keeps all of its promises
//!  the models ──────┤
//!  catalog/ ────────┴─ one copy with all mistakes ────▶ mistaken  each mistake breaks the promise named beside it,
//!                                                                in a process of its own
//!  supervision/tests/lease ─ ignored by themselves ───▶ simulation of the mistaken lease, likewise
//! ```
//!
//! - `wormhole_model`: programs, persons, halts, sight, deaths and restarts around a `Wormhole`. Read
//!   `wormhole_model/promises.rs` first.
//! - `lease_model`: two candidates, a witness and a fence, over some steps of time.
//! - `check.rs`: what it takes to hold; `modules/team/proof` has it, too.
//! - `catalog`: the mistakes. A proof that cannot fail proves nothing.
//! - `build.rs`: compiles the core's own files, each model beside them, and the reduced state of a model as a child of
//!   the file that it reduces: only there it sees the private parts.
//!
//! ```text
//! cargo test -p rohrpost-proof-supervision -- --nocapture     states, steps, seconds
//! ROHRPOST_MODEL_BOUNDS=large cargo test -p rohrpost-proof-supervision the_wormhole_keeps -- --nocapture
//! ```
//!
//! The checker visits each state once, without a limit of depth. It tells states apart by 64 bits: of ten million, two
//! look alike with a probability of three in a million.
//!
//! **One model more**: its file with a `stateright::Model` and a function `holds`, a `Part` in `build.rs`, a `mod` line
//! for rustfmt and two tests here, and mistakes in `catalog`.

#![cfg(test)]

/// Whether a mistake is made now.
macro_rules! broken {
    ($mistake:ident) => {
        rohrpost_planted::is_made(stringify!($mistake))
    };
}

#[allow(dead_code, reason = "the edits are for build.rs")]
mod catalog;
mod check;

#[allow(warnings, clippy::all, missing_docs, reason = "the core is checked where it stands")]
mod cores {
    include!(concat!(env!("OUT_DIR"), "/cores.rs"));
}

// Compiled beside each core; named so that rustfmt finds them.
#[cfg(any())]
mod lease_model;
#[cfg(any())]
mod wormhole_model;

use cores::{mistaken, real};

#[test]
fn the_wormhole_keeps_its_promises() {
    real::wormhole_model::holds();
}

#[test]
fn a_wormhole_that_is_never_reduced_does_the_same() {
    real::wormhole_model::walks();
}

#[test]
fn each_promise_of_the_wormhole_is_broken_by_a_mistake() {
    real::wormhole_model::can_fail();
}

#[test]
fn the_lease_keeps_its_promises() {
    real::lease_model::holds();
}

#[test]
fn each_promise_of_the_lease_is_broken_by_a_mistake() {
    real::lease_model::can_fail();
}

#[test]
#[ignore = "run in a process with and without each mistake"]
fn a_mistaken_wormhole_keeps_its_promises() {
    mistaken::wormhole_model::holds();
}

#[test]
#[ignore = "run in a process with and without each mistake"]
fn a_mistaken_lease_keeps_its_promises() {
    mistaken::lease_model::holds();
}

#[test]
fn without_a_mistake_all_promises_are_kept() {
    rohrpost_planted::all_pass_without_a_mistake();
}
