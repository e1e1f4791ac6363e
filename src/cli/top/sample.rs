//! One look at a node, and at those others that showed themselves: it waits for nobody.

use super::super::Failure;
use super::super::sight::Silence;
use super::super::summary::module_lines;
use super::super::target::Running;
use super::model::{Sample, TimeNow};
use rohrpost::Name;
use rohrpost::launch::ChildState;
use rohrpost::mailbox::SystemClock;
use rohrpost::survey::{Scope, Survey};
use std::collections::HashMap;

/// What launches said of their modules, by name.
pub(super) type Children = HashMap<Name, ChildState>;

/// What each of some nodes shows, or why it does not.
pub(super) type Seen = Vec<Result<Survey, Silence>>;

/// Looks at the own node, if it is meant.
pub(super) fn own(running: &Running) -> Result<Seen, Failure> {
    let is_own = |node: &&str| *node == running.node_name;
    let own: Vec<&str> = running.shown().into_iter().filter(is_own).collect();
    running.look_at(&own, Scope::All)
}

/// Puts together what nodes show; `earlier` makes rates. Where a module does not run, launch may have said why.
pub(super) fn put_together(running: &Running, seen: Seen, earlier: Option<&Sample>, children: &Children) -> Sample {
    let (mut surveys, mut silent) = (Vec::new(), Vec::new());
    for seen in seen {
        match seen {
            Ok(survey) => surveys.push(survey),
            Err(silence) => silent.push(silence),
        }
    }
    let names: Vec<&str> = silent.iter().map(|silence| silence.node.as_str()).collect();
    let survey = Survey::joined(surveys, &names, &running.installation);
    // What runs says more of itself than launch knew when it was asked.
    let absent = |name| survey.module(name).is_some_and(|module| module.process.is_none());
    let lines = module_lines(&running.installation, &survey, earlier.map(|sample| &sample.survey), |name| {
        let child = children.get(&name).filter(|_| absent(name));
        child.map_or((0, None), |child| (child.restarts, Some(child.phase)))
    });
    let clock = SystemClock::open(&running.node);
    let record = clock.record();
    let time = TimeNow {
        time_ns: clock.now().ns,
        time_source: record.map_or("local", |record| record.source.name()),
        time_pace: record.map_or(1.0, |record| record.pace_ppb as f64 / 1e9),
    };
    let launched = running.node.launcher().is_some();
    Sample { survey, silent, lines, time, launched }
}

/// What a launch said, by the names of its modules.
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
