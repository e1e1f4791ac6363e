//! Modules in Python on one node: data between two of them, beside the same in Rust and what else there is for Python;
//! pictures that are read in place; and calls of a module in Rust.

use super::turn::{BYTES, cell};
use crate::cases::errors::as_failure;
use crate::foreign::{ForeignProgram, time_one_program, time_two_programs};
use crate::languages::Interpreter;
use crate::motor::{reach_motor, start_motor};
use crate::player::player;
use crate::tcp::systems::free_address;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Child, End, Failure, OrFail, Scratch, sample_in_child, settle};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Ratio to Rust.
const OF_RUST: f64 = 2.5;
/// Ratio to others.
const OF_PEERS: f64 = 1.0;
/// Ratio to a picture of a quarter of the size: a figure of this many rounds differs from itself by as much.
const OF_SMALLER: f64 = 1.1;
/// Pictures of one byte a pixel.
const SIZES: [[usize; 2]; 2] = [[1920, 1080], [3840, 2160]];
const PATIENCE: Duration = Duration::from_secs(60);
const CONFIGURATION: &str = r#"
installation = "bench"
[system]
name = "bench"
id = 1
[classes]
motor = { id = 200, text = "Answers calls" }
player = { id = 199, text = "Plays ping-pong" }
camera = { id = 198, text = "Writes pictures" }
looker = { id = 197, text = "Reads them" }
caller = { id = 196, text = "Calls" }
tool = { id = 16, text = "Tools" }
[nodes.main]
[[module]]
name = "motor.0"
program = "motor"
optional = true
[[module]]
name = "player.0"
program = "player"
optional = true
calls = ["player.1"]
[[module]]
name = "player.1"
program = "player"
optional = true
calls = ["player.0"]
[[module]]
name = "camera.0"
program = "camera"
optional = true
[module.stream.image]
record = "8 MiB"
keep = 4
[module.stream.bare]
record = "8 MiB"
keep = 4
[[module]]
name = "looker.0"
program = "looker"
optional = true
calls = ["camera.0"]
[[module]]
name = "caller.0"
program = "caller"
optional = true
calls = ["motor.0"]
"#;

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    let [small, large] = SIZES.map(|size| {
        Case::new("Python, picture", size.iter().product::<usize>(), "us", move |settings, subject| {
            Ok(Picture { size }.measure(settings, subject))
        })
    });
    vec![
        Case::new("Python, data", BYTES, "us", between),
        small,
        large,
        Case::new("Python, call", None, "us", call_from_python),
    ]
}

/// A node of its own, by its files.
struct ScratchNode {
    scratch: Scratch,
}

impl ScratchNode {
    fn new() -> Result<Self, Failure> {
        let node = Self { scratch: Scratch::new()? };
        fs::write(node.config(), CONFIGURATION).or_fail("configuration")?;
        Ok(node)
    }

    fn config(&self) -> PathBuf {
        self.scratch.directory().join("bench.toml")
    }

    /// A module in Python.
    fn runs(&self, python: &Interpreter, script: &str, own: &[&str]) -> Result<ForeignProgram, Failure> {
        python.require("rohrpost._node")?;
        let mut program = python.runs(script, own);
        program.last.push(self.config().into());
        program.environment.push(("ROHRPOST_DIR", self.scratch.directory().into()));
        Ok(program)
    }
}

/// Data of 64 bytes from one module to another.
fn between(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let (cell, python) = (cell(settings), Interpreter::of(settings));
    let contenders = [
        Contender::sampled("Python", || {
            let place = ScratchNode::new()?;
            one_way(time_two_programs(&cell, &place.scratch, &place.runs(&python, "player.py", &[])?))
        }),
        Contender::sampled("Rust", || {
            let place = ScratchNode::new()?;
            let program = player(&place.scratch.directory(), &place.config())?;
            one_way(time_two_programs(&cell, &place.scratch, &program))
        })
        .beside(at_most(OF_RUST), None),
        Contender::sampled("iceoryx2", || {
            python.require("iceoryx2")?;
            let scratch = Scratch::new()?;
            let program = python.runs("iceoryx.py", &names(&scratch).each_ref().map(String::as_str));
            one_way(time_two_programs(&cell, &scratch, &program))
        })
        .beside(at_most(OF_PEERS), None),
        Contender::sampled("zenoh", || {
            python.require("zenoh")?;
            let (address, scratch) = (free_address()?.to_string(), Scratch::new()?);
            one_way(time_two_programs(&cell, &scratch, &python.runs("zenoh_peer.py", &[&address])))
        })
        .beside(at_most(OF_PEERS), None),
    ];
    Ok(compare(settings, subject, &contenders))
}

