//! The traffic between the nodes of the demo, and whether every package is accounted for.

use crate::nodes::quantities::counted;
use crate::terminal::table::table;
use rohrpost::interfaces::Links;
use std::collections::BTreeMap;
use std::fmt;

/// Whether every package that routers were given is accounted for, once nothing is under way.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Balance {
    taken: u64,
    delivered: u64,
    /// Lost in routers, for any cause.
    lost: u64,
    /// Sent by one router and not received by the other.
    on_wire: u64,
    /// Datagrams that were lost with them.
    datagrams: u64,
    /// Nodes with a router that died: its counters are lost.
    died: Vec<String>,
    /// Counters that do not add up.
    wrong: Vec<String>,
}

impl Balance {
    /// The snapshots are not simultaneous: traffic that continues meanwhile, calls of tools (class `tool`), is compared
    /// only within each node. Routers of the nodes that have `died` count from their last start, so between nodes only
    /// the others are compared, and as a whole.
    pub(super) fn of(links: &[Links], tool: u8, died: &[&str]) -> Self {
        let mut balance = Self { died: died.iter().map(ToString::to_string).collect(), ..Self::default() };
        links.iter().for_each(|node| balance.within(node));
        let survived = |node: &str| !died.contains(&node);
        let to_survivors = links.iter().filter(|links| survived(&links.node));
        let peers = to_survivors.flat_map(|to| to.peers.iter().filter(|from| survived(&from.node)));
        balance.datagrams = peers.map(|peer| peer.counters.lost + peer.counters.damaged).sum();
        if died.is_empty() {
            balance.by_class(links, tool)
        } else {
            balance.by_way(links)
        }
        balance
    }

    /// A router's input must equal the sum of its outcomes.
    fn within(&mut self, node: &Links) {
        let waiting: u64 = node.waiting.iter().map(|level| level.packages).sum();
        let (mut into, mut out) = (0, waiting);
        for class in &node.classes {
            let lost: u64 = class.lost.iter().map(|lost| lost.packages).sum();
            into += class.taken + class.came;
            out += class.sent + class.delivered + lost;
            self.lost += lost;
            self.taken += class.taken;
            self.delivered += class.delivered;
        }
        if into != out {
            self.wrong.push(format!("the router of {} had {into} packages and knows of {out}", node.node));
        }
    }

    /// Every sent package must arrive, class by class.
    fn by_class(&mut self, links: &[Links], tool: u8) {
        let mut totals: BTreeMap<u8, [u64; 2]> = BTreeMap::new();
        for class in links.iter().flat_map(|node| &node.classes) {
            let total = totals.entry(class.class).or_default();
            *total = [total[0] + class.sent, total[1] + class.came];
        }
        for (class, sent_and_came) in totals.into_iter().filter(|(class, _)| *class != tool) {
            self.compare(&format!("of class {class}"), sent_and_came);
        }
    }

    /// The same for each pair of nodes, if both routers lived throughout.
    fn by_way(&mut self, links: &[Links]) {
        let survivors: Vec<&Links> = links.iter().filter(|links| !self.died.contains(&links.node)).collect();
        let towards = |of: &Links, to: &Links| of.peers.iter().position(|peer| peer.node == to.node);
        for (from, to) in survivors.iter().flat_map(|from| survivors.iter().map(move |to| (*from, *to))) {
            if let (Some(there), Some(back)) = (towards(from, to), towards(to, from)) {
                let sent_and_came = [from.peers[there].sent.packages, to.peers[back].received.packages];
                self.compare(&format!("from {} to {}", from.node, to.node), sent_and_came);
            }
        }
    }

    fn compare(&mut self, what: &str, [sent, came]: [u64; 2]) {
        self.on_wire += sent.saturating_sub(came);
        if came > sent {
            self.wrong.push(format!("{what}, {sent} packages were sent and {came} came"));
        } else if came < sent && self.datagrams == 0 {
            let missing = sent - came;
            self.wrong.push(format!("{what}, packages that did not come: {missing}; no datagram was lost"));
        }
    }

    /// Datagrams that were lost on the wire.
    pub(super) fn datagrams(&self) -> u64 {
        self.datagrams
    }

    pub(super) fn holds(&self) -> bool {
        self.wrong.is_empty()
    }
}

