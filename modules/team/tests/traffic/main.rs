//! Robots in traffic, in virtual time: messages with delays and losses, splits and deaths.
//!
//! `ROHRPOST_TRAFFIC=2000 cargo test -p rohrpost-team --test traffic` draws as many seeds.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod blocking;
mod campaign;
mod friends;
mod scenes;
mod world;
