//! One look at a node: shared memory and /proc. It asks nobody and waits for nobody.

use super::super::Failure;
use super::super::summary::module_lines;
use super::super::target::Running;
use super::model::{Sample, TimeNow};
use super::process::Usage;
use rohrpost::Name;
use rohrpost::launch::ChildState;
use rohrpost::mailbox::{SystemClock, monotonic_ns};
use rohrpost::survey::Survey;
use std::collections::HashMap;

/// What launch said of its modules, by name.
pub(super) type Children = HashMap<Name, ChildState>;

/// Looks at a node; `earlier` makes rates. Where a module does not run, launch may have said why.
pub(super) fn take(running: &Running, earlier: Option<&Sample>, children: &Children) -> Result<Sample, Failure> {
    let survey = Survey::new(&running.node, &running.installation, &running.node_name)?;
    // What runs says more of itself than launch knew when it was asked.
    let absent = |name| survey.module(name).is_some_and(|module| module.process.is_none());
    let lines = module_lines(&running.installation, &survey, earlier.map(|sample| &sample.survey), |name| {
        let child = children.get(&name).filter(|_| absent(name));
        child.map_or((0, None), |child| (child.restarts, Some(child.phase)))
    });
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

/// What launch said, by the names of its modules.
pub(super) fn by_name(running: &Running, children: Vec<ChildState>) -> Children {
    let name = |child: &ChildState| running.module(&child.module).ok();
    children.into_iter().filter_map(|child| Some((name(&child)?, child))).collect()
}

/// Why modules are in error, as they said themselves, and why others do not run, as launch said. What modules said is
/// forgotten once it is over.
pub(super) fn why(now: &Sample, said: &mut HashMap<Name, String>, children: &Children) -> HashMap<Name, String> {
    said.retain(|name, _| now.in_error(*name));
    let ended = now.absent().filter_map(|name| Some((name, children.get(&name)?.last_end.replace('\n', "; "))));
    said.clone().into_iter().chain(ended.filter(|(_, how)| !how.is_empty())).collect()
}
