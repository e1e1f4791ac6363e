//! Declared flows as a table: how late each may be at most, and how late it was. Of `net`, and of the demo's summary.

use super::table::table;
use super::units::fine;
use rohrpost::config::Installation;
use rohrpost::interfaces::{FlowState, FlowStates, Links};

/// What the columns say that their heads do not.
pub(super) const LEGEND: &str = "\
at worst: the bound that `check` computes, for slots that are kept; kept: the slowest package since whose publishing none was missed or cut
short; slowest: of all, as the router that sends measured it, up to the arrival at the other computer; beyond: packages slower than the bound,
of kept: those among them whose slots were kept; late: slower than the deadline, `within`; lost: in that router's queue; oldest: data of the receiver's class
when they came to its mailbox, by their stamp. All that goes between two modules is put to one of their flows, declared or not";

/// A row for each flow that leaves one of these nodes; empty without any.
pub(super) fn measured<'a>(
    installation: &Installation,
    nodes: impl IntoIterator<Item = &'a FlowStates>,
    links: &[&Links],
) -> String {
    let rows = nodes.into_iter().flat_map(|node| &node.flows).map(|flow| row(installation, flow, links));
    let rows: Vec<_> = rows.collect();
    if rows.is_empty() {
        return String::new();
    }
    let heads = [
        "flow",
        ">bytes",
        ">packages",
        ">at worst",
        ">kept",
        ">slowest",
        ">99 of 100",
        ">within",
        ">beyond",
        ">of kept",
        ">late",
        ">lost",
        ">oldest",
    ];
    table(heads, rows)
}

fn row(installation: &Installation, flow: &FlowState, links: &[&Links]) -> [String; 13] {
    let ns = |ns: u64| fine(ns as f64 * 1e-9);
    let seen = |of: u64| if flow.packages == 0 { "-".into() } else { ns(of) };
    let lost: u64 = flow.lost.iter().map(|lost| lost.packages).sum();
    [
        format!("{} → {}", flow.from, flow.to),
        flow.size.to_string(),
        flow.packages.to_string(),
        flow.bound_ns.map_or("-".into(), ns),
        flow.bound_ns.filter(|_| flow.kept_worst_ns > 0).map_or("-".into(), |_| ns(flow.kept_worst_ns)),
        seen(flow.worst_ns),
        seen(flow.p99_ns),
        ns(flow.deadline_ns),
        flow.bound_ns.map_or("-".into(), |_| flow.over_bound.to_string()),
        flow.bound_ns.map_or("-".into(), |_| flow.kept_over_bound.to_string()),
        flow.over_deadline.to_string(),
        lost.to_string(),
        oldest_ns(installation, flow, links).map_or("-".into(), ns),
    ]
}

/// Of the receiver's class, on its node. Commands and replies have no stamp.
fn oldest_ns(installation: &Installation, flow: &FlowState, links: &[&Links]) -> Option<u64> {
    let to = installation.classes.parse_module(&flow.to).ok()?;
    let node = installation.node_of(to)?;
    let classes = &links.iter().find(|links| links.node == node)?.classes;
    classes.iter().find(|class| class.class == to.class().0)?.age.map(|age| age.max_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::interfaces::CarriedLoss;
    use std::path::Path;

    fn flow(packages: u64, bound_ns: Option<u64>) -> FlowState {
        FlowState {
            from: "laser.0".into(),
            to: "pilot.0".into(),
            size: 800,
            packages,
            worst_ns: 5_100_000,
            mean_ns: 2_000_000,
            p99_ns: 4_900_000,
            bound_ns,
            deadline_ns: 10_000_000,
            kept_worst_ns: 5_090_000,
            over_bound: 2,
            kept_over_bound: 0,
            over_deadline: 1,
            lost: vec![CarriedLoss { cause: "quota".into(), packages: 3 }],
        }
    }

    #[test]
    fn what_was_not_seen_and_what_is_not_known_is_left_open() {
        let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/demo-tdma.toml");
        let installation = Installation::load(&demo).unwrap();
        let words = |flow: FlowState| {
            let node = FlowStates { node: "base".into(), flows: vec![flow] };
            let text = measured(&installation, [&node], &[]);
            text.lines()
                .nth(1)
                .unwrap_or_default()
                .split("  ")
                .map(str::trim)
                .filter(|word| !word.is_empty())
                .map(str::to_owned)
                .collect::<Vec<_>>()
        };
        let of = |columns: &str| columns.split('|').map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(
            words(flow(7, Some(5_540_000))),
            of("laser.0 → pilot.0|800|7|5.540 ms|5.090 ms|5.100 ms|4.900 ms|10.00 ms|2|0|1|3|-")
        );
        assert_eq!(words(flow(0, None)), of("laser.0 → pilot.0|800|0|-|-|-|-|10.00 ms|-|-|1|3|-"));
        assert_eq!(measured(&installation, [&FlowStates { node: "base".into(), flows: Vec::new() }], &[]), "");
    }
}
