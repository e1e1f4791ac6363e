//! Rohrpost's mailboxes and streams, measured beside the floors of this very computer and beside what else could be
//! used.
//!
//! Harness, rounds, statistics and table are those of `rohrpost_bench_local`. Here are the cases, and how contenders
//! send: ours in `streams`, `one_way`, `lan`, `tdma`, `tcp` and `team`, then `floors`, `peers`, and programs in
//! `foreign`.
//!
//! A case is added in `cases`: a name, and what measures its rows.

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
pub mod team;