impl fmt::Display for Balance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { taken, delivered, lost, on_wire, datagrams, died, wrong } = self;
        writeln!(
            f,
            "packages to other nodes: {taken}; delivered: {delivered}; lost in routers, for the causes below: {lost}\n\
             lost on the wire: {on_wire}; datagrams that did not come whole: {datagrams}"
        )?;
        if !died.is_empty() {
            writeln!(
                f,
                "the counters of the router of {} from before its death are lost: between nodes, only packages of the \
                 others are compared",
                died.join(", of ")
            )?;
        }
        if wrong.is_empty() {
            return writeln!(f, "the accounts balance");
        }
        wrong.iter().try_for_each(|what| writeln!(f, "the accounts do not balance: {what}"))
    }
}

/// A row for each pair of nodes and direction, as counted by the receiver.
pub(super) fn by_link(links: &[Links]) -> String {
    let pairs = links.iter().flat_map(|to| to.peers.iter().map(move |from| (from, to)));
    let rows = pairs.map(|(from, to)| {
        let [packages, datagrams] = [from.received.packages, from.received.datagrams].map(|count| count.to_string());
        [format!("{} → {}", from.node, to.node), packages, datagrams, counted(&from.counters)]
    });
    table(["link", ">packages", ">datagrams", "counted"], rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::interfaces::{Carried, CarriedLoss, ClassCarried, LinkCounters, LinkState, PeerLink};

    const TOOL: u8 = 16;

    fn class(class: u8, [taken, sent, came, delivered]: [u64; 4], lost: u64) -> ClassCarried {
        let lost = if lost > 0 { vec![CarriedLoss { cause: "quota".into(), packages: lost }] } else { Vec::new() };
        ClassCarried { class, taken, sent, came, delivered, lost, age: None }
    }

    fn peer(name: &str, [sent, received]: [u64; 2], lost: u64) -> PeerLink {
        let carried = |packages| Carried { packages, ..Carried::default() };
        PeerLink {
            node: name.into(),
            state: LinkState::Alive,
            sent: carried(sent),
            received: carried(received),
            counters: LinkCounters { lost, ..LinkCounters::default() },
            ..PeerLink::default()
        }
    }

    fn node(name: &str, classes: Vec<ClassCarried>, lost: u64) -> Links {
        with_peers(name, classes, vec![peer("other", [0, 0], lost)])
    }

    fn with_peers(name: &str, classes: Vec<ClassCarried>, peers: Vec<PeerLink>) -> Links {
        Links { node: name.into(), peers, classes, ..Links::default() }
    }

    fn wrong(base: ClassCarried, desk: ClassCarried, lost: u64) -> Vec<String> {
        Balance::of(&[node("base", vec![base], 0), node("desk", vec![desk], lost)], TOOL, &[]).wrong
    }

    #[test]
    fn accounts_balance_if_every_package_is_accounted_for() {
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
    fn after_a_death_only_the_other_routers_are_compared() {
        let survivors = |came: u64| {
            let base = with_peers("base", vec![class(150, [3, 3, 0, 0], 0)], vec![peer("brain", [3, 9], 5)]);
            let brain = with_peers(
                "brain",
                vec![class(150, [20, 20, 0, 0], 0)],
                vec![peer("base", [20, 8], 0), peer("desk", [4, 2], 0)],
            );
            let desk = with_peers("desk", Vec::new(), vec![peer("brain", [2, came], 0)]);
            Balance::of(&[base, brain, desk], TOOL, &["base"])
        };
        let balance = survivors(4);
        assert!(balance.holds() && balance.to_string().contains("the counters of the router of base"), "{balance}");
        assert_eq!(survivors(3).wrong, ["from brain to desk, packages that did not come: 1; no datagram was lost"]);
        assert_eq!(survivors(5).wrong, ["from brain to desk, 4 packages were sent and 5 came"]);
    }

    #[test]
    fn calls_of_tools_may_continue_between_two_snapshots() {
        assert_eq!(wrong(class(TOOL, [10, 10, 0, 0], 0), class(TOOL, [0, 0, 9, 9], 0), 0), [""; 0]);
        assert_eq!(wrong(class(TOOL, [10, 9, 0, 0], 0), class(TOOL, [0, 0, 9, 9], 0), 0).len(), 1, "not within a node");
    }
}
