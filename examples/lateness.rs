//! How late the functions of a module run: the one of its period, and the one for data. It writes a report at the end.
//! `clients/python/measure/lateness.py` is the same in Python, and launches both.

use rohrpost::{Context, Module, ModuleError, Rate, Received, Subscription};
use std::path::PathBuf;
use std::time::{Duration, Instant};

const PERIOD: Duration = Duration::from_millis(10);
/// So many data are counted, after so many others: a start is slower.
const BEATS: usize = 1000;
const FIRST: usize = 200;

/// Runs by time, and says how late.
#[rohrpost::interface(class = "timing")]
pub trait Timing {
    /// When it was published, system time, ns.
    #[data(1)]
    fn beat() -> u64;
}

#[derive(rohrpost::serde::Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields)]
struct Settings {
    follows: Option<String>,
    report: Option<PathBuf>,
}

struct Timer {
    beats: Option<Subscription<u64>>,
    report: Option<PathBuf>,
    began: Instant,
    ticks_us: Vec<f64>,
    heard_us: Vec<f64>,
}

/// By how much the times between them differ from the period.
fn off(ticks_us: &[f64]) -> Vec<f64> {
    ticks_us.windows(2).map(|pair| (pair[1] - pair[0] - PERIOD.as_secs_f64() * 1e6).abs()).collect()
}

/// The middle, 99 of 100, and the worst.
fn figures(values: &mut [f64]) -> String {
    values.sort_by(f64::total_cmp);
    let at = |of_100: usize| values[(values.len() - 1) * of_100 / 100];
    format!("{:.0} {:.0} {:.0}", at(50), at(99), at(100))
}

impl Module for Timer {
    type Settings = Settings;
    type Interfaces = TimingInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(PERIOD);
        let follow = |publisher: String| context.subscribe(TimingInterface::BEAT, publisher.as_str(), Rate::Each);
        let beats = settings.follows.map(follow).transpose()?;
        let (ticks_us, heard_us) = (Vec::new(), Vec::new());
        Ok(Self { beats, report: settings.report, began: Instant::now(), ticks_us, heard_us })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.ticks_us.push(self.began.elapsed().as_secs_f64() * 1e6);
        Ok(context.publish_now(TimingInterface::BEAT, &context.now().ns)?)
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some(beats) = &self.beats else { return Ok(()) };
        if let Some(published_ns) = data.read(beats)? {
            self.heard_us.push(context.now().ns.saturating_sub(published_ns) as f64 / 1e3);
        }
        if let Some(report) = self.report.take_if(|_| self.heard_us.len() == FIRST + BEATS) {
            let period = figures(&mut off(&self.ticks_us[FIRST..]));
            std::fs::write(report, format!("{period} {}", figures(&mut self.heard_us[FIRST..])))?;
        }
        Ok(())
    }
}

impl Timing for Timer {}

fn main() -> std::process::ExitCode {
    rohrpost::run::<Timer>()
}
