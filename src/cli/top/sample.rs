//! One look at a node: shared memory and /proc. It asks nobody and waits for nobody.

use super::super::Failure;
use super::super::summary::module_lines;
use super::super::target::Running;
use super::model::{Sample, TimeNow};
use super::process::Usage;
use rohrpost::mailbox::{SystemClock, monotonic_ns};
use rohrpost::survey::Survey;

/// Looks at a node; `earlier` makes rates.
pub(super) fn take(running: &Running, earlier: Option<&Sample>) -> Result<Sample, Failure> {
    let survey = Survey::new(&running.node, &running.installation, &running.node_name)?;
    let lines = module_lines(&running.installation, &survey, earlier.map(|sample| &sample.survey), |_| (0, None));
    let pids = lines.iter().filter_map(|line| line.pid);
    let usage = pids.filter_map(|pid| Some((pid, Usage::of(pid)?))).collect();
    let clock = SystemClock::open(&running.node);
    let record = clock.record();
    let time = TimeNow {
        time_ns: clock.now().ns,
        time_source: record.map_or("local", |record| record.source.name()),
        time_pace: record.map_or(1.0, |record| record.pace_ppb as f64 / 1e9),
    };
    let launched = running.node.launcher().is_some();
    Ok(Sample { survey, lines, usage, time, at_ns: monotonic_ns(), launched })
}
