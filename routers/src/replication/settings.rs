//! What a router knows of a replica from the configuration.

use crate::frame::NodeIndex;
use rohrpost_config::{Installation, Sampling};
use rohrpost_mailbox::{Name, StreamShape};
use std::time::Duration;

/// One replica, as all routers of a system know it.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplicaSettings {
    /// The module that writes the stream.
    pub from: Name,
    /// The stream's name in its interface.
    pub item: String,
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

impl ReplicaSettings {
    /// All of an installation, in the order of their places on the wire.
    pub fn all(installation: &Installation) -> Vec<Self> {
        if installation.network.is_none() {
            return Vec::new();
        }
        let index = |node: &str| installation.lan_index(node);
        let of = |replica: &rohrpost_config::Replica| {
            // Configuration checks that these are nodes of the LAN.
            let node = index(installation.node_of(replica.from).unwrap_or_default()).unwrap_or(NodeIndex::MAX);
            let ns = |time: Duration| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
            Self {
                from: replica.from,
                item: replica.item.clone(),
                shape: replica.spec(installation).shape(),
                node,
                to: replica.to.iter().filter_map(|name| index(name)).fold(0, |all, node| all | 1 << node),
                sampling: replica.sampling,
                changed: replica.changed,
                delay_alarm_ns: ns(replica.delay_alarm),
                deadline_ns: ns(replica.deadline),
                level: replica.level(installation),
            }
        };
        installation.replicas.iter().map(of).collect()
    }
}
