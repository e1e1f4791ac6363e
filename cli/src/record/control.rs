//! `record on`, `off`, `directory`, `status`, `mark` and `rotate`: orders to the recorder that runs.

use crate::look::target::{Running, Target};
use crate::terminal::units::seconds;
use crate::terminal::{Failure, say};
use rohrpost::ToolLink;
use rohrpost::interfaces::RecorderInterface;
use rohrpost::output::plain;
use rohrpost::wire::{append, from_bytes};
use rohrpost_config::RECORDER;
use rohrpost_mailbox::Name;
use rohrpost_recording::ControlCommand;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Numbers of the functions `order` and `answer`.
const ORDER: u16 = 18;
const ANSWER: u16 = 19;
/// How often an answer is asked for that is not there yet.
const POLL: Duration = Duration::from_millis(20);

#[derive(clap::Args)]
pub(super) struct RecorderTarget {
    #[command(flatten)]
    target: Target,
    /// Timeout for the answer, seconds.
    #[arg(long, default_value_t = 10.0, value_name = "SECONDS")]
    timeout: f64,
}

#[derive(clap::Args)]
pub(super) struct DirectoryArguments {
    /// Folder: the configured one, or one below it, by its path from there. A new one is made.
    path: String,
    #[command(flatten)]
    recorder: RecorderTarget,
}

#[derive(clap::Args)]
pub(super) struct MarkArguments {
    /// What happened, in one line.
    #[arg(required = true)]
    text: Vec<String>,
    #[command(flatten)]
    recorder: RecorderTarget,
}

pub(super) fn directory(arguments: &DirectoryArguments) -> Result<ExitCode, Failure> {
    order(&ControlCommand::Directory(arguments.path.clone()), &arguments.recorder)
}

pub(super) fn mark(arguments: &MarkArguments) -> Result<ExitCode, Failure> {
    order(&ControlCommand::Mark(arguments.text.join(" ")), &arguments.recorder)
}

/// Gives an order, waits for the answer and says it.
pub(super) fn order(command: &ControlCommand, recorder: &RecorderTarget) -> Result<ExitCode, Failure> {
    let timeout = seconds(recorder.timeout)?;
    let running = recorder.target.find()?;
    let module = running.installation.recorder().ok_or_else(|| {
        format!("the configuration has no recorder; add `[record]` and a module with `builtin = \"{RECORDER}\"`")
    })?;
    let mut tool = running.join(timeout)?;
    let told = answer(command, &running, module.name, timeout, &mut tool);
    let answer = told?;
    match answer.split_once(' ') {
        Some(("ERR", why)) => Err(plain::line(why).into()),
        Some((_, told)) => Ok(done(told)),
        None => Ok(done("ok")),
    }
}

fn done(told: &str) -> ExitCode {
    say(plain::line(told));
    ExitCode::SUCCESS
}

fn answer(
    command: &ControlCommand,
    running: &Running,
    recorder: Name,
    timeout: Duration,
    tool: &mut ToolLink,
) -> Result<String, Failure> {
    let began = Instant::now();
    let hash = RecorderInterface::hash();
    let line = command.to_string();
    let told = |error| running.told(recorder, &error);
    let read = |bytes: &[u8]| from_bytes::<u32>(bytes);
    let order = tool.call(recorder, ORDER, hash, |body| append(body, &(&line,)), read).map_err(told)?;
    loop {
        let read = |bytes: &[u8]| from_bytes::<Option<String>>(bytes);
        if let Some(answer) = tool.call(recorder, ANSWER, hash, |body| append(body, &(order,)), read).map_err(told)? {
            return Ok(answer);
        }
        if began.elapsed() >= timeout {
            let s = timeout.as_secs_f64();
            return Err(format!("no answer within {s} s: the disk is slow; the recorder goes on with it").into());
        }
        std::thread::sleep(POLL);
    }
}
