//! Mailboxes by the library for C, beside Rust: packages of 64 bytes, copied in and out.

use super::turn::{BYTES, cell};
use crate::foreign::{ForeignProgram, time_two_programs};
use crate::languages::compile_c;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Failure, Pause, Scratch};
use rohrpost_bench_local::latency;
use rohrpost_bench_local::ours::How;
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use std::path::PathBuf;
use std::time::Duration;

/// Ratio to Rust.
const OF_RUST: f64 = 1.05;
/// Of contenders that spin: see [`Cell::cap`].
const CAP_AWAKE: Duration = Duration::from_millis(600);

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    [("blocking", How::Blocking), ("spinning", How::Spinning)].map(|(word, how)| case(word, how)).into()
}

fn case(word: &'static str, how: How) -> Case {
    Case::new(format!("C, {word}"), BYTES, "us", move |settings, subject| {
        let mut cell = cell(settings);
        if how == How::Spinning {
            (cell.cap, cell.pause) = (CAP_AWAKE, Pause::None);
        }
        let program = compile_c();
        let contenders = [
            Contender::sampled("C", || turn(word, &program, &cell)),
            Contender::sampled("Rust", || latency::ours(&cell, how)).beside(at_most(OF_RUST), None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

fn turn(word: &str, program: &Result<PathBuf, Failure>, cell: &Cell) -> Result<Vec<f64>, Failure> {
    let (program, scratch) = (program.clone()?, Scratch::new()?);
    let last = vec![scratch.directory().join("node").into(), word.into()];
    let program = ForeignProgram { program, first: Vec::new(), last, environment: Vec::new() };
    let round_trips = time_two_programs(cell, &scratch, &program)?;
    Ok(round_trips.into_iter().map(|us| us / 2.0).collect())
}
