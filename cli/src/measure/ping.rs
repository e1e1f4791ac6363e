//! `rohrpost ping`: how long a module takes to answer.

mod round_trip;

use crate::look::target::{Running, Target};
use crate::terminal::table::time;
use crate::terminal::units::{Stop, seconds};
use crate::terminal::{Failure, say, say_folded};
use rohrpost::common::TimeReport;
use rohrpost::{CallError, Fault, Name};
use rohrpost_launch::survey::Scope;
use rohrpost_mailbox::{Latency, ModuleState};
use round_trip::{DirectionSum, Moments, RoundTrip};
use serde_json::json;
use std::process::ExitCode;
use std::time::{Duration, Instant};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost ping motor.0               once a second; Ctrl-C ends it
  rohrpost ping motor.0 -c 100 --interval 0.01
Each call asks for system time. The measured time is the whole round trip: a module answers between its own work, so \
    the time includes its current work, and the wait behind more important classes. The one-way times use system \
    time, and are shown with their error bounds; if the nodes do not follow the master's clock, or the bounds are too \
    large, the output says so instead. p50 and p99 come from a histogram and are accurate to about 25 %; the others \
    are exact. Exit code 1: no call was answered.")]
pub(crate) struct Arguments {
    /// Module or alias, such as motor.0.
    name: String,
    #[command(flatten)]
    target: Target,
    /// End after this many calls; without it, at Ctrl-C.
    #[arg(long, short, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Time from one call to the next.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    interval: f64,
    /// Timeout for each answer.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    timeout: f64,
    /// One JSON object a line: each answer, then the totals.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let module = running.module(&arguments.name)?;
    let name = running.text(module);
    let (interval, timeout) = (seconds(arguments.interval)?, seconds(arguments.timeout)?);
    let stop = Stop::new()?;
    let mut tool = running.join(timeout)?;
    let mut rounds = PingRounds::default();
    loop {
        // The round trip encloses both one-way times: a delay of this process in between makes neither longer than the
        // round trip.
        let (began, before) = (Instant::now(), TimeReport::of(&tool.clock));
        let answer = tool.time(module);
        let (after, took) = (TimeReport::of(&tool.clock), began.elapsed());
        rounds.sent += 1;
        let told = match answer {
            Ok(there) => {
                let pace = tool.clock.record().map_or(1.0, |record| record.pace_ppb as f64 / 1e9);
                let moments = Moments { before: &before, there: &there, after: &after };
                let one_way = RoundTrip::new(&moments, running.is_own(module), pace);
                rounds.answered(took, one_way.as_ref().ok());
                tell_answer(arguments, &name, rounds.sent, took, &one_way)
            }
            // It has answered, if only that it does not know this function.
            Err(CallError::Fault(_, Fault::Unknown(_))) => {
                rounds.answered(took, None);
                let why = "the module was built with a Rohrpost that returns no time; rebuild it".into();
                tell_answer(arguments, &name, rounds.sent, took, &Err(why))
            }
            Err(error) => tell_loss(arguments, &running, module, rounds.sent, &error),
        };
        let enough = arguments.count.is_some_and(|count| rounds.sent >= count);
        let wait = interval.saturating_sub(began.elapsed());
        if !told || enough || stop.within(wait) {
            break;
        }
    }
    let summary = if arguments.json { rounds.json(&name) } else { rounds.text(&name) };
    say_folded(summary);
    if rounds.answered == 0 {
        return Err(why_silent(&running, module)?.into());
    }
    Ok(ExitCode::SUCCESS)
}

fn tell_answer(
    arguments: &Arguments,
    name: &str,
    number: u64,
    took: Duration,
    one_way: &Result<RoundTrip, String>,
) -> bool {
    if arguments.json {
        let (one_way, why) = (one_way.as_ref().ok(), one_way.as_ref().err());
        return say(json!({
            "module": name, "number": number, "round_trip_s": took.as_secs_f64(),
            "there_s": one_way.map(|one_way| one_way.there_s),
            "back_s": one_way.map(|one_way| one_way.back_s),
            "ways_error_s": one_way.map(|one_way| one_way.error_s), "ways_unknown": why,
        }));
    }
    let one_way = match one_way {
        Ok(one_way) => one_way.text(),
        Err(why) => format!("one-way times unknown: {why}"),
    };
    say_folded(format_args!("{name}: answer {number} after {} ({one_way})", time(took)))
}

