//! The GUI bridge with Rerun's own command line: the content of a drawing, and the effect of a faulty viewer on a
//! robot.
//!
//! They run only if they are named, since they need two programs that nobody else does; `cargo xtask test --all` brings
//! both.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod drawings;
mod launched;
mod load;
mod modules;
mod own_view;
mod picture;
mod programs;
mod robot;
mod stopped;
mod switching;
mod torture;
mod viewer;
