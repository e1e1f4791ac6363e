//! What routers carried by class, how late declared flows were, and how nodes keep their time slots, as tables: used by
//! `net` and by the demo's summary.

use crate::look::summary::class_name;
use crate::nodes::quantities::{self, by_quantity, cells, heads};
use crate::nodes::vocabulary::{Vocabulary, built_in};
use crate::terminal::table::{table_of, time};
use crate::terminal::units::fine;
use rohrpost::interfaces::{CarriedLoss, ClassCarried, FlowState, FlowStates, Links, SlotState, TunnelState};
use rohrpost::schema::{Description, Schema};
use rohrpost::{Class, Name};
use rohrpost_config::{Contents, Installation};
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

/// Explains the columns.
pub(crate) fn flows_legend() -> String {
    format!(
        "Of declared flows, measured by the sending router up to the arrival at the other computer:\n{}{LEGEND}",
        quantities::legend::<FlowState>()
    )
}

const LEGEND: &str = "  \
  lost: packages lost in that router's queue
  oldest: data of the receiver's class at their arrival in its mailbox, by their stamp
A package between two modules belongs to the flow that carries it, else, declared or not, to a flow that does not say
what it carries.
";

/// A row for each flow that starts at one of these nodes; empty if there is none. `ask` asks a module for its
/// interface.
pub(crate) fn measured<'a>(
    installation: &Installation,
    nodes: impl IntoIterator<Item = &'a FlowStates>,
    links: &[&Links],
    vocabulary: &mut Vocabulary,
    mut ask: impl FnMut(Name) -> Option<Description>,
) -> String {
    let rows = nodes.into_iter().flat_map(|node| &node.flows).map(|flow| {
        let carried = carried(installation, flow, vocabulary, &mut ask);
        row(installation, flow, carried, links)
    });
    let rows: Vec<_> = rows.collect();
    if rows.is_empty() {
        return String::new();
    }
    table_of(&heads::<FlowState>(&["flow"], &[">lost", ">oldest"]), rows)
}

/// A flow's content, by its name in the interface if that is known; none if the file does not list it.
fn carried(
    installation: &Installation,
    flow: &FlowState,
    vocabulary: &mut Vocabulary,
    ask: impl FnOnce(Name) -> Option<Description>,
) -> Option<String> {
    let contents: Contents = flow.carries.parse().ok()?;
    let word = contents.kind().and_then(|kind| {
        let module = |text: &str| installation.classes.parse_module(text).ok();
        let (from, to) = (module(&flow.from)?, module(&flow.to)?);
        vocabulary.word(kind, from, to, |module| built_in(installation, module).or_else(|| ask(module)))
    });
    Some(word.unwrap_or_else(|| contents.to_string()))
}

fn row(installation: &Installation, flow: &FlowState, carried: Option<String>, links: &[&Links]) -> Vec<String> {
    let carried = carried.map(|word| format!(" {word}")).unwrap_or_default();
    let lost: u64 = flow.lost.iter().map(|lost| lost.packages).sum();
    let oldest = oldest_ns(installation, flow, links).map_or("-".into(), |ns| fine(ns as f64 * 1e-9));
    cells([format!("{} → {}{carried}", flow.from, flow.to)], flow, [lost.to_string(), oldest])
}

