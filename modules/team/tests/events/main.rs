//! Trees of events: beside a naive interpreter, under floods, with mistakes, and the tree of seed 000.
//!
//! `ROHRPOST_EVENT_CASES=100000 cargo test -p rohrpost-team --test events random` is the long run.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod floods;
mod mistakes;
mod naive;
mod paths;
mod random;
mod seed_tree;
mod spec;
