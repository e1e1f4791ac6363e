//! One observation of the own node, and of other nodes from their last reports; it never blocks.

use super::model::{Sample, TimeNow};
use crate::look::observer::Silence;
use crate::look::summary::module_lines;
use crate::look::target::Running;
use crate::terminal::Failure;
use rohrpost::Name;
use rohrpost_launch::survey::{Scope, Standing, Survey};
use rohrpost_mailbox::{SystemClock, monotonic_ns, realtime_ns};
use std::collections::HashMap;

/// Why modules are in error, as they reported.
pub(super) type ErrorCauses = HashMap<Name, String>;

/// The reports of some nodes, or why they do not answer.
pub(super) type NodeSurveys = Vec<Result<Survey, Silence>>;

/// Observes the own node, if it is selected.
pub(super) fn own(running: &Running) -> Result<NodeSurveys, Failure> {
    let is_own = |node: &&str| *node == running.node_name;
    let own: Vec<&str> = running.shown().into_iter().filter(is_own).collect();
    running.look_at(&own, Scope::All)
}

/// Merges the nodes' reports; `earlier` is the base of rates.
pub(super) fn put_together(
    running: &Running,
    seen: NodeSurveys,
    earlier: Option<&Sample>,
    said: &ErrorCauses,
) -> Sample {
    let (mut surveys, mut silent) = (Vec::new(), Vec::new());
    for seen in seen {
        match seen {
            Ok(survey) => surveys.push(survey),
            Err(silence) => silent.push(silence),
        }
    }
    let names: Vec<&str> = silent.iter().map(|silence| silence.node.as_str()).collect();
    let mut survey = Survey::joined(surveys, &names, &running.installation);
    for module in survey.modules.iter_mut().filter(|module| module.standing() == Standing::Error) {
        if let Some(error) = said.get(&module.name) {
            module.error = Some(error.clone());
        }
    }
    let lines = module_lines(&running.installation, &survey, earlier.map(|sample| &sample.survey));
    let clock = SystemClock::open(&running.node);
    let record = clock.record();
    let time = TimeNow {
        time_ns: clock.now().ns,
        time_source: record.map_or("local", |record| record.source.name()),
        time_pace: record.map_or(1.0, |record| record.pace_ppb as f64 / 1e9),
        time_known: record.is_none_or(|record| record.is_known()),
        clock_set_by_ns: record.and_then(|record| record.clock_set_by(monotonic_ns(), realtime_ns())),
    };
    let launched = running.node.launcher().is_some();
    Sample { survey, silent, lines, time, launched }
}
