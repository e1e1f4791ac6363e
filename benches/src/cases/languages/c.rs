//! Mailboxes by the library for C, beside Rust: packages of 64 bytes, copied in and out.

use super::turn::{BYTES, at_most, cell};
use crate::foreign::{ForeignProgram, time_two_programs};
use crate::languages::compile_c;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Failure, Pause, Scratch};
use rohrpost_bench_local::latency;
use rohrpost_bench_local::ours::How;
use rohrpost_bench_local::rounds::{Contender, Row, Subject, compare};
use rohrpost_bench_local::settings::Settings;
use std::path::PathBuf;
use std::time::Duration;

/// Ratio to Rust.
const OF_RUST: f64 = 1.05;
/// Of contenders that spin: see [`Cell::cap`].
const CAP_AWAKE: Duration = Duration::from_millis(600);

/// All cases of this file.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    [How::Blocking, How::Spinning].map(|how| -> Box<dyn Case> { Box::new(InC { how }) }).into()
}

struct InC {
    how: How,
}

impl InC {
    fn word(&self) -> &'static str {
        if self.how == How::Blocking { "blocking" } else { "spinning" }
    }

    fn turn(&self, program: &Result<PathBuf, Failure>, cell: &Cell) -> Result<Vec<f64>, Failure> {
        let (program, scratch) = (program.clone()?, Scratch::new()?);
        let node = scratch.directory().join("node");
        let program = ForeignProgram {
            program,
            first: Vec::new(),
            last: vec![node.into(), self.word().into()],
            environment: Vec::new(),
        };
        let round_trips = time_two_programs(cell, &scratch, |_| program.clone())?;
        Ok(round_trips.into_iter().map(|us| us / 2.0).collect())
    }
}

impl Case for InC {
    fn name(&self) -> String {
        format!("C, {}", self.word())
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let cell = cell(settings);
        let cell = if self.how == How::Spinning { Cell { cap: CAP_AWAKE, pause: Pause::None, ..cell } } else { cell };
        let program = compile_c();
        let contenders = [
            Contender::sampled("C", || self.turn(&program, &cell)),
            Contender::sampled("Rust", || latency::ours(&cell, self.how)),
        ];
        let subject = Subject { case: self.name(), bytes: Some(BYTES), unit: "us" };
        Ok(compare(settings, &subject, &contenders, &[at_most(contenders[1].name, OF_RUST)]))
    }
}
