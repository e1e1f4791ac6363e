//! What went between the nodes of the demo, and whether nothing was forgotten.

use crate::cli::summary::class_name;
use crate::cli::table::{table, time};
use rohrpost::Class;
use rohrpost::config::Installation;
use rohrpost::interfaces::{Carried, ClassCarried, Links, PeerLink};
use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

/// Whether all that routers were given is accounted for, once nothing is on its way any more.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Balance {
    taken: u64,
    delivered: u64,
    /// Lost in routers, for any cause.
    lost: u64,
    /// Sent by one router and not come to the other.
    on_wire: u64,
    /// Datagrams that went missing with them.
    datagrams: u64,
    /// What does not add up.
    wrong: Vec<String>,
}

impl Balance {
    /// The snapshots are of different moments: what goes on meanwhile, calls of tools (class `tool`), is compared within each node only.
    pub(super) fn of(links: &[Links], tool: u8) -> Self {
        let mut balance = Self::default();
        let mut ways: BTreeMap<u8, [u64; 2]> = BTreeMap::new();
        for node in links {
            let waiting: u64 = node.waiting.iter().map(|level| level.packages).sum();
            let (mut into, mut out) = (0, waiting);
            for class in &node.classes {
                let lost = lost_of(class);
                into += class.taken + class.came;
                out += class.sent + class.delivered + lost;
                balance.lost += lost;
                balance.taken += class.taken;
                balance.delivered += class.delivered;
                let way = ways.entry(class.class).or_default();
                *way = [way[0] + class.sent, way[1] + class.came];
            }
            if into != out {
                balance.wrong.push(format!("the router of {} had {into} packages and knows of {out}", node.node));
            }
            balance.datagrams += node.peers.iter().map(gone).sum::<u64>();
        }
        for (class, [sent, came]) in ways.into_iter().filter(|(class, _)| *class != tool) {
            balance.on_wire += sent.saturating_sub(came);
            if came > sent {
                balance.wrong.push(format!("of class {class}, {sent} packages were sent and {came} came"));
            } else if came < sent && balance.datagrams == 0 {
                let missing = sent - came;
                balance
                    .wrong
                    .push(format!("of class {class}, packages that did not come: {missing}; no datagram was lost"));
            }
        }
        balance
    }

    pub(super) fn holds(&self) -> bool {
        self.wrong.is_empty()
    }
}

impl fmt::Display for Balance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { taken, delivered, lost, on_wire, datagrams, wrong } = self;
        writeln!(
            f,
            "packages to other nodes: {taken}; delivered: {delivered}; lost in routers, for the causes above: {lost}\n\
             lost on the wire: {on_wire}; datagrams that did not come whole: {datagrams}"
        )?;
        if wrong.is_empty() {
            return writeln!(f, "the accounts balance");
        }
        wrong.iter().try_for_each(|what| writeln!(f, "the accounts do not balance: {what}"))
    }
}

fn lost_of(class: &ClassCarried) -> u64 {
    class.lost.iter().map(|lost| lost.packages).sum()
}

/// Datagrams from a peer that did not come whole.
fn gone(peer: &PeerLink) -> u64 {
    peer.lost + peer.damaged
}

/// A row for each class and node.
pub(super) fn by_class(installation: &Installation, links: &[Links]) -> String {
    let mut rows: Vec<(u8, [String; 10])> = Vec::new();
    for node in links {
        for class in &node.classes {
            let ages = class.age.map_or(["-".into(), "-".into(), "-".into()], |age| {
                [age.p50_ns, age.p99_ns, age.max_ns].map(|ns| time(Duration::from_nanos(ns)))
            });
            let [p50, p99, max] = ages;
            let lost = class.lost.iter().map(|lost| format!("{} {}", lost.packages, lost.cause));
            let lost: Vec<String> = lost.collect();
            let counts = [class.taken, class.sent, class.came, class.delivered].map(|count| count.to_string());
            let [taken, sent, came, delivered] = counts;
            let name = class_name(installation, Some(Class(class.class)));
            let lost = if lost.is_empty() { "none".into() } else { lost.join(", ") };
            rows.push((class.class, [name, node.node.clone(), taken, sent, came, delivered, lost, p50, p99, max]));
        }
    }
    rows.sort_by_key(|(class, _)| std::cmp::Reverse(*class));
    table(
        ["class", "node", ">taken", ">sent", ">came", ">delivered", "lost", ">age p50", ">p99", ">max"],
        rows.into_iter().map(|(_, row)| row),
    )
}

