//! How fast the programs of a recorded demo are run again, and how exactly a replay keeps the distances between values.

use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Child, Failure, OrFail, Scratch};
use rohrpost_bench_local::rounds::{Contender, at_least, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use std::cell::OnceCell;
use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Seconds of a demo that are recorded.
const DEMO_S: u32 = 20;
const QUICK_DEMO_S: u32 = 3;
/// Seconds of it that are replayed at their speed in a turn.
const PLAYED_S: u32 = 5;
const QUICK_PLAYED_S: u32 = 1;
const PATIENCE: Duration = Duration::from_secs(180);
const FILE: &str = "demo.mcap";
/// The largest error of 99 in 100 distances, microseconds.
const SPACING_US: f64 = 1000.0;

/// The programs of all modules of a recorded demo are run again, one after the other, and compared.
pub(super) fn exact() -> Case {
    Case::new("exact replay of the demo", None, "s/s", |settings, subject| {
        let demo = DemoOnce::new(settings);
        let ours = Contender::single("rohrpost", || demo.get()?.speed());
        let real_time = Contender::fixed("real time", Summary::single(1.0)).beside(at_least(20.0), None);
        Ok(compare(settings, subject, &[ours, real_time]))
    })
}

/// The recording of a demo is played at its speed.
pub(super) fn spacing() -> Case {
    Case::new("replay, error of spacing", None, "us", |settings, subject| {
        let demo = DemoOnce::new(settings);
        let demo = &demo;
        let error_of = |line| move || demo.get()?.spacing(settings, line);
        let bound = Summary { p99: Some(SPACING_US), ..Summary::single(SPACING_US) };
        let contenders = [
            Contender::new("rohrpost", error_of("error of spacing at rate 1: ")),
            Contender::fixed("1 ms", bound).beside(None, at_most(1.0)),
            // What of its errors is left without the time for which others had the player's processor.
            Contender::new("without waits", error_of("without waits for a processor: ")),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

/// Made for the first round that needs it, the same for all.
struct DemoOnce<'a> {
    settings: &'a Settings,
    made: OnceCell<Result<DemoRecording, Failure>>,
}

impl<'a> DemoOnce<'a> {
    fn new(settings: &'a Settings) -> Self {
        Self { settings, made: OnceCell::new() }
    }

    fn get(&self) -> Result<&DemoRecording, Failure> {
        self.made.get_or_init(|| DemoRecording::make(self.settings)).as_ref().map_err(Failure::clone)
    }
}

/// A recording of the demo, with journals of its modules; and the command that made it.
struct DemoRecording {
    rohrpost: PathBuf,
    scratch: Scratch,
}

impl DemoRecording {
    fn make(settings: &Settings) -> Result<Self, Failure> {
        let made = Self { rohrpost: settings.command()?, scratch: Scratch::new()? };
        fs::create_dir(made.nodes()).or_fail("a folder for nodes")?;
        let seconds = if settings.quick { QUICK_DEMO_S } else { DEMO_S }.to_string();
        made.run(&["demo", "--no-gui", "--quiet", "--seconds", &seconds, "--record", FILE])?;
        Ok(made)
    }

    fn nodes(&self) -> PathBuf {
        self.scratch.directory().join("nodes")
    }

    /// What the command says. It ends with this process.
    fn run(&self, arguments: &[&str]) -> Result<String, Failure> {
        let folder = self.scratch.directory();
        let [said, complained] = ["said", "complained"].map(|name| folder.join(name));
        let command = arguments.join(" ");
        let failed = |error| Failure::of(&command, error);
        let child = Child::start(|| {
            let (out, error) = (File::create(&said).or_fail(&command)?, File::create(&complained).or_fail(&command)?);
            let mut command = Command::new(&self.rohrpost);
            command.args(arguments).current_dir(&folder).env("ROHRPOST_DIR", self.nodes());
            Err(failed(command.stdin(Stdio::null()).stdout(out).stderr(error).exec()))
        })?;
        let ended = child.finish_program(Instant::now() + PATIENCE);
        let text = fs::read_to_string(&said).or_fail(&command)?;
        ended.map(|()| text).map_err(|failure| {
            let complaint = fs::read_to_string(&complained).unwrap_or_default();
            Failure::Failed(format!("rohrpost {command}: {failure}: {}", complaint.trim_end()))
        })
    }

    /// Seconds of the demo that all its programs run through in a second, one program after the other.
    fn speed(&self) -> Result<f64, Failure> {
        let began = Instant::now();
        let said = self.run(&["replay", "--exact", "--run-recorded", FILE, "--json"])?;
        let took = began.elapsed();
        let runs: Vec<serde_json::Value> =
            said.lines().map(serde_json::from_str).collect::<Result<_, _>>().or_fail("what exact replay says")?;
        if runs.is_empty() || runs.iter().any(|run| run["result"] != "identical") {
            return Err(Failure::Failed(format!("not identical: {said}")));
        }
        let times = |key: &str| runs.iter().filter_map(|run| run[key].as_u64()).collect::<Vec<u64>>();
        let (first_ns, last_ns) = (times("first_ns").into_iter().min(), times("last_ns").into_iter().max());
        let recorded_ns = last_ns.unwrap_or_default().saturating_sub(first_ns.unwrap_or_default());
        Ok(recorded_ns as f64 / 1e9 / took.as_secs_f64())
    }

    /// How far distances between values were off, microseconds: the line of the summary that begins so.
    fn spacing(&self, settings: &Settings, line: &str) -> Result<Summary, Failure> {
        let until = format!("+{}s", if settings.quick { QUICK_PLAYED_S } else { PLAYED_S });
        let said = self.run(&["replay", FILE, "--until", &until, "--no-gui", "--quiet"])?;
        let told = said.lines().find_map(|said| said.strip_prefix(line));
        let figures = told.map(|told| told.split(", ").map(microseconds).collect::<Vec<_>>());
        match figures.as_deref() {
            Some([Some(p50), Some(p99), Some(max)]) => {
                Ok(Summary { p99: Some(*p99), max: Some(*max), ..Summary::single(*p50) })
            }
            _ => Err(Failure::Failed(format!("no error of spacing: {said}"))),
        }
    }
}

/// Of `p99 151 µs`.
fn microseconds(text: &str) -> Option<f64> {
    let (_, figure) = text.split_once(' ')?;
    let (number, unit) = figure.split_once(' ')?;
    let each_us = match unit {
        "ns" => 1e-3,
        "µs" => 1.0,
        "ms" => 1e3,
        "s" => 1e6,
        _ => return None,
    };
    Some(number.parse::<f64>().ok()? * each_us)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_in_each_unit() {
        let read = ["p50 12 µs", "p99 1.5 ms", "max 2 s", "p50 800 ns", "p50 12 h", "p50"].map(microseconds);
        assert_eq!(read, [Some(12.0), Some(1500.0), Some(2e6), Some(0.8), None, None]);
    }
}
