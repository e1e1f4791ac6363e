//! Ways for many robots: drawn maps, and small ones beside an exhaustive search.
//!
//! `ROHRPOST_WAYS=200 cargo test -p rohrpost-team --test ways` draws as many large maps.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod drawn;
mod exhaustive;
mod large;
mod named;
mod small;
mod valid;
