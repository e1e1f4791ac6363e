//! Streams as an author of modules uses them: written in one module, read in another. Each module runs on a thread of
//! this process and does what a test gives it, with its context in hand.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod following;
mod killed;
mod puppets;
mod reading;
mod refusing;
#[path = "../support/mod.rs"]
pub mod support;
mod writing;
