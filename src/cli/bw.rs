//! `rohrpost bw`: how many bytes go in and out of a module, read from the counters of those who send.

use super::hz::{data_of, published};
use super::target::Target;
use super::watch::{Figures, Pace, Tracks};
use super::{Failure, say};
use rohrpost::mailbox::{FlowInfo, Type};
use serde_json::json;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost bw mapper.0                what goes in and out, two lines a second; Ctrl-C ends it
  rohrpost bw laser.0 scan            the values that it publishes, each counted once whoever subscribes
  rohrpost bw mapper.0 --seconds 5 --json
Bytes are those of bodies: a package has 16 bytes of head besides. It reads counters in shared memory: nothing is \
subscribed to, nothing is sent. Smallest and largest are those of the whole seconds that the window touches.")]
pub(super) struct Arguments {
    /// Module or face, such as mapper.0.
    name: String,
    /// Data; without it, all packages in and out.
    data: Option<String>,
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    pace: Pace,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let module = running.present(&arguments.name)?;
    let data = arguments.data.as_deref().map(|name| data_of(&running, module, Some(name))).transpose()?;
    let mut tracks = Tracks::new(arguments.pace.window()?);
    let wanted = |flow: &FlowInfo| match &data {
        Some(data) => data.iter().any(|(number, _)| flow.kind == Type::data(*number)),
        None => !flow.is_publication() && [flow.from, flow.to].iter().any(|name| name.module() == module),
    };
    let look = |tracks: &mut Tracks| {
        match &data {
            Some(_) => tracks.look(published(&running, module).filter(|flow| wanted(flow))),
            None => tracks.look(running.node.traffic().into_iter().filter(|flow| wanted(flow))),
        }
        Ok(())
    };
    let tell = |tracks: &mut Tracks| {
        let sum_of = |which: &dyn Fn(&FlowInfo) -> bool| sum(tracks.figures().filter(|(flow, _)| which(flow)));
        let lines = match &data {
            Some(data) => data.iter().map(|(_, name)| (name.as_str(), sum_of(&|_| true))).collect(),
            None => vec![
                ("in", sum_of(&|flow| flow.to.module() == module)),
                ("out", sum_of(&|flow| flow.from.module() == module)),
            ],
        };
        let wide = lines.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        let line = |(name, sum): &(&str, Sum)| if arguments.pace.json { sum.json(name) } else { sum.text(name, wide) };
        Ok(lines.iter().all(|each| say(line(each))))
    };
    arguments.pace.watch(&mut tracks, look, tell)?;
    Ok(ExitCode::SUCCESS)
}

/// Several flows together.
#[derive(Default)]
struct Sum {
    packages: u64,
    bytes: u64,
    refused: u64,
    packages_per_s: f64,
    bytes_per_s: f64,
    bytes_min_max: Option<(u32, u32)>,
}

/// Each flow's rate is exact, by its own first and last package, and so is their sum.
fn sum<'a>(flows: impl Iterator<Item = (&'a FlowInfo, Figures)>) -> Sum {
    let mut sum = Sum::default();
    for (_, figures) in flows {
        sum.packages += figures.packages;
        sum.bytes += figures.bytes;
        sum.refused += figures.refused;
        sum.packages_per_s += figures.rate_hz.unwrap_or(0.0);
        sum.bytes_per_s += figures.bytes_per_s().unwrap_or(0.0);
        let both = sum.bytes_min_max.zip(figures.bytes_min_max).map(|(a, b)| (a.0.min(b.0), a.1.max(b.1)));
        sum.bytes_min_max = both.or(sum.bytes_min_max).or(figures.bytes_min_max);
    }
    sum
}

impl Sum {
    fn mean(&self) -> Option<f64> {
        (self.packages > 0).then(|| self.bytes as f64 / self.packages as f64)
    }

    fn text(&self, name: &str, wide: usize) -> String {
        let refused = if self.refused > 0 { format!("  {} refused", self.refused) } else { String::new() };
        let (Some(mean), Some((min, max))) = (self.mean(), self.bytes_min_max) else {
            return format!("{name:wide$}  nothing in this window{refused}");
        };
        format!(
            "{name:wide$}  {:>10}/s  {:9.3} packages/s  mean {mean:.0} B  min {min} B  max {max} B{refused}",
            bytes(self.bytes_per_s),
            self.packages_per_s
        )
    }

    fn json(&self, name: &str) -> String {
        let object = json!({
            "of": name,
            "packages": self.packages,
            "bytes": self.bytes,
            "refused": self.refused,
            "packages_per_s": self.packages_per_s,
            "bytes_per_s": self.bytes_per_s,
            "bytes_mean": self.mean(),
            "bytes_min": self.bytes_min_max.map(|found| found.0),
            "bytes_max": self.bytes_min_max.map(|found| found.1),
        });
        object.to_string()
    }
}

/// In the unit that suits it: powers of 1000, as rates are given.
pub(super) fn bytes(bytes: f64) -> String {
    match bytes {
        b if b < 999.5 => format!("{b:.0} B"),
        b if b < 999_500.0 => format!("{:.2} kB", b / 1e3),
        b => format!("{:.2} MB", b / 1e6),
    }
}
