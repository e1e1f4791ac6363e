//! Rohrpost's mailboxes and streams, measured beside the floors of this very computer and beside what else could be
//! used.
//!
//! Rounds, harness, statistics and table are those of `rohrpost_bench_local`; here are the cases, and how each contender
//! sends: `streams` · `one_way` · `lan` · `tdma` · `tcp` ours, `floors`, `peers`, and `foreign` programs.
//!
//! A case is added in `cases`: anything that has a name and gives rows.

pub mod cases;
pub mod counting;
pub mod floors;
pub mod foreign;
pub mod lan;
pub mod languages;
pub mod motor;
pub mod one_way;
pub mod peers;
pub mod player;
pub mod streams;
pub mod tcp;
pub mod tdma;
