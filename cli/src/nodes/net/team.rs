//! The part of `rohrpost net` about other systems that are reached without a server.

use super::node_report::NodeReport;
use crate::look::summary::class_name;
use crate::look::target::Running;
use crate::nodes::quantities::{cells, counted, heads};
use crate::nodes::tables::lost;
use crate::terminal::table::table_of;
use rohrpost::Class;
use rohrpost::interfaces::{ClassPassed, TeamLinks, TeamNode};
use rohrpost::output::plain;

/// A table of teammates for each router of the team, with what that counts and why its network is not there, and a
/// table of what was lost; empty without `[team]`.
pub(super) fn text(running: &Running, all: &[NodeReport]) -> [String; 2] {
    let routers: Vec<&TeamLinks> = all.iter().filter_map(|told| told.team.as_ref()).collect();
    [routers.iter().map(|router| nodes(router)).collect(), losses(running, &routers)]
}

fn nodes(router: &TeamLinks) -> String {
    let rows = router.nodes.iter().map(|node| {
        let state = match (node.proven, node.hears_us) {
            (false, _) => "unproven",
            (true, false) => "heard",
            (true, true) => "both ways",
        };
        let loss = if node.sent == 0 { "-".into() } else { format!("{:.1} %", percent(node)) };
        cells([node.system.to_string(), node.node.to_string(), node.address.clone(), state.into()], node, [loss])
    });
    let heads = heads::<TeamNode>(&[">system", ">node", "address", "state"], &[">loss"]);
    let mut text = if router.nodes.is_empty() { String::new() } else { table_of(&heads, rows) };
    let sealed = if router.sealed { "sealed" } else { "not sealed" };
    text += &format!("(team by {} from node {}, {sealed}: counted {})\n", router.reach, router.name, counted(router));
    if !router.refused.is_empty() {
        text += &format!("(refused: {})\n", lost(&router.refused));
    }
    if !router.why.is_empty() {
        text += &format!("node {}: {}\n", router.name, plain::line(&router.why));
    }
    text
}

fn percent(node: &TeamNode) -> f64 {
    100.0 * node.missed as f64 / node.sent as f64
}

/// Classes with lost packages; the others are in the JSON.
fn losses(running: &Running, routers: &[&TeamLinks]) -> String {
    let ends = routers.iter().flat_map(|router| {
        [
            (format!("{}, to other systems", router.name), &router.sent),
            (format!("{}, from them", router.name), &router.received),
        ]
    });
    let mut rows = Vec::new();
    for (at, classes) in ends {
        for class in classes.iter().filter(|class| !class.lost.is_empty()) {
            let name = class_name(&running.installation, Some(Class(class.class)));
            rows.push(cells([at.clone(), name], class, [lost(&class.lost)]));
        }
    }
    let heads = heads::<ClassPassed>(&["at", "class"], &["lost"]);
    if rows.is_empty() { String::new() } else { table_of(&heads, rows) }
}