fn tell_loss(arguments: &Arguments, running: &Running, module: Name, number: u64, error: &CallError) -> bool {
    let why = match error {
        CallError::Timeout(_, time) => format!("no answer within {time:?}"),
        error => running.told(module, error).to_string(),
    };
    let name = running.text(module);
    if arguments.json {
        return say(json!({"module": name, "number": number, "round_trip_s": null, "error": why}));
    }
    say_folded(format_args!("{name}: none {number}: {why}"))
}

/// What shared memory shows of a module that does not answer, and what to do.
fn why_silent(running: &Running, module: Name) -> Result<String, Failure> {
    let name = running.text(module);
    let survey = running.look(running.node_of(module), Scope::Module(module.raw()))?;
    let found = survey.module(module);
    Ok(match found.and_then(|found| found.process.as_ref().map(|process| (found, process))) {
        Some(_) if let Some(why) = running.standing_of_silent(module) => format!("{name} answered nothing: {why}"),
        Some((found, process)) => format!(
            "{name} answered nothing: its process {} is there, its state is {}, and {} packages wait for it; it \
             hangs, was stopped (kill -CONT {0} goes on), or works longer than that: see `rohrpost log --module \
             {name}`",
            process.pid,
            process.state.map_or("unknown", ModuleState::name),
            found.depth
        ),
        None => running.absent(module).to_string(),
    })
}

/// Statistics of all rounds, in constant memory.
#[derive(Default)]
struct PingRounds {
    sent: u64,
    answered: u64,
    min: Option<Duration>,
    took: Latency,
    there: DirectionSum,
    back: DirectionSum,
}

impl PingRounds {
    fn answered(&mut self, took: Duration, one_way: Option<&RoundTrip>) {
        self.answered += 1;
        if let Some(one_way) = one_way {
            self.there.add(one_way.there_s, one_way.error_s);
            self.back.add(one_way.back_s, one_way.error_s);
        }
        self.min = Some(self.min.map_or(took, |min| min.min(took)));
        self.took.count_one(took);
    }

    fn lost(&self) -> u64 {
        self.sent - self.answered
    }

    /// Min, mean, p50, p99, max; none without an answer.
    fn times(&self) -> Option<[Duration; 5]> {
        let (min, mean) = (self.min?, self.took.sum.div_f64(self.answered as f64));
        // A bucket may begin below the shortest time in it.
        let at = |share| self.took.quantile(share).map_or(min, |found| found.max(min));
        Some([min, mean, at(0.5), at(0.99), self.took.max])
    }

    fn text(&self, name: &str) -> String {
        let count = format!("\n{name}: {} sent, {} answered, {} lost", self.sent, self.answered, self.lost());
        let Some(times) = self.times() else { return count };
        let [min, mean, p50, p99, max] = times.map(time);
        let one_way = [("there", &self.there), ("back", &self.back)];
        let one_way = one_way.map(|(name, way)| way.text().map_or(String::new(), |text| format!("\n{name:5} {text}")));
        format!("{count}\nround min {min}  mean {mean}  p50 {p50}  p99 {p99}  max {max}{}", one_way.concat())
    }

    fn json(&self, module: &str) -> String {
        let [min, mean, p50, p99, max] = match self.times() {
            Some(times) => times.map(|time| Some(time.as_secs_f64())),
            None => [None; 5],
        };
        let object = json!({
            "module": module, "sent": self.sent, "answered": self.answered, "lost": self.lost(),
            "min_s": min, "mean_s": mean, "p50_s": p50, "p99_s": p99, "max_s": max,
            "there": self.there.json(), "back": self.back.json(),
        });
        object.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_rounds_are_exact_except_quantiles() {
        let ms = Duration::from_millis;
        let mut rounds = PingRounds { sent: 101, ..PingRounds::default() };
        assert!(rounds.times().is_none());
        (1..=100).for_each(|took| rounds.answered(ms(took), None));
        let [min, mean, p50, p99, max] = rounds.times().unwrap();
        assert_eq!((min, mean, max, rounds.lost()), (ms(1), Duration::from_micros(50_500), ms(100), 1));
        assert!((ms(38)..ms(63)).contains(&p50) && (ms(75)..=ms(100)).contains(&p99), "{p50:?} {p99:?}");
        let mut one = PingRounds { sent: 1, ..PingRounds::default() };
        one.answered(ms(3), None);
        assert_eq!(one.times(), Some([ms(3); 5]));
    }
}