/// Packages of the receiver's class, on its node. Commands and replies have no stamp.
fn oldest_ns(installation: &Installation, flow: &FlowState, links: &[&Links]) -> Option<u64> {
    let to = installation.classes.parse_module(&flow.to).ok()?;
    let node = installation.node_of(to)?;
    let classes = &links.iter().find(|links| links.node == node)?.classes;
    classes.iter().find(|class| class.class == to.class().0)?.age.map(|age| age.max_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::interface::Interface;
    use rohrpost::interfaces::{CarriedLoss, LaserInterface};
    use std::path::Path;

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

    fn flow(packages: u64, bound_ns: Option<u64>) -> FlowState {
        FlowState {
            from: "laser.0".into(),
            to: "pilot.0".into(),
            carries: String::new(),
            size: 800,
            packages,
            bound_ns,
            kept_worst_ns: bound_ns.map(|_| 5_090_000),
            worst_ns: Some(5_100_000).filter(|_| packages > 0),
            mean_ns: Some(2_000_000).filter(|_| packages > 0),
            p99_ns: Some(4_900_000).filter(|_| packages > 0),
            deadline_ns: 10_000_000,
            over_bound: bound_ns.map(|_| 2),
            kept_over_bound: bound_ns.map(|_| 0),
            over_deadline: 1,
            lost: vec![CarriedLoss { cause: "quota".into(), packages: 3 }],
        }
    }

    #[test]
    fn unmeasured_and_unknown_figures_are_blank() {
        let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo-tdma.toml");
        let installation = Installation::load(&demo).unwrap();
        let words = |flow: FlowState| {
            let node = FlowStates { node: "base".into(), flows: vec![flow] };
            let text = measured(&installation, [&node], &[], &mut Vocabulary::default(), |_| None);
            text.lines()
                .find(|line| line.contains(" → "))
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
            of("laser.0 → pilot.0|800 B|7|5.540 ms|5.090 ms|5.100 ms|2.000 ms|4.900 ms|10.00 ms|2|0|1|3|-")
        );
        assert_eq!(words(flow(0, None)), of("laser.0 → pilot.0|800 B|0|-|-|-|-|-|10.00 ms|-|-|1|3|-"));
        let none = FlowStates { node: "base".into(), flows: Vec::new() };
        assert_eq!(measured(&installation, [&none], &[], &mut Vocabulary::default(), |_| None), "");
    }

    #[test]
    fn a_flow_content_has_its_name_from_the_interface() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/demo-nodes.toml");
        let text = std::fs::read_to_string(&file).unwrap();
        // One interface must be asked for; the other module does not answer.
        let program = |name: &str| format!("[[module]]\nname = \"{name}\"\nnode = \"base\"\nprogram = \"./laser\"\n");
        let text = text + &program("laser.1") + &program("laser.2");
        let installation = Installation::parse(&text, &file).unwrap();
        let told = installation.classes.parse_module("laser.1").unwrap();
        let mut asked = Vec::new();
        let ask = |module: Name| {
            asked.push(module);
            (module == told).then(LaserInterface::description)
        };
        let carrying = |(from, to, carries, _): (&str, &str, &str, &str)| FlowState {
            from: from.into(),
            to: to.into(),
            carries: carries.into(),
            ..flow(0, None)
        };
        let cases = [
            ("laser.0", "pilot.0", "data 1", "laser.0 → pilot.0 scan"),
            ("laser.0", "pilot.0", "reply 5", "laser.0 → pilot.0 subscribe answered"),
            ("pilot.0", "motor.0", "command 16", "pilot.0 → motor.0 drive"),
            ("motor.0", "pilot.0", "reply 16", "motor.0 → pilot.0 drive answered"),
            ("laser.1", "pilot.0", "data 1", "laser.1 → pilot.0 scan"),
            ("laser.0", "pilot.0", "data 9", "laser.0 → pilot.0 data 9"),
            ("laser.2", "pilot.0", "data 1", "laser.2 → pilot.0 data 1"),
            ("laser.2", "pilot.0", "data 2", "laser.2 → pilot.0 data 2"),
            ("laser.0", "pilot.0", "reply", "laser.0 → pilot.0 reply"),
            ("laser.0", "pilot.0", "", "laser.0 → pilot.0"),
        ];
        let node = FlowStates { node: "base".into(), flows: cases.map(carrying).into() };
        let text = measured(&installation, [&node], &[], &mut Vocabulary::default(), ask);
        let first = |row: &str| row.split("  ").next().unwrap_or_default().to_owned();
        let first: Vec<String> = text.lines().filter(|line| line.contains(" → ")).map(first).collect();
        assert_eq!(first, cases.map(|(.., expected)| expected));
        assert_eq!(
            asked,
            [told, installation.classes.parse_module("laser.2").unwrap()],
            "each once, and no built-in one"
        );
    }
}
