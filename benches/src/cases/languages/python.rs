//! Packages between two programs in Python, beside Rust and what else there is for Python.

use super::{BYTES, cell};
use crate::cases::Case;
use crate::harness::{Cell, Failure, Scratch, time_two_programs};
use crate::languages::Interpreter;
use crate::rounds::{Contender, Row, Subject, compare};
use crate::settings::Settings;
use crate::tcp::systems::free_address;

/// All cases of this file.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    vec![Box::new(Between)]
}

struct Between;

impl Case for Between {
    fn name(&self) -> String {
        "Python".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let (cell, python) = (cell(settings), Interpreter::of(settings));
        let contenders = [
            Contender::sampled("iceoryx2", || iceoryx(&cell, &python)),
            Contender::sampled("zenoh", || zenoh(&cell, &python)),
        ];
        let subject = Subject { case: self.name(), bytes: Some(BYTES), unit: "us" };
        Ok(compare(settings, &subject, &contenders, &[]))
    }
}

/// One way, µs.
fn iceoryx(cell: &Cell, python: &Interpreter) -> Result<Vec<f64>, Failure> {
    python.require("iceoryx2")?;
    let scratch = Scratch::new()?;
    let (folder, prefix) = (scratch.directory().display().to_string(), scratch.name().to_owned());
    one_way(time_two_programs(cell, &scratch, |_| python.runs("iceoryx.py", &[&folder, &prefix])))
}

fn zenoh(cell: &Cell, python: &Interpreter) -> Result<Vec<f64>, Failure> {
    python.require("zenoh")?;
    let (address, scratch) = (free_address()?.to_string(), Scratch::new()?);
    one_way(time_two_programs(cell, &scratch, |_| python.runs("zenoh_peer.py", &[&address])))
}

fn one_way(round_trips: Result<Vec<f64>, Failure>) -> Result<Vec<f64>, Failure> {
    Ok(round_trips?.into_iter().map(|us| us / 2.0).collect())
}
