//! Contenders that are programs, in any language: started in children that are placed and scheduled as all others are.
//!
//! ```text
//!  argv    …, `ping` or `pong`, bytes, messages, warm-up, pause before each (ns), cap (ms), file for samples, …
//!  stdout  a line each time when it is as far as the other end must be, too
//!  stdin   a line when both ends are
//!  file    round trips, ns: u64 each, little-endian
//!  stderr  why it failed, if its exit code is not 0
//! ```

use rohrpost_bench_local::harness::{
    Cell, Child, End, Failure, GRACE, OrFail, Pause, Placement, SECOND_ENDS, Scheduling, Scratch, interrupted, settle,
};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{PipeWriter, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// An interpreter starts within this time, also on a busy computer.
const START: Duration = Duration::from_secs(20);
const LOOK_EACH: Duration = Duration::from_millis(2);
/// Of what a failed program said, the end: reasons come last.
const SAID_BYTES: usize = 2000;

/// A program of a contender, and what it is told.
#[derive(Clone, Debug)]
pub struct ForeignProgram {
    /// What is run.
    pub program: PathBuf,
    /// Before the arguments that every such program has: a script, say.
    pub first: Vec<OsString>,
    /// Behind them.
    pub last: Vec<OsString>,
    /// Variables of its environment.
    pub environment: Vec<(&'static str, OsString)>,
}

impl ForeignProgram {
    fn command(&self, end: End, cell: &Cell, samples: &Path) -> Command {
        let end = if end == End::Ping { "ping" } else { "pong" };
        // None of these programs is asked to sleep.
        let pause_ns = if let Pause::Awake(pause) = cell.pause { pause.as_nanos() } else { 0 };
        let numbers = [cell.bytes as u128, cell.messages as u128, cell.warm_up as u128, pause_ns, cell.cap.as_millis()];
        let mut command = Command::new(&self.program);
        command.args(&self.first).arg(end).args(numbers.map(|number| number.to_string())).arg(samples);
        command.args(&self.last).envs(self.environment.iter().cloned());
        command
    }
}

/// One that runs.
struct ForeignChild {
    child: Child,
    goes_on: PipeWriter,
    folder: PathBuf,
    name: &'static str,
}

impl ForeignChild {
    /// Starts a command; `folder` is for what it says, in files of this name.
    ///
    /// # Errors
    /// When there can be no further process.
    fn start(
        mut command: Command,
        name: &'static str,
        folder: &Path,
        (end, placement, scheduling): (End, Placement, Scheduling),
    ) -> Result<Self, Failure> {
        let (input, goes_on) = std::io::pipe().or_fail(name)?;
        let create = |kind| File::create(said(folder, name, kind)).or_fail(name);
        command.stdin(input).stdout(create("out")?).stderr(create("err")?);
        let child = Child::start(|| {
            settle(end, placement, scheduling)?;
            let error = command.exec();
            Err(Failure::Failed(format!("{}: {error}", Path::new(command.get_program()).display())))
        })?;
        Ok(Self { child, goes_on, folder: folder.to_owned(), name })
    }

    /// How often it was as far as others must be, too.
    fn meetings(&self) -> usize {
        let said = fs::read(said(&self.folder, self.name, "out")).unwrap_or_default();
        said.iter().filter(|byte| **byte == b'\n').count()
    }

    fn go_on(&mut self) {
        // One that has ended reads nothing; its end says why.
        let _ = self.goes_on.write_all(b"\n");
    }

    fn has_ended(&mut self) -> Result<bool, Failure> {
        self.child.has_ended()
    }

    /// Waits for its end.
    ///
    /// # Errors
    /// That it failed, with what it said, or that it was killed.
    fn finish(self, deadline: Instant) -> Result<(), Failure> {
        let errors = said(&self.folder, self.name, "err");
        self.child.finish_program(deadline).map_err(|failure| match failure {
            Failure::Skipped(why) => Failure::Skipped(why),
            Failure::Failed(why) => {
                let said = fs::read(errors).unwrap_or_default();
                let said = String::from_utf8_lossy(&said[said.len().saturating_sub(SAID_BYTES)..]).trim().to_owned();
                Failure::Failed(format!("{}: {why}{}{said}", self.name, if said.is_empty() { "" } else { "; " }))
            }
        })
    }
}

/// Lets all of them go on as often as all have come equally far, until one ends or the time is over.
///
/// # Errors
/// When the kernel does not know one of them, which cannot be.
fn meet_until_one_ends(children: &mut [ForeignChild], deadline: Instant) -> Result<(), Failure> {
    let mut met = 0;
    while Instant::now() < deadline && !interrupted() {
        for child in &mut *children {
            if child.has_ended()? {
                return Ok(());
            }
        }
        if children.iter().map(ForeignChild::meetings).min().is_some_and(|least| least > met) {
            met += 1;
            children.iter_mut().for_each(ForeignChild::go_on);
        }
        std::thread::sleep(LOOK_EACH);
    }
    Ok(())
}

/// Times a program with itself, one at each end. Gives their round trips, µs.
///
/// # Errors
/// What either failed with, the one that ended first.
pub fn time_two_programs(cell: &Cell, scratch: &Scratch, program: &ForeignProgram) -> Result<Vec<f64>, Failure> {
    let folder = scratch.directory();
    let start = |end| {
        let name = if end == End::Ping { "ping" } else { "pong" };
        let command = program.command(end, cell, &folder.join("samples"));
        ForeignChild::start(command, name, &folder, (end, cell.placement, cell.scheduling))
    };
    let mut children = [start(End::Pong)?, start(End::Ping)?];
    let deadline = Instant::now() + START + cell.cap + GRACE;
    meet_until_one_ends(&mut children, deadline)?;
    let [mut pong, ping] = children;
    // One that fails leaves the other waiting for ever: what the first one says counts.
    let (first, second) = if pong.has_ended()? { (pong, ping) } else { (ping, pong) };
    first.finish(deadline)?;
    second.finish(deadline.min(Instant::now() + SECOND_ENDS))?;
    round_trips(&folder)
}

/// Times one program, which asks somebody else. Gives its round trips, µs.
///
/// # Errors
/// What it failed with.
pub fn time_one_program(cell: &Cell, scratch: &Scratch, program: &ForeignProgram) -> Result<Vec<f64>, Failure> {
    let folder = scratch.directory();
    let command = program.command(End::Ping, cell, &folder.join("samples"));
    let mut child = [ForeignChild::start(command, "ping", &folder, (End::Ping, cell.placement, cell.scheduling))?];
    let deadline = Instant::now() + START + cell.cap + GRACE;
    meet_until_one_ends(&mut child, deadline)?;
    let [child] = child;
    child.finish(deadline)?;
    round_trips(&folder)
}

fn said(folder: &Path, name: &str, kind: &str) -> PathBuf {
    folder.join(format!("{name}.{kind}"))
}

fn round_trips(folder: &Path) -> Result<Vec<f64>, Failure> {
    let bytes = fs::read(folder.join("samples")).or_fail("the file of samples")?;
    let (samples, rest) = bytes.as_chunks::<8>();
    if !rest.is_empty() {
        return Err(Failure::Failed(format!("the file of samples has {} bytes, not eight each", bytes.len())));
    }
    Ok(samples.iter().map(|ns| u64::from_le_bytes(*ns) as f64 / 1000.0).collect())
}
