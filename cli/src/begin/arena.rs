//! `rohrpost arena`: moves a simulated robot, and referees it.

use super::check;
use crate::terminal::{Failure, say};
use rohrpost_builtin::{OpenArena, Report, Touch};
use rohrpost_launch::events;
use rohrpost_mailbox::monotonic_ns;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost arena robot.toml
  rohrpost arena robot.toml --seconds 60 --touches touches.jsonl
The robot's body is the module of the configuration with `builtin = \"sim\"` and `arena` in its settings. Start the \
    arena first, then the robot. Ends by Ctrl-C, with 0 if the robot moved towards nothing that it touched, else \
    with 1.")]
pub(crate) struct Arguments {
    /// The configuration of the robot.
    file: PathBuf,
    /// Write each touch into this new file, a line of JSON each, and the sum at the end.
    #[arg(long, value_name = "FILE")]
    touches: Option<PathBuf>,
    /// End after this many seconds.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let long = arguments.seconds.map(crate::terminal::units::seconds).transpose()?;
    let installation = check::load(&arguments.file)?;
    let create = |path: &PathBuf| File::create_new(path).map_err(|error| format!("{}: {error}", path.display()));
    let mut touches = arguments.touches.as_ref().map(create).transpose()?;
    let events = events()?;
    let mut arena = OpenArena::open(&installation)?;
    let (began, began_ns) = (Instant::now(), monotonic_ns());
    say(format!("the arena is open at {}", arena.path().display()));
    let is_over = || long.is_some_and(|long| began.elapsed() >= long) || events.try_recv().is_ok();
    let mut written = Ok(());
    let report = arena.run(is_over, |touch| {
        say(told(&touch, began_ns));
        written = std::mem::replace(&mut written, Ok(())).and_then(|()| write(touches.as_mut(), &touch));
    })?;
    written.and_then(|()| write(touches.as_mut(), &report))?;
    say(verdict(&report, began.elapsed()));
    Ok(if report.counted == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn write(file: Option<&mut File>, what: &impl serde::Serialize) -> std::io::Result<()> {
    let Some(file) = file else { return Ok(()) };
    writeln!(file, "{}", serde_json::to_string(what)?)
}

fn told(touch: &Touch, began_ns: u64) -> String {
    let at_s = touch.at_ns.saturating_sub(began_ns) as f64 / 1e9;
    let counts = if touch.is_towards { "it moved towards it" } else { "it did not move towards it" };
    format!(
        "{at_s:.2} s: the robot touched something at ({:.2} m, {:.2} m) with {:.2} m/s; {counts}",
        touch.x_m, touch.y_m, touch.speed_m_s
    )
}

/// The referee's result in words.
pub(super) fn verdict(report: &Report, long: Duration) -> String {
    let Report { touches, counted, way_m, .. } = report;
    format!(
        "{counted} touches count against the robot, of {touches} in all; it drove {way_m:.1} m in {:.1} s",
        long.as_secs_f64()
    )
}
