//! What the summary says of time slots: how well they were kept, and each flow's worst case beside the worst that was seen.

use crate::cli::table::table;
use crate::cli::units::fine;
use rohrpost::config::{Installation, bounds};
use rohrpost::interfaces::{Links, SlotState};
use std::time::Duration;

/// How the nodes kept their slots.
pub(super) fn kept(slots: &[SlotState]) -> String {
    let rows = slots.iter().map(|slots| {
        let offs_ns = slots.last.iter().map(|used| used.off_ns.unsigned_abs());
        [
            slots.node.clone(),
            slots.used.to_string(),
            slots.empty.to_string(),
            slots.late.to_string(),
            slots.skipped.to_string(),
            slots.silent.to_string(),
            offs_ns.max().map_or("-".into(), |ns| fine(ns as f64 * 1e-9)),
            slots.synchronisations_heard.to_string(),
            slots.synchronisations_missed.to_string(),
            slots.replacements_sent.to_string(),
            slots.scheduled.clone(),
        ]
    });
    let heads = [
        "node",
        ">slots used",
        ">empty",
        ">late",
        ">skipped",
        ">silent",
        ">off of late",
        ">syncs heard",
        ">missed",
        ">replaced",
        "scheduled",
    ];
    let silent = slots.iter().filter(|slots| !slots.why_silent.is_empty());
    let silent = silent.map(|slots| format!("node {} is silent: {}\n", slots.node, slots.why_silent));
    table(heads, rows) + &silent.collect::<String>()
}

/// Each flow between nodes: how late it may be at most by what `check` reckons, and how old the oldest of its receiver's data was when it
/// reached the mailbox. Commands have no stamp, so of theirs nothing was seen.
pub(super) fn flows(installation: &Installation, links: &[Links]) -> String {
    let rows = bounds(installation).into_iter().map(|bound| {
        let flow = &installation.flows[bound.flow];
        let name = |name| installation.classes.format(name);
        let links = links.iter().find(|links| installation.node_of(flow.to) == Some(links.node.as_str()));
        let class = links.and_then(|links| links.classes.iter().find(|class| class.class == flow.to.class().0));
        let seen = class.and_then(|class| class.age).map(|age| age.max_ns);
        let time = |time: Duration| fine(time.as_secs_f64());
        [
            format!("{} → {}", name(flow.from), name(flow.to)),
            bound.latency.map_or_else(|why| why.to_string(), |bound| time(bound.latency)),
            time(flow.deadline),
            seen.map_or("-".into(), |ns| time(Duration::from_nanos(ns))),
        ]
    });
    table(["flow", ">at worst", ">must be within", ">worst seen"], rows)
}
