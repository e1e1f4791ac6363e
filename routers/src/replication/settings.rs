//! What a router knows of a replica from the configuration.

use crate::frame::NodeIndex;
use rohrpost_config::{Installation, Reach, Replica, Sampling};
use rohrpost_mailbox::{Name, StreamShape};
use std::time::Duration;

/// One replica, as all routers of a system know it.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplicaSettings {
    /// The module that writes the stream.
    pub from: Name,
    /// The stream's name in its interface.
    pub item: String,
    /// The stream as the configuration names it, such as `laser.0/scan`, for lines of output.
    pub stream: String,
    /// What the stream is on each node.
    pub shape: StreamShape,
    /// The node on which it is written.
    pub node: NodeIndex,
    /// The nodes that have a replica, one bit each.
    pub to: u64,
    /// Which records are sent.
    pub sampling: Sampling,
    /// Of these, only those with other bytes than the last one that was sent.
    pub changed: bool,
    /// A record that arrives so much later than it was written is told, ns.
    pub delay_alarm_ns: u64,
    /// Lost parts are asked for until nothing came of a record for so long, ns; 0: never.
    pub deadline_ns: u64,
    /// The level on which they are sent: that of the class of `from`.
    pub level: u8,
}

/// What a node sends by the TCP router, and what it has from it. By place in the configuration, with its place among
/// all nodes for each; what does not concern this node goes to nobody.
#[derive(Clone, Debug, PartialEq)]
pub struct LineSettings {
    /// The node.
    pub own: NodeIndex,
    /// The node that the TCP router runs on.
    pub server: NodeIndex,
    /// There: the nodes beyond the LAN, each with the name of its client.
    pub nodes: Vec<(NodeIndex, Name)>,
    /// What it sends.
    pub sent: Vec<ReplicaSettings>,
    /// What it has; `node` is the other end of the line.
    pub received: Vec<ReplicaSettings>,
}

impl ReplicaSettings {
    /// All of an installation that go by the LAN, in the order of their places on the wire.
    pub fn all(installation: &Installation) -> Vec<Self> {
        let Some(network) = installation.network else { return Vec::new() };
        let of = |replica: &Replica| {
            let level = network.level(replica.priority());
            Self::of(installation, replica, level, installation.hop_by_lan(replica).as_ref(), |_| true)
        };
        installation.replicas.iter().map(of).collect()
    }

    /// From a node to those that `concerns`; none: it goes nowhere. Sampling is where the stream is written.
    fn of(
        installation: &Installation,
        replica: &Replica,
        level: u8,
        hop: Option<&(&str, Vec<&str>)>,
        concerns: impl Fn(&str) -> bool,
    ) -> Self {
        let ns = |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        let index = |node: &str| installation.node_index(node);
        let (node, to) = hop.map_or(("", &[][..]), |(node, to)| (*node, &to[..]));
        let to = to.iter().filter(|to| concerns(to)).filter_map(|to| index(to)).fold(0, |all, node| all | 1 << node);
        let is_first = installation.node_of(replica.from) == Some(node);
        Self {
            from: replica.from,
            item: replica.item.clone(),
            stream: replica.text(installation),
            shape: replica.spec(installation).shape(),
            node: index(node).unwrap_or(NodeIndex::MAX),
            to,
            sampling: if is_first { replica.sampling } else { Sampling::Each },
            changed: replica.changed && is_first,
            delay_alarm_ns: ns(replica.delay_alarm),
            deadline_ns: ns(replica.deadline),
            level,
        }
    }
}

impl LineSettings {
    /// None where no replica goes by the TCP router from or to this node.
    pub fn new(installation: &Installation, own: &str) -> Option<Self> {
        let (tcp, index) = (installation.tcp.as_ref()?, |node: &str| installation.node_index(node));
        let server = tcp.server.as_deref()?;
        let both = |replica: &Replica| {
            let hops = installation.hops_by_tcp(replica);
            let level = tcp.level(replica.priority());
            let from_here = hops.iter().find(|(from, _)| *from == own);
            let to_here = hops.iter().find(|(_, to)| to.contains(&own));
            let of =
                |hop, is_here: &dyn Fn(&str) -> bool| ReplicaSettings::of(installation, replica, level, hop, is_here);
            (of(from_here, &|_| true), of(to_here, &|to| to == own))
        };
        let (sent, received): (Vec<_>, Vec<_>) = installation.replicas.iter().map(both).unzip();
        let is_some = sent.iter().chain(&received).any(|replica| replica.to != 0);
        let beyond = installation.nodes.iter().filter(|node| own == server && node.reach == Reach::Tcp);
        let nodes = beyond.filter_map(|node| Some((index(&node.name)?, installation.tcp_client_of(&node.name)?)));
        let (own, server) = (index(own)?, index(server)?);
        is_some.then(|| Self { own, server, nodes: nodes.collect(), sent, received })
    }
}
