//! `rohrpost hz`: how often a module publishes, read from its own counters.

use crate::look::published::{WatchedModule, data_of};
use crate::look::target::Target;
use crate::measure::watch::{FlowFigures, Pace};
use crate::terminal::units::{fine, short};
use crate::terminal::{Failure, say, say_folded};
use rohrpost::output::plain;
use serde_json::json;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost hz odometry.0              all its data, one line a second each; Ctrl-C ends it
  rohrpost hz laser.0 scan --seconds 5
  rohrpost hz laser.0 scan --window 60 --json
The tool reads the module's counters in shared memory, on another node through that node's launch: it does not \
subscribe, and sends nothing to the module. Rate and standard \
deviation are exact; minimum and maximum are those of the whole seconds that overlap the window.")]
pub(crate) struct Arguments {
    /// Module or alias, such as odometry.0.
    name: String,
    /// Data; without it, all that the module publishes.
    data: Option<String>,
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    pace: Pace,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let mut watched = WatchedModule::new(&arguments.target, &arguments.name, arguments.pace.window()?)?;
    let wanted = arguments.data.as_deref();
    let mut data = data_of(&watched.running, watched.module, wanted)?;
    let look = |watched: &mut WatchedModule| {
        if let Some(survey) = watched.look()? {
            watched.take_published(survey);
        }
        Ok(())
    };
    let tell = |watched: &mut WatchedModule| {
        watched.renew(&mut data, wanted);
        if data.iter().all(|(number, _)| watched.figures(*number).is_none_or(|figures| figures.packages == 0)) {
            watched.running.in_error(watched.module).map_or(Ok(()), Err)?;
        }
        let wide = data.iter().map(|(_, name)| plain::line(name).len()).max().unwrap_or(0);
        for (number, name) in &data {
            let figures = watched.figures(*number);
            let is_read = if arguments.pace.json {
                say(in_json(&watched.name(), name, figures))
            } else {
                say_folded(in_text(&plain::line(name), wide, figures))
            };
            if !is_read {
                return Ok(false);
            }
        }
        Ok(true)
    };
    arguments.pace.watch(&mut watched, look, tell)?;
    Ok(ExitCode::SUCCESS)
}

fn in_text(name: &str, wide: usize, figures: Option<FlowFigures>) -> String {
    let Some(figures) = figures else {
        return format!("{name:wide$}  never published; `rohrpost status` tells whether the module is on");
    };
    let ago = short(figures.since_last_s);
    let (Some(rate_hz), Some(mean_s), Some(std_s)) = (figures.rate_hz, figures.interval_mean_s, figures.interval_std_s)
    else {
        return match figures.packages {
            0 => format!("{name:wide$}  nothing new in this window; the last value was sent {ago} ago"),
            _ => format!("{name:wide$}  one value so far, {ago} ago"),
        };
    };
    let (min, max) = figures.interval_s.map_or(("-".into(), "-".into()), |(min, max)| (fine(min), fine(max)));
    let silent = if figures.silent_s.is_some() { format!("  silent for {ago}") } else { String::new() };
    format!(
        "{name:wide$}  {rate_hz:9.3} Hz  mean {:>9}  min {min:>9}  max {max:>9}  std {:>9}  {} values{silent}",
        fine(mean_s),
        fine(std_s),
        figures.packages
    )
}

fn in_json(module: &str, name: &str, figures: Option<FlowFigures>) -> String {
    let figures = figures.unwrap_or_default();
    let object = json!({
        "module": module,
        "data": name,
        "values": figures.packages,
        "values_per_s": figures.rate_hz,
        "interval_mean_s": figures.interval_mean_s,
        "interval_min_s": figures.interval_s.map(|interval| interval.0),
        "interval_max_s": figures.interval_s.map(|interval| interval.1),
        "interval_std_s": figures.interval_std_s,
        "silent_s": figures.silent_s,
        "from_ns": figures.from_ns,
        "last_ns": figures.last_ns,
    });
    object.to_string()
}