/// A row for each pair of nodes and direction, as the one that receives sees it.
pub(super) fn by_link(links: &[Links]) -> String {
    let pairs = links.iter().flat_map(|to| to.peers.iter().map(move |from| (from, to)));
    let rows = pairs.map(|(from, to)| {
        let Carried { packages, datagrams, bytes, parts } = from.received;
        [
            format!("{} → {}", from.node, to.node),
            packages.to_string(),
            datagrams.to_string(),
            format!("{} KiB", bytes.div_ceil(1 << 10)),
            parts.to_string(),
            from.lost.to_string(),
            from.damaged.to_string(),
            from.copies.to_string(),
            from.overtaken.to_string(),
        ]
    });
    table(["link", ">packages", ">datagrams", ">bytes", ">parts", ">lost", ">damaged", ">copies", ">overtaken"], rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::interfaces::{CarriedLoss, LinkState};

    const TOOL: u8 = 16;

    fn class(class: u8, [taken, sent, came, delivered]: [u64; 4], lost: u64) -> ClassCarried {
        let lost = if lost > 0 { vec![CarriedLoss { cause: "quota".into(), packages: lost }] } else { Vec::new() };
        ClassCarried { class, taken, sent, came, delivered, lost, age: None }
    }

    fn node(name: &str, classes: Vec<ClassCarried>, lost: u64) -> Links {
        let peer = PeerLink {
            node: "other".into(),
            address: "10.77.0.9".into(),
            state: LinkState::Alive,
            why: String::new(),
            heard_ms: Some(1),
            sent: Carried::default(),
            received: Carried::default(),
            unsent: 0,
            lost,
            missed: 0,
            copies: 0,
            damaged: 0,
            overtaken: 0,
            refused: 0,
            restarts: 0,
        };
        Links {
            node: name.into(),
            digest: 1,
            uptime_ms: 1,
            peers: vec![peer],
            waiting: Vec::new(),
            waiting_bytes: 0,
            classes,
            foreign: 0,
            failures: Vec::new(),
        }
    }

    fn wrong(base: ClassCarried, desk: ClassCarried, lost: u64) -> Vec<String> {
        Balance::of(&[node("base", vec![base], 0), node("desk", vec![desk], lost)], TOOL).wrong
    }

    #[test]
    fn accounts_balance_if_every_package_is_known_of() {
        let sent = || class(150, [10, 9, 0, 0], 1);
        assert_eq!(wrong(sent(), class(150, [0, 0, 9, 7], 2), 0), [""; 0]);
        assert_eq!(wrong(sent(), class(150, [0, 0, 8, 8], 0), 1), [""; 0], "one was in a datagram that is missing");
        assert_eq!(
            wrong(sent(), class(150, [0, 0, 8, 8], 0), 0),
            ["of class 150, packages that did not come: 1; no datagram was lost"]
        );
        assert_eq!(wrong(sent(), class(150, [0, 0, 10, 10], 0), 0), ["of class 150, 9 packages were sent and 10 came"]);
        assert_eq!(
            wrong(class(150, [10, 9, 0, 0], 0), class(150, [0, 0, 9, 9], 0), 0),
            ["the router of base had 10 packages and knows of 9"]
        );
    }

    #[test]
    fn calls_of_tools_go_on_between_two_snapshots() {
        assert_eq!(wrong(class(TOOL, [10, 10, 0, 0], 0), class(TOOL, [0, 0, 9, 9], 0), 0), [""; 0]);
        assert_eq!(wrong(class(TOOL, [10, 9, 0, 0], 0), class(TOOL, [0, 0, 9, 9], 0), 0).len(), 1, "not within a node");
    }
}
