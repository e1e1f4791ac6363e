//! A model of the team core, checked over its whole state space with [stateright](https://docs.rs/stateright), as the
//! models of supervision are (`modules/supervision/proof`, which explains it).
//!
//! - `team_model`: three robots and what they send each other. `promises.rs` says what they promise, `key.rs` which
//!   states are alike, and `walk.rs` tests that.
//! - `seed_model`: the seed's own algorithm in the same model, which goes round in a circle for ever.
//! - `catalog.rs`: mistakes, each with the promise that it breaks.
//!
//! ```text
//! cargo test -p rohrpost-proof-team -- --nocapture     states, steps, seconds
//! ```

#![cfg(test)]

/// Whether a mistake is made now.
macro_rules! broken {
    ($mistake:ident) => {
        rohrpost_planted::is_made(stringify!($mistake))
    };
}

#[allow(dead_code, reason = "the edits are for build.rs")]
mod catalog;
#[path = "../../../supervision/proof/src/check.rs"]
#[allow(dead_code, reason = "the models of supervision need the rest")]
mod check;

#[allow(warnings, clippy::all, missing_docs, reason = "the core is checked where it stands")]
mod cores {
    include!(concat!(env!("OUT_DIR"), "/cores.rs"));
}

// Compiled beside each core; named so that rustfmt finds it.
#[path = "../../tests/simulation/seed_algorithm.rs"]
mod seed_algorithm;
mod seed_model;
#[cfg(any())]
mod team_model;

use cores::{mistaken, real};

#[test]
fn groups_keep_their_promises() {
    real::team_model::groups_hold();
}

#[test]
fn groups_keep_their_promises_after_two_faults() {
    real::team_model::groups_hold_after_two_faults();
}

#[test]
fn groups_keep_their_promises_after_a_death_and_a_loss() {
    real::team_model::groups_hold_after_a_death_and_a_loss();
}

#[test]
fn views_keep_their_promises() {
    real::team_model::views_hold();
}

#[test]
fn views_keep_their_promises_after_a_loss() {
    real::team_model::views_hold_after_a_loss();
}

#[test]
fn states_of_one_key_go_on_to_states_of_one_key() {
    real::team_model::walks();
}

#[test]
fn robots_that_have_changed_places_go_on_as_the_others_do() {
    real::team_model::walks_of_changed_places();
}

#[test]
fn each_promise_can_fail() {
    real::team_model::each_can_fail();
}

#[test]
#[ignore = "run in a process with and without each mistake"]
fn a_mistaken_group_keeps_its_promises() {
    mistaken::team_model::groups_hold();
}

#[test]
#[ignore = "run in a process with and without each mistake"]
fn a_mistaken_view_keeps_its_promises() {
    mistaken::team_model::views_hold();
}

#[test]
fn without_a_mistake_all_promises_are_kept() {
    rohrpost_planted::all_pass_without_a_mistake();
}
