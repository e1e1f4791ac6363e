//! What routers carried by class, and how nodes keep their time slots, as tables: used by `net` and by the demo's
//! summary.

use crate::look::summary::class_name;
use crate::nodes::quantities::{by_quantity, cells, heads};
use crate::terminal::table::{table_of, time};
use crate::terminal::units::fine;
use rohrpost::Class;
use rohrpost::interfaces::{CarriedLoss, ClassCarried, Links, SlotState, TunnelState};
use rohrpost::schema::Schema;
use rohrpost_config::Installation;
use serde::Serialize;
use std::cmp::Reverse;
use std::time::Duration;

/// A column for each node, and the reason for each silent node; empty if there are no slots.
pub(crate) fn kept<'a>(slots: impl IntoIterator<Item = &'a SlotState>) -> String {
    let nodes: Vec<(&str, &SlotState)> = slots.into_iter().map(|slots| (slots.node.as_str(), slots)).collect();
    if nodes.is_empty() {
        return String::new();
    }
    let off = |slots: &SlotState| {
        let off_ns = slots.last.iter().map(|used| used.off_ns.unsigned_abs()).max();
        off_ns.map_or("-".into(), |ns| fine(ns as f64 * 1e-9))
    };
    let row = |name: &str, cell: &dyn Fn(&SlotState) -> String| {
        [name.to_owned()].into_iter().chain(nodes.iter().map(|(_, slots)| cell(slots))).collect::<Vec<_>>()
    };
    let last = [row("off by", &off), row("scheduled", &|slots| slots.scheduled.clone())];
    let table = by_node("time slots", &nodes, last);
    let silent = nodes.iter().filter(|(_, slots)| !slots.why_silent.is_empty());
    let silent = silent.map(|(node, slots)| format!("node {node} is silent: {}\n", slots.why_silent));
    let tunnels: Vec<(&str, &TunnelState)> =
        nodes.iter().filter_map(|(node, slots)| Some((*node, slots.tunnel.as_ref()?))).collect();
    let tunnels = if tunnels.is_empty() { String::new() } else { "\n".to_owned() + &by_node("tunnel", &tunnels, []) };
    table + &silent.collect::<String>() + &tunnels
}

fn by_node<T: Schema + Serialize>(
    what: &str,
    nodes: &[(&str, &T)],
    last: impl IntoIterator<Item = Vec<String>>,
) -> String {
    let heads = [what.to_owned()].into_iter().chain(nodes.iter().map(|(node, _)| format!(">{node}")));
    table_of(&heads.collect::<Vec<_>>(), by_quantity(nodes).into_iter().chain(last))
}

/// A row for each class and node that `is_shown`, the most urgent class first; empty without any.
pub(crate) fn by_class<'a>(
    installation: &Installation,
    links: impl IntoIterator<Item = &'a Links>,
    is_shown: fn(&ClassCarried) -> bool,
) -> String {
    let classes = links.into_iter().flat_map(|node| node.classes.iter().map(move |class| (node, class)));
    let mut classes: Vec<(&Links, &ClassCarried)> = classes.filter(|(_, class)| is_shown(class)).collect();
    classes.sort_by_key(|(_, class)| Reverse(class.class));
    let rows = classes.iter().map(|(node, class)| {
        let age = class.age.map_or("-".into(), |age| time(Duration::from_nanos(age.p99_ns)));
        let before = [class_name(installation, Some(Class(class.class))), node.node.clone()];
        cells(before, *class, [age, lost(&class.lost)])
    });
    let heads = heads::<ClassCarried>(&["class", "node"], &[">age p99", "lost"]);
    if classes.is_empty() { String::new() } else { table_of(&heads, rows) }
}

/// Losses by cause in one cell.
pub(crate) fn lost(lost: &[CarriedLoss]) -> String {
    let words: Vec<String> = lost.iter().map(|lost| format!("{} {}", lost.packages, lost.cause)).collect();
    if words.is_empty() { "none".into() } else { words.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_happened_on_any_node_has_a_row() {
        let tunnel = TunnelState { sent: 7, dropped: 3, ..TunnelState::default() };
        let base = SlotState { node: "base".into(), used: 5, scheduled: "fifo".into(), ..SlotState::default() };
        let arm = SlotState { node: "arm".into(), unproven: 3, wire_bytes: 2500, tunnel: Some(tunnel), ..base.clone() };
        let text = kept([&base, &arm]);
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        let expected = [
            "time slots base arm",
            "used 5 5",
            "wire bytes 0 B 2.50 kB",
            "unproven 0 3",
            "off by - -",
            "scheduled fifo fifo",
            "",
            "tunnel arm",
            "sent 7",
            "dropped 3",
        ];
        assert_eq!(rows.iter().map(|row| row.join(" ")).collect::<Vec<_>>(), expected);
    }
}
