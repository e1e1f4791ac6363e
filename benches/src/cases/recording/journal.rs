//! How long a command takes to a module that writes a journal, and to one that writes none. Module and caller sleep
//! before each: modules of a robot wait for what comes. Awake, a command takes a fiftieth of the time, so which of both
//! it is must be the same in all rounds; that is brought about, and counted.

use super::super::errors::{Done, as_failure};
use crate::motor::{CommandedEvent, MOTOR, configuration, start_motor};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, OrFail, Scratch, sample_in_child};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::{Node, StreamId};
use rohrpost_modules::journal::JOURNAL_NUMBER;
use std::fs;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(120);
/// That it writes a journal. Nobody records.
const RECORDING: &str = include_str!("../../../../tests/testbed/journal.toml");

/// All cases of this file.
pub(super) fn cases() -> [Case; 2] {
    [
        case("event with journal, on one processor", CommandedEvent::OneProcessor),
        case("event with journal, on two processors", CommandedEvent::Woken),
    ]
}

fn case(name: &str, event: CommandedEvent) -> Case {
    Case::new(name, None, "us", move |settings, subject| {
        let contenders = [
            Contender::sampled("rohrpost", || turn(settings, event, true)),
            Contender::sampled("without journal", || turn(settings, event, false)).beside(at_most(1.15), None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

/// Microseconds of each command.
fn turn(settings: &Settings, event: CommandedEvent, has_journal: bool) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    let config = scratch.directory().join("bench.toml");
    let recording = if has_journal { RECORDING.replace("MODULE", "motor.0") } else { String::new() };
    fs::write(&config, configuration("motor", "optional = true") + &recording).or_fail("its configuration")?;
    let mut module = start_motor(&scratch.directory(), &config, event.placement())?;
    let samples = sample_in_child(PATIENCE, |samples| {
        let commanded = event.time(settings, &scratch.directory(), &config, samples);
        commanded.and_then(|node| check(&node, has_journal)).map_err(as_failure("commanding a module"))
    })?;
    if module.has_ended()? {
        return Err(Failure::Failed("the module has ended".into()));
    }
    Ok(samples)
}

/// Whether there is a journal, with something in it, or none.
fn check(node: &Node, has_journal: bool) -> Done<()> {
    let journal = node.inspect_stream(StreamId { name: MOTOR, number: JOURNAL_NUMBER })?;
    match journal.map(|journal| journal.written) {
        Some(1..) if has_journal => Ok(()),
        None if !has_journal => Ok(()),
        written => Err(format!("records of the journal: {written:?}").into()),
    }
}
