//! `rohrpost send`: repeats a command, like a person at a keyboard. Unlike `call` it waits for no answer
//! before it sends the next; answers are counted.

use crate::look::observer::Tool;
use crate::look::target::{Running, Target};
use crate::running::call::{COMMON, body_of, names};
use crate::terminal::units::{LOOK, Stop, rate, seconds};
use crate::terminal::{Failure, complain, say};
use rohrpost::output::plain;
use rohrpost::schema::{Description, Function, Value, decode};
use rohrpost::{CallError, Name};
use rohrpost_mailbox::wait_any;
use std::process::ExitCode;
use std::time::{Duration, Instant};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost send motor.0 drive 0.3 0.5                 ten times a second, until Ctrl-C
  rohrpost send motor.0 drive 0.3 0.5 --rate 20 --count 40
Each error is printed once, then counted. A command that waits longer than --timeout is not run. Commands that \
come due while this program is blocked are skipped, not sent in a burst.")]
pub(crate) struct Arguments {
    /// Module or alias, such as motor.0.
    name: String,
    /// Function.
    function: String,
    /// Its arguments.
    #[arg(allow_negative_numbers = true)]
    arguments: Vec<String>,
    #[command(flatten)]
    target: Target,
    /// Commands a second.
    #[arg(long, default_value_t = 10.0, value_name = "HZ", value_parser = rate)]
    rate: f64,
    /// End after this many commands.
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Validity of a command, seconds; at the end, answers are awaited for the same time.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    timeout: f64,
    /// Print the counts as one JSON object.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let module = running.module(&arguments.name)?;
    let period = Duration::from_secs_f64(1.0 / arguments.rate);
    let timeout = seconds(arguments.timeout)?;
    let description = running.describe(module)?;
    let function = description
        .function(&arguments.function)
        .ok_or_else(|| no_function(arguments, &running.text(module), &description))?;
    let body = body_of(function, &arguments.arguments)?;
    let stop = Stop::new()?;
    let mut sending = Sending {
        running: &running,
        module,
        function,
        interface: description.hash(),
        body,
        timeout,
        tool: running.join(timeout)?,
        under_way: Vec::new(),
        counts: Counts::default(),
        told: Vec::new(),
    };
    let mut next = Instant::now();
    while arguments.count.is_none_or(|count| sending.counts.sent + sending.counts.not_sent < count) {
        let now = Instant::now();
        if now >= next {
            sending.send();
            let late = now.duration_since(next).as_nanos();
            sending.counts.left_out += (late / period.as_nanos()) as u64;
            // The rest of the current period; it is shorter than a period, and so fits.
            next = now + period - Duration::from_nanos((late % period.as_nanos()) as u64);
        }
        sending.collect_until(next.min(Instant::now() + LOOK));
        if stop.within(Duration::ZERO) {
            break;
        }
    }
    // Ctrl-C, a second time or for the first time, ends the wait for answers, too.
    let deadline = Instant::now() + timeout;
    while !sending.under_way.is_empty() && Instant::now() < deadline && !stop.within(Duration::ZERO) {
        sending.collect_until(deadline.min(Instant::now() + LOOK));
    }
    sending.finish(arguments.json)
}

/// Why there is nothing to send. Functions that every module has, such as `off`, need no repetition.
fn no_function(arguments: &Arguments, name: &str, description: &Description) -> String {
    let function = &arguments.function;
    if COMMON.iter().any(|(common, ..)| common == function) {
        return format!("`{function}` needs no repetition: `rohrpost call {name} {function}`");
    }
    match &names(description)[..] {
        [] => format!("no function `{function}`; {name} has none to send"),
        own => plain::line(&format!("no function `{function}`; it has: {}", own.join(", "))).into_owned(),
    }
}

/// A command that is sent repeatedly.
struct Sending<'a> {
    running: &'a Running,
    module: Name,
    function: &'a Function,
    interface: u32,
    body: Vec<u8>,
    timeout: Duration,
    tool: Tool,
    /// Calls without an answer so far.
    under_way: Vec<u32>,
    counts: Counts,
    /// Errors that were reported already.
    told: Vec<String>,
}

#[derive(Default, serde::Serialize)]
struct Counts {
    sent: u64,
    /// Due while this program did not run.
    left_out: u64,
    not_sent: u64,
    answered: u64,
    /// Answered with the function's own error.
    refused: u64,
    /// Not run: the module is off, the interface differs, …
    faults: u64,
    timeouts: u64,
}

impl Sending<'_> {
    fn send(&mut self) {
        let body = &self.body;
        let write = |to: &mut Vec<u8>| {
            to.extend_from_slice(body);
            Ok(())
        };
        match self.tool.link.begin(self.module, self.function.number, self.interface, self.timeout, write) {
            Ok(call) => {
                self.counts.sent += 1;
                self.under_way.push(call);
            }
            Err(error) => {
                self.counts.not_sent += 1;
                self.tell(&error);
            }
        }
    }

    /// Takes answers as they come.
    fn collect_until(&mut self, until: Instant) {
        loop {
            self.tool.link.collect();
            let mut answers = Vec::new();
            let link = &mut self.tool.link;
            self.under_way.retain(|call| match link.poll_for(*call, |bytes| Ok(bytes.to_vec())) {
                Some(answer) => {
                    answers.push(answer);
                    false
                }
                None => true,
            });
            answers.into_iter().for_each(|answer| self.count(answer));
            if Instant::now() >= until {
                return;
            }
            wait_any(&mut [self.tool.link.replies()], Some(until), || false);
        }
    }

    fn count(&mut self, answer: Result<Vec<u8>, CallError>) {
        match answer {
            Ok(bytes) => match decode(&self.function.result, &bytes) {
                Ok(Value::Variant(outcome, why)) if outcome == "Err" => {
                    self.counts.refused += 1;
                    self.tell_once(format!("{}: {why}", plain::line(&self.function.name)));
                }
                _ => self.counts.answered += 1,
            },
            Err(error) => {
                match error {
                    CallError::Timeout(..) => self.counts.timeouts += 1,
                    _ => self.counts.faults += 1,
                }
                self.tell(&error);
            }
        }
    }

    fn tell(&mut self, error: &CallError) {
        self.tell_once(self.running.told(self.module, error).to_string());
    }

    fn tell_once(&mut self, text: String) {
        if !self.told.contains(&text) {
            complain(&text);
            self.told.push(text);
        }
    }

    fn finish(self, json: bool) -> Result<ExitCode, Failure> {
        let counts = self.counts;
        if json {
            say(serde_json::to_string(&counts)?);
        } else {
            let others = [
                ("left out", counts.left_out),
                ("not sent", counts.not_sent),
                ("refused", counts.refused),
                ("faults", counts.faults),
                ("timeouts", counts.timeouts),
            ];
            let others = others.iter().filter(|(_, n)| *n > 0).map(|(what, n)| format!(", {n} {what}"));
            say(format_args!("{} sent, {} answered{}", counts.sent, counts.answered, others.collect::<String>()));
        }
        let well = counts.not_sent + counts.refused + counts.faults + counts.timeouts == 0;
        Ok(if well { ExitCode::SUCCESS } else { ExitCode::FAILURE })
    }
}
