//! How long a command takes to a module that writes a journal, and to one that writes none. Module and caller sleep
//! before each: modules of a robot wait for what comes. Awake, a command takes a fiftieth of the time, so which of both
//! it is must be the same in all rounds; that is brought about, and counted.

use super::super::errors::{Done, as_failure};
use crate::motor::{MOTOR, reach_motor, start_motor};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    End, Failure, OrFail, Placement, Samples, Scheduling, Scratch, given_away, require_asleep, sample_in_child, settle,
};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::{Node, StreamId};
use rohrpost_modules::journal::JOURNAL_NUMBER;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Commands of a turn, and those before them that do not count.
const COMMANDS: usize = 10_000;
const WARM_UP: usize = 1_000;
/// Before a command to a module on the other processor, which goes to sleep meanwhile.
const PAUSE: Duration = Duration::from_micros(100);
const PATIENCE: Duration = Duration::from_secs(120);
const CONFIGURATION: &str = r#"
installation = "bench"
[system]
name = "bench"
id = 1
[classes]
motor = { id = 200, text = "Drives" }
logd = { id = 24, text = "Records" }
tool = { id = 16, text = "Tools" }
[nodes.main]
[[module]]
name = "motor.0"
program = "motor"
optional = true
"#;
/// That it writes a journal. Nobody records.
const RECORDING: &str = include_str!("../../../../tests/testbed/journal.toml");

/// All cases of this file.
pub(super) fn cases() -> [Case; 2] {
    [
        case("event with journal, on one processor", NotedEvent::OneProcessor),
        case("event with journal, on two processors", NotedEvent::Woken),
    ]
}

fn case(name: &str, event: NotedEvent) -> Case {
    Case::new(name, None, "us", move |settings, subject| {
        let contenders = [
            Contender::sampled("rohrpost", || turn(settings, &event, true)),
            Contender::sampled("without journal", || turn(settings, &event, false)).beside(at_most(1.15), None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

/// A command to a module and its answer.
enum NotedEvent {
    /// Both on one processor: the one runs only while the other sleeps. No processor is woken, so it takes the least
    /// time, of which the journal's part is the largest.
    OneProcessor,
    /// Each on its own: a processor is woken for each.
    Woken,
}

impl NotedEvent {
    fn placement(&self) -> Placement {
        match self {
            Self::OneProcessor => Placement::OneCore,
            Self::Woken => Placement::TwoCores,
        }
    }

    fn before_each(&self) {
        match self {
            Self::OneProcessor => {}
            Self::Woken => std::thread::sleep(PAUSE),
        }
    }
}

/// Microseconds of each command.
fn turn(settings: &Settings, event: &NotedEvent, has_journal: bool) -> Result<Vec<f64>, Failure> {
    let scratch = Scratch::new()?;
    let config = scratch.directory().join("bench.toml");
    let recording = if has_journal { RECORDING.replace("MODULE", "motor.0") } else { String::new() };
    fs::write(&config, format!("{CONFIGURATION}{recording}")).or_fail("its configuration")?;
    let mut module = start_motor(&scratch.directory(), &config, event.placement())?;
    let counts = [WARM_UP, COMMANDS].map(|count| settings.count(count));
    let samples = sample_in_child(PATIENCE, |samples| {
        let commanded = command(&scratch.directory(), &config, (event, module.pid()), counts, samples);
        commanded.and_then(|node| check(&node, has_journal)).map_err(as_failure("commanding a module"))
    })?;
    if module.has_ended()? {
        return Err(Failure::Failed("the module has ended".into()));
    }
    Ok(samples)
}

/// Gives a module, which is that process, its commands, one after the other.
fn command(
    scratch: &Path,
    config: &Path,
    (event, module): (&NotedEvent, i32),
    [warm_up, commands]: [usize; 2],
    samples: &Samples,
) -> Done<Arc<Node>> {
    settle(End::Ping, event.placement(), Scheduling::Fifo)?;
    let (node, motor) = reach_motor(scratch, config)?;
    for _ in 0..warm_up {
        event.before_each();
        motor.drive(0.5, 0.25)?;
    }
    let slept = given_away(module)?;
    for _ in 0..commands {
        event.before_each();
        let began = Instant::now();
        motor.drive(0.5, 0.25)?;
        samples.push(began.elapsed().as_secs_f64() * 1e6);
    }
    require_asleep("the module", commands as u64, given_away(module)?.saturating_sub(slept))?;
    Ok(node)
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
