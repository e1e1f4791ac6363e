//! The scenes of `tests/crash` on a copy of the mailbox with mistakes planted in it: each mistake must be noticed, in
//! the scene and by the words that are named beside it. An aftermath that cannot fail proves nothing.
//!
//! ```text
//!  mailbox/src ───────── each edit of catalog.rs ──▶ copy, one for all mistakes ──▶ the root of this crate
//!  tests/crash/*.rs ──── ignored by themselves ────▶ run in a process for each mistake
//! ```
//!
//! Without a mistake all scenes pass, and together they die at each `step!` that the mailbox has.

#![allow(warnings, clippy::all, clippy::unwrap_used, missing_docs, reason = "a copy with mistakes")]

// The scenes use the mailbox by the name that it has beside `tests/crash`.
extern crate self as rohrpost_mailbox_crash;

/// Whether a mistake is made now.
macro_rules! broken {
    ($mistake:ident) => {
        rohrpost_planted::is_made(stringify!($mistake))
    };
}

mod catalog;
mod noticed;

include!(concat!(env!("OUT_DIR"), "/mistaken.rs"));
