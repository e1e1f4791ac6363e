//! `rohrpost top`: the modules of all nodes, live (seed 002, 5.3: the module monitor).
//!
//! ```text
//! shared memory, /proc ─────┬─sample──▶ Sample ─┐
//! launches of other nodes ──┘           Sample ─┴─▶ Model ──┐
//! keys ──▶ App ──▶ ScreenAction ──▶ Calls ──answers──▶ Live ──────┴──▶ ScreenModel ──▶ screen
//! ```
//!
//! `Model`, `app`, `columns` and `draw` are pure; `Sample`, `calls` and `live` do the input and output.

mod app;
mod calls;
mod columns;
mod details;
mod draw;
mod live;
mod map;
mod model;
mod output;
#[cfg(test)]
mod tests;
mod text;

use crate::look::observer::PATIENCE;
use crate::look::target::{Running, Target};
use crate::terminal::{Failure, say};
use model::{ErrorCauses, Model};
use rohrpost::Name;
use rohrpost_launch::survey::Scope;
use std::io::IsTerminal;
use std::process::ExitCode;
use std::time::Duration;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost top                  ? shows the keys, q ends it
  rohrpost top --map            the map: walls seen, the way, the scan; `m` there and back
  rohrpost top --once           one plain table
  rohrpost top --json           one object with everything, for programs
Counters are read from shared memory, on other nodes through their launches: this disturbs nobody.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    target: Target,
    /// Refresh period, seconds; rates are those of this time.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    interval: f64,
    /// Begin with the map of a robot that writes streams of scans and odometry.
    #[arg(long, conflicts_with_all = ["once", "json"])]
    map: bool,
    /// Print the table once, after one interval.
    #[arg(long, conflicts_with = "json")]
    once: bool,
    /// Print one JSON object, after one interval.
    #[arg(long)]
    json: bool,
    /// No colours; NO_COLOR in the environment says the same.
    #[arg(long)]
    no_color: bool,
}

/// Shorter periods count too few packages for a rate; longer ones show nothing.
const INTERVAL_S: std::ops::RangeInclusive<f64> = 0.1..=3600.0;

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    if !INTERVAL_S.contains(&arguments.interval) {
        return Err(format!("an interval of {} s; it takes 0.1 to 3600", arguments.interval).into());
    }
    let interval = Duration::from_secs_f64(arguments.interval);
    let running = arguments.target.find()?;
    if !arguments.once && !arguments.json {
        if !std::io::stdout().is_terminal() || !std::io::stdin().is_terminal() {
            return Err("`top` draws on a terminal; for a file or pipe, use `top --once` or `top --json`".into());
        }
        let first = if arguments.map { app::Screen::Map } else { app::Screen::Table };
        return live::run(running, interval, draw::Palette::new(arguments.no_color), first);
    }
    let model = once(&running, interval)?;
    say(if arguments.json { serde_json::to_string(&model)? } else { text::table(&model) });
    Ok(ExitCode::SUCCESS)
}

/// The state after one period. A module in error is asked for the cause if no launch knows it.
fn once(running: &Running, interval: Duration) -> Result<Model, Failure> {
    let look = || running.look_at(&running.shown(), Scope::All);
    let earlier = model::put_together(running, look()?, None, &ErrorCauses::default());
    std::thread::sleep(interval);
    let seen = look()?;
    let mut now = model::put_together(running, seen.clone(), Some(&earlier), &ErrorCauses::default());
    let unexplained: Vec<Name> = now.unexplained().collect();
    if !unexplained.is_empty()
        && let Ok(mut tool) = running.join(PATIENCE)
    {
        let status = |name| Some((name, tool.status(name).ok()?.error));
        let said = unexplained.into_iter().filter_map(status).collect();
        now = model::put_together(running, seen, Some(&earlier), &said);
    }
    let mut model = Model::new(&running.installation, &running.node_name, &running.shown(), &now, Some(&earlier));
    crate::measure::stream::name_items(running, &mut model.streams);
    Ok(model)
}
