//! The promises of fusion by time on a copy with mistakes planted in it: each mistake must be noticed, by the test that
//! is named beside it. A test that cannot fail proves nothing.
//!
//! ```text
//!  fusion/src ──────────── each edit of catalog.rs ──▶ copy, one for all mistakes ──▶ the root of this crate
//!  fusion/tests/promises ─ ignored by themselves ────▶ run in a process for each mistake
//! ```

#![cfg(test)]
#![allow(warnings, clippy::all, missing_docs, reason = "a copy with mistakes")]

// The tests use the crate by its own name.
extern crate self as rohrpost_fusion;

/// Whether a mistake is made now.
macro_rules! broken {
    ($mistake:ident) => {
        rohrpost_planted::is_made(stringify!($mistake))
    };
}

mod catalog;

include!(concat!(env!("OUT_DIR"), "/mistaken.rs"));

#[test]
fn without_a_mistake_all_promises_are_kept() {
    rohrpost_planted::all_pass_without_a_mistake();
}
