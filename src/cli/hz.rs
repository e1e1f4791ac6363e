//! `rohrpost hz`: how often a module publishes, read from its own counters.

use super::table::time;
use super::target::{Running, Target};
use super::watch::{Figures, Pace, Tracks};
use super::{Failure, say};
use rohrpost::Name;
use rohrpost::mailbox::{FlowInfo, Type};
use serde_json::json;
use std::process::ExitCode;
use std::time::Duration;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost hz odometry.0              all its data, a line each a second; Ctrl-C ends it
  rohrpost hz laser.0 scan --seconds 5
  rohrpost hz laser.0 scan --window 60 --json
It reads what the module counts in shared memory: nothing is subscribed to, nothing is sent. Rate and standard \
deviation are exact; minimum and maximum are those of the whole seconds that the window touches.")]
pub(super) struct Arguments {
    /// Module or face, such as odometry.0.
    name: String,
    /// Data; without it, all that the module publishes.
    data: Option<String>,
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    pace: Pace,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let module = running.module(&arguments.name)?;
    let data = data_of(&running, module, arguments.data.as_deref())?;
    let mut tracks = Tracks::new(arguments.pace.window()?);
    let look = |tracks: &mut Tracks| {
        tracks.look(published(&running, module));
        Ok(())
    };
    let wide = data.iter().map(|(_, name)| name.len()).max().unwrap_or(0);
    let tell = |tracks: &mut Tracks| {
        for (number, name) in &data {
            let figures = tracks.figures().find(|(flow, _)| flow.kind == Type::data(*number)).map(|(_, found)| found);
            let line = if arguments.pace.json { in_json(name, figures) } else { in_text(name, wide, figures) };
            if !say(line) {
                return Ok(false);
            }
        }
        Ok(true)
    };
    arguments.pace.watch(&mut tracks, look, tell)?;
    Ok(ExitCode::SUCCESS)
}

/// Numbers and names of the data that are meant.
pub(super) fn data_of(running: &Running, module: Name, name: Option<&str>) -> Result<Vec<(u16, String)>, Failure> {
    let text = running.text(module);
    let description = running.noted(module)?;
    let known: Vec<(u16, String)> = description.data.into_iter().map(|item| (item.number, item.name)).collect();
    let names = || known.iter().map(|(_, name)| name.as_str()).collect::<Vec<_>>().join(", ");
    match name {
        _ if known.is_empty() => {
            let faces = running.installation.module(module).map(|found| &found.faces[..]).unwrap_or_default();
            let faces: Vec<String> = faces.iter().map(|face| running.text(*face)).collect();
            let faces = if faces.is_empty() { String::new() } else { format!("; its faces may: {}", faces.join(", ")) };
            Err(format!("{text} publishes no data{faces}").into())
        }
        None => Ok(known),
        Some(name) => match known.iter().find(|(_, known)| known == name) {
            Some(one) => Ok(vec![one.clone()]),
            None => Err(format!("{text} has no data `{name}`; it has: {}", names()).into()),
        },
    }
}

/// What is published under this name.
pub(super) fn published(running: &Running, module: Name) -> impl Iterator<Item = FlowInfo> {
    running.node.traffic().into_iter().filter(move |flow| flow.is_publication() && flow.from.module() == module)
}

pub(super) fn short(seconds: f64) -> String {
    time(Duration::try_from_secs_f64(seconds).unwrap_or_default())
}

/// Four digits or more: jitter is small beside the interval.
fn fine(seconds: f64) -> String {
    let us = seconds * 1e6;
    match us {
        us if us < 9_999.5 => format!("{us:.1} µs"),
        us if us < 9_999_500.0 => format!("{:.2} ms", us / 1e3),
        us => format!("{:.2} s", us / 1e6),
    }
}

fn in_text(name: &str, wide: usize, figures: Option<Figures>) -> String {
    let Some(figures) = figures else {
        return format!("{name:wide$}  never published; `rohrpost status` tells whether the module is on");
    };
    let (Some(rate_hz), Some(std_s)) = (figures.rate_hz, figures.interval_std_s) else {
        return format!("{name:wide$}  nothing new in this window; the last came {} ago", short(figures.silent_s()));
    };
    let (min, max) = figures.interval_s.map_or(("-".into(), "-".into()), |(min, max)| (fine(min), fine(max)));
    format!(
        "{name:wide$}  {rate_hz:9.3} Hz  mean {:>9}  min {min:>9}  max {max:>9}  std {:>9}  {} values",
        fine(1.0 / rate_hz),
        fine(std_s),
        figures.packages
    )
}

fn in_json(name: &str, figures: Option<Figures>) -> String {
    let figures = figures.unwrap_or_default();
    let object = json!({
        "data": name,
        "values": figures.packages,
        "rate_hz": figures.rate_hz,
        "interval_mean_s": figures.rate_hz.map(|rate_hz| 1.0 / rate_hz),
        "interval_min_s": figures.interval_s.map(|interval| interval.0),
        "interval_max_s": figures.interval_s.map(|interval| interval.1),
        "interval_std_s": figures.interval_std_s,
        "from_ns": figures.from_ns,
        "last_ns": figures.last_ns,
    });
    object.to_string()
}
