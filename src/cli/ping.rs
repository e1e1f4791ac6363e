//! `rohrpost ping`: how long a module takes to answer.

use super::call::seconds;
use super::table::time;
use super::target::{Running, Target};
use super::{Failure, say};
use rohrpost::launch::{Event, events};
use rohrpost::mailbox::ModuleState;
use rohrpost::survey::Survey;
use rohrpost::{CallError, Name};
use serde_json::json;
use std::process::ExitCode;
use std::time::{Duration, Instant};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost ping motor.0               once a second; Ctrl-C ends it
  rohrpost ping motor.0 -c 100 --interval 0.01
It calls `status`. The time is that of the whole round: a module answers between its own work, and so what it does just \
then is in it, as is being waited for behind more important classes. The exit code is 1 if nothing was answered.")]
pub(super) struct Arguments {
    /// Module or face, such as motor.0.
    name: String,
    #[command(flatten)]
    target: Target,
    /// End after so many; without it, at Ctrl-C.
    #[arg(long, short, value_name = "N")]
    count: Option<u64>,
    /// From one to the next.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    interval: f64,
    /// Wait so long for each answer.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    timeout: f64,
    /// One JSON object a line: each answer, then all.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let module = running.module(&arguments.name)?;
    let (interval, timeout) = (seconds(arguments.interval)?, seconds(arguments.timeout)?);
    let stop = events()?;
    let mut tool = running.join(timeout)?;
    let mut rounds = Rounds::default();
    loop {
        let began = Instant::now();
        let answer = tool.status(module);
        let took = began.elapsed();
        rounds.sent += 1;
        let told = match answer {
            Ok(_) => {
                rounds.took.push(took);
                if arguments.json {
                    say(json!({"number": rounds.sent, "round_trip_s": took.as_secs_f64()}))
                } else {
                    say(format_args!("{}: answer {} after {}", arguments.name, rounds.sent, time(took)))
                }
            }
            Err(error) => tell_loss(arguments, &running, module, rounds.sent, &error),
        };
        let enough = arguments.count.is_some_and(|count| rounds.sent >= count);
        let wait = interval.saturating_sub(began.elapsed());
        if !told || enough || stopped(&stop, wait) {
            break;
        }
    }
    tool.close();
    let summary = if arguments.json { rounds.json() } else { rounds.text(&arguments.name) };
    say(summary);
    if rounds.took.is_empty() {
        return Err(why_silent(&running, module)?.into());
    }
    Ok(ExitCode::SUCCESS)
}

/// Waits, and says whether somebody wants an end meanwhile.
pub(super) fn stopped(stop: &std::sync::mpsc::Receiver<Event>, wait: Duration) -> bool {
    matches!(stop.recv_timeout(wait), Ok(Event::Stop))
}

fn tell_loss(arguments: &Arguments, running: &Running, module: Name, number: u64, error: &CallError) -> bool {
    let why = match error {
        CallError::Timeout(_, time) => format!("no answer within {time:?}"),
        error => running.told(module, error).to_string(),
    };
    if arguments.json {
        return say(json!({"number": number, "round_trip_s": null, "error": why}));
    }
    say(format_args!("{}: none {number}: {why}", arguments.name))
}

/// What shared memory tells of a module that does not answer, and what to do.
fn why_silent(running: &Running, module: Name) -> Result<String, Failure> {
    let name = running.text(module);
    let survey = Survey::new(&running.node, &running.installation, &running.node_name)?;
    let found = survey.module(module);
    Ok(match found.and_then(|found| found.process.as_ref().map(|process| (found, process))) {
        Some((found, process)) => format!(
            "{name} answered nothing: its process {} is there, its state is {}, and {} packages wait for it; it hangs, was \
             stopped (kill -CONT {0} goes on), or works longer than that: see `rohrpost log --module {name}`",
            process.pid,
            process.state.map_or("unknown", ModuleState::name),
            found.depth
        ),
        None => running.absent(module).to_string(),
    })
}

/// All rounds so far.
#[derive(Default)]
struct Rounds {
    sent: u64,
    took: Vec<Duration>,
}

impl Rounds {
    fn sorted(&self) -> Option<Vec<Duration>> {
        let mut took = self.took.clone();
        took.sort_unstable();
        (!took.is_empty()).then_some(took)
    }

    fn lost(&self) -> u64 {
        self.sent - self.took.len() as u64
    }

    fn text(&self, name: &str) -> String {
        let count = format!("\n{name}: {} sent, {} answered, {} lost", self.sent, self.took.len(), self.lost());
        let Some(took) = self.sorted() else { return count };
        let at = |share| time(quantile(&took, share));
        let mean = time(took.iter().sum::<Duration>() / took.len() as u32);
        format!("{count}\nmin {}  mean {mean}  p50 {}  p99 {}  max {}", at(0.0), at(0.5), at(0.99), at(1.0))
    }

    fn json(&self) -> String {
        let took = self.sorted();
        let at = |share| took.as_ref().map(|took| quantile(took, share).as_secs_f64());
        let mean = took.as_ref().map(|took| took.iter().sum::<Duration>().as_secs_f64() / took.len() as f64);
        let object = json!({
            "sent": self.sent, "answered": self.took.len(), "lost": self.lost(),
            "min_s": at(0.0), "mean_s": mean, "p50_s": at(0.5), "p99_s": at(0.99), "max_s": at(1.0),
        });
        object.to_string()
    }
}

/// The time that this share of them did not exceed.
fn quantile(sorted: &[Duration], share: f64) -> Duration {
    let rank = (share * sorted.len() as f64).ceil() as usize;
    sorted[rank.clamp(1, sorted.len()) - 1]
}