/// Where what iceoryx2 makes lies, and the prefix of its names in shared memory.
fn names(scratch: &Scratch) -> [String; 2] {
    [scratch.directory().display().to_string(), scratch.name().to_owned()]
}

fn one_way(round_trips: Result<Vec<f64>, Failure>) -> Result<Vec<f64>, Failure> {
    Ok(round_trips?.into_iter().map(|us| us / 2.0).collect())
}

/// The newest of pictures that are written in place: taken, a line's mean made of it, given back.
struct Picture {
    size: [usize; 2],
}

impl Picture {
    /// Microseconds of each.
    fn turn(&self, cell: &Cell, python: &Interpreter, (size, stream): ([usize; 2], &str)) -> Result<Vec<f64>, Failure> {
        let (place, [width, height]) = (ScratchNode::new()?, size.map(|pixels| pixels.to_string()));
        let program = place.runs(python, "picture.py", &[&width, &height, stream])?;
        time_two_programs(cell, &place.scratch, &program)
    }

    fn iceoryx(&self, cell: &Cell, python: &Interpreter) -> Result<Vec<f64>, Failure> {
        python.require("iceoryx2")?;
        let (scratch, [width, height]) = (Scratch::new()?, self.size.map(|pixels| pixels.to_string()));
        let [folder, prefix] = names(&scratch);
        let program = python.runs("iceoryx_picture.py", &[&width, &height, &folder, &prefix]);
        time_two_programs(cell, &scratch, &program)
    }

    fn measure(&self, settings: &Settings, subject: &Subject) -> Vec<Row> {
        let (cell, python) = (cell(settings), Interpreter::of(settings));
        if let Err(skipped) = python.require("numpy") {
            return vec![Row::alone(subject.clone(), "Python", Err(skipped))];
        }
        let mut contenders = vec![
            Contender::sampled("Python", || self.turn(&cell, &python, (self.size, "image"))),
            Contender::sampled("iceoryx2", || self.iceoryx(&cell, &python)).beside(at_most(OF_PEERS), None),
            Contender::sampled("Python, pixels alone", || self.turn(&cell, &python, (self.size, "bare"))),
        ];
        if self.size != SIZES[0] {
            let smaller = Contender::sampled("1920 x 1080", || self.turn(&cell, &python, (SIZES[0], "image")));
            contenders.push(smaller.beside(at_most(OF_SMALLER), None));
        }
        compare(settings, subject, &contenders)
    }
}

/// A call of a module in Rust that does nothing else, on the other processor.
fn call_from_python(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let (cell, python) = (cell(settings), Interpreter::of(settings));
    let contenders = [
        Contender::sampled("Python", || {
            let (place, motor) = called(&cell)?;
            let program = place.runs(&python, "caller.py", &[])?;
            let samples = time_one_program(&cell, &place.scratch, &program);
            drop(motor);
            samples
        }),
        Contender::sampled("Rust", || call(&cell)).beside(at_most(OF_RUST), None),
    ];
    Ok(compare(settings, subject, &contenders))
}

/// The module that is called; it ends with what is given.
fn called(cell: &Cell) -> Result<(ScratchNode, Child), Failure> {
    let place = ScratchNode::new()?;
    let motor = start_motor(&place.scratch.directory(), &place.config(), cell.placement)?;
    Ok((place, motor))
}

/// The same from Rust: microseconds of each call.
fn call(cell: &Cell) -> Result<Vec<f64>, Failure> {
    let (place, _motor) = called(cell)?;
    sample_in_child(PATIENCE, |samples| {
        settle(End::Ping, cell.placement, cell.scheduling)?;
        let reached = reach_motor(&place.scratch.directory(), &place.config());
        let (_node, motor) = reached.map_err(as_failure("a module"))?;
        let began = Instant::now();
        for number in 0..cell.warm_up + cell.messages {
            cell.pause.take();
            let sent = Instant::now();
            motor.drive(0.5, 0.25).or_fail("drive")?;
            let took = sent.elapsed();
            let is_warm = number >= cell.warm_up || began.elapsed() > cell.cap / 4;
            if is_warm {
                samples.push(took.as_secs_f64() * 1e6);
            }
            if began.elapsed() > cell.cap && !samples.is_empty() {
                break;
            }
        }
        Ok(())
    })
}
