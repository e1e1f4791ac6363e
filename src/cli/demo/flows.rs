//! What the summary says of flows: each one's worst case beside the worst that was seen.

use crate::cli::table::table;
use crate::cli::units::fine;
use rohrpost::config::{Installation, bounds};
use rohrpost::interfaces::Links;
use std::time::Duration;

/// Each flow between nodes: how late it may be at most by what `check` reckons, and how old the oldest of its receiver's data was when it
/// reached the mailbox. Commands have no stamp, so of theirs nothing was seen.
pub(super) fn table_of(installation: &Installation, links: &[Links]) -> String {
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
