//! A call from Python, without anything of Rohrpost but the client that is Python alone, through the TCP router to a
//! module in Rust.
//!
//! ```text
//!  processor 0                              processor 1
//!  Python               ═══ TCP ══▶ TCP router ═══ TCP ══▶ client of node ─▶ module    Python
//!  Python               ═══ TCP ══▶ Python                                             sockets …
//!  module ─▶ client     ═══ TCP ══▶ TCP router ═══ TCP ══▶ client of node ─▶ module    … + hop
//! ```
//! All of them there and back again.

use super::turn::{BYTES, cell};
use crate::cases::tcp::TcpSegment;
use crate::foreign::{time_one_program, time_two_programs};
use crate::languages::Interpreter;
use crate::motor::start_motor;
use crate::tcp::systems::{Security, free_address, system_of};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Child, End, Failure, Scratch};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::{Summary, median};
use std::cell::RefCell;

/// Ratio to both parts together.
const OF_PARTS: f64 = 1.5;

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("Python, remote call", None, "us", remote_call)]
}

fn remote_call(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let (cell, python) = (cell(settings), Interpreter::of(settings));
    let (segment, parts) = (TcpSegment::start(settings, Security::None), Parts::default());
    let motor = segment
        .systems()
        .and_then(|systems| start_motor(&systems.folder(), &systems.configuration(End::Pong), cell.placement));
    let contenders = [
        Contender::sampled("Python", || call(&cell, &python, &segment, &motor)),
        Contender::single("sockets + hop", || parts.time(&cell, &python, &segment)).beside(at_most(OF_PARTS), None),
    ];
    let mut rows = compare(settings, subject, &contenders);
    rows.extend(parts.rows(subject));
    Ok(rows)
}

/// Microseconds of each call.
fn call(
    cell: &Cell,
    python: &Interpreter,
    segment: &TcpSegment,
    motor: &Result<Child, Failure>,
) -> Result<Vec<f64>, Failure> {
    let (systems, scratch) = (segment.systems()?, Scratch::new()?);
    motor.as_ref().map_err(Clone::clone)?;
    python.require("rohrpost.remote")?;
    let (address, digests) = (systems.address().to_string(), format!("{:016x}-{:016x}", systems.common(), 0));
    let module = format!("{}.200.0.0", system_of(End::Pong));
    time_one_program(cell, &scratch, &python.runs("remote_call.py", &[&address, &digests, &module]))
}

/// What such a call consists of at least: medians of each round.
#[derive(Default)]
struct Parts {
    sockets: RefCell<Vec<f64>>,
    hops: RefCell<Vec<f64>>,
}

impl Parts {
    /// Both together, there and back again, µs.
    fn time(&self, cell: &Cell, python: &Interpreter, segment: &TcpSegment) -> Result<f64, Failure> {
        let middle = |samples: Vec<f64>| median(samples).ok_or_else(|| Failure::Failed("not one sample".into()));
        python.require("socket")?;
        let (address, scratch) = (free_address()?.to_string(), Scratch::new()?);
        let socket = middle(time_two_programs(cell, &scratch, &python.runs("sockets.py", &[&address]))?)?;
        let hop = 2.0 * middle(segment.time(cell)?)?;
        self.sockets.borrow_mut().push(socket);
        self.hops.borrow_mut().push(hop);
        Ok(socket + hop)
    }

    fn rows(&self, subject: &Subject) -> Vec<Row> {
        let subject = Subject { bytes: Some(BYTES), ..subject.clone() };
        let row = |name, figures: &RefCell<Vec<f64>>| {
            let middle = median(figures.borrow().iter().copied())?;
            Some(Row::alone(subject.clone(), name, Ok(Summary::single(middle))))
        };
        [row("sockets", &self.sockets), row("hop", &self.hops)].into_iter().flatten().collect()
    }
}
