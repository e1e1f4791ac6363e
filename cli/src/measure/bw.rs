//! `rohrpost bw`: bytes per second into and out of a module, read from the senders' counters.

use crate::look::published::{WatchedModule, data_of};
use crate::look::target::Target;
use crate::measure::watch::{FlowFigures, Pace};
use crate::terminal::units::{bytes, short};
use crate::terminal::{Failure, say, say_folded};
use rohrpost_launch::survey::is_hop;
use rohrpost_mailbox::{FlowInfo, Type};
use serde_json::json;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost bw mapper.0                input and output, two lines a second; Ctrl-C ends it
  rohrpost bw laser.0 scan            the values that it publishes, each counted once, however many subscribe
  rohrpost bw mapper.0 --seconds 5 --json
Bytes are those of package bodies, without the 16 bytes of each head. The tool reads counters in shared memory, on \
    another node through that node's launch: it does not subscribe, and sends nothing to the module. Smallest and \
    largest are those of the whole seconds that overlap the window.")]
pub(crate) struct Arguments {
    /// Module or alias, such as mapper.0.
    name: String,
    /// Data; without it, all packages in and out.
    data: Option<String>,
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    pace: Pace,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let mut watched = WatchedModule::new(&arguments.target, &arguments.name, arguments.pace.window()?)?;
    watched.require_present()?;
    let wanted = arguments.data.as_deref();
    let mut data = match wanted {
        Some(_) => data_of(&watched.running, watched.module, wanted)?,
        None => Vec::new(),
    };
    let look = |watched: &mut WatchedModule| {
        let Some(survey) = watched.look()? else { return Ok(()) };
        if wanted.is_some() {
            watched.take_published(survey);
            return Ok(());
        }
        let module = watched.module;
        let flows = survey.flows.into_iter().filter(|flow| !flow.is_publication());
        // All input is counted on the module's node: packages from another node are counted by the router that delivers
        // them.
        let (installation, node) = (&watched.running.installation, survey.node.as_str());
        let counts = |flow: &FlowInfo| {
            flow.to.module() == module || flow.from.module() == module && !is_hop(installation, node, flow)
        };
        watched.tracks.look(survey.at_ns, flows.filter(counts));
        Ok(())
    };
    let tell = |watched: &mut WatchedModule| {
        let module = watched.name();
        let sum_of = |which: &dyn Fn(&FlowInfo) -> bool| sum(watched.tracks.figures().filter(|(flow, _)| which(flow)));
        if wanted.is_none() {
            let to = sum_of(&|flow| flow.to.module() == watched.module);
            let from = sum_of(&|flow| flow.from.module() == watched.module);
            return Ok(
                tell_one(arguments, &module, "in", "in", &to) && tell_one(arguments, &module, "out", "out", &from)
            );
        }
        let sums: Vec<FlowSum> =
            data.iter().map(|(number, _)| sum_of(&|flow| flow.kind == Type::data(*number))).collect();
        if sums.iter().all(|sum| sum.packages == 0) {
            watched.running.in_error(watched.module).map_or(Ok(()), Err)?;
        }
        let told = data.iter().zip(&sums).all(|((_, name), sum)| tell_one(arguments, &module, name, "published", sum));
        watched.renew(&mut data, wanted);
        Ok(told)
    };
    arguments.pace.watch(&mut watched, look, tell)?;
    Ok(ExitCode::SUCCESS)
}

/// Prints one line; false when nobody reads any more.
fn tell_one(arguments: &Arguments, module: &str, name: &str, direction: &str, sum: &FlowSum) -> bool {
    if !arguments.pace.json {
        return say_folded(sum.text(name));
    }
    say(json!({
        "module": module,
        "data": arguments.data,
        "direction": direction,
        "packages": sum.packages,
        "packages_per_s": sum.packages_per_s,
        "bytes": sum.bytes,
        "bytes_per_s": sum.bytes_per_s,
        "bytes_mean": sum.mean(),
        "bytes_min": sum.bytes_min_max.map(|found| found.0),
        "bytes_max": sum.bytes_min_max.map(|found| found.1),
        "refused": sum.refused,
        "silent_s": sum.silent_s(),
    }))
}

/// Totals of several flows.
#[derive(Default)]
struct FlowSum {
    packages: u64,
    bytes: u64,
    refused: u64,
    packages_per_s: f64,
    bytes_per_s: f64,
    bytes_min_max: Option<(u32, u32)>,
    /// Time since the last package, and whether all flows are silent.
    since_last_s: Option<f64>,
    lively: bool,
}

/// Each flow's rate comes from its own first and last package; the total is their sum.
fn sum<'a>(flows: impl Iterator<Item = (&'a FlowInfo, FlowFigures)>) -> FlowSum {
    let mut sum = FlowSum::default();
    for (_, figures) in flows {
        sum.packages += figures.packages;
        sum.bytes += figures.bytes;
        sum.refused += figures.refused;
        sum.packages_per_s += figures.rate_hz.unwrap_or(0.0);
        sum.bytes_per_s += figures.bytes_per_s().unwrap_or(0.0);
        let both = sum.bytes_min_max.zip(figures.bytes_min_max).map(|(a, b)| (a.0.min(b.0), a.1.max(b.1)));
        sum.since_last_s = Some(sum.since_last_s.unwrap_or(f64::MAX).min(figures.since_last_s));
        sum.lively |= figures.silent_s.is_none();
        sum.bytes_min_max = both.or(sum.bytes_min_max).or(figures.bytes_min_max);
    }
    sum
}

impl FlowSum {
    fn mean(&self) -> Option<f64> {
        (self.packages > 0).then(|| self.bytes as f64 / self.packages as f64)
    }

    fn silent_s(&self) -> Option<f64> {
        self.since_last_s.filter(|_| !self.lively)
    }

    fn text(&self, name: &str) -> String {
        let refused = if self.refused > 0 { format!("  {} refused", self.refused) } else { String::new() };
        let silent = self.silent_s().map_or(String::new(), |silent_s| format!("  silent for {}", short(silent_s)));
        let (Some(mean), Some((min, max))) = (self.mean(), self.bytes_min_max) else {
            return format!("{name:3}  nothing in this window{refused}");
        };
        format!(
            "{name:3}  {:>10}/s  {:9.3} packages/s  mean {mean:.0} B  min {min} B  max {max} B{refused}{silent}",
            bytes(self.bytes_per_s),
            self.packages_per_s
        )
    }
}
