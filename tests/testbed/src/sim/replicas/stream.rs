//! A stream of a simulated network with its replicas, as it is planned.

use rohrpost_config::Sampling;
use rohrpost_mailbox::{StreamId, StreamShape};
use rohrpost_network::LEVELS;

/// One stream.
#[derive(Clone, Debug)]
pub struct StreamPlan {
    /// Which.
    pub id: StreamId,
    /// The node on which it is written.
    pub node: usize,
    /// What it is there and on all others.
    pub shape: StreamShape,
    /// The nodes that have a replica, one bit each.
    pub to: u64,
    /// Which records are sent.
    pub sampling: Sampling,
    /// Of these only those with other bytes.
    pub changed: bool,
    /// See [`ReplicaSettings`](rohrpost_routers::replication::ReplicaSettings).
    pub deadline_ns: u64,
    /// From one record to the next, ns.
    pub period_ns: u64,
    /// Shortest and longest record.
    pub bytes: (u64, u64),
    /// Of a hundred records, those with the bytes of the one before.
    pub same_percent: u64,
    /// Whether the wire carries it; else its records may all be overwritten while they leave.
    pub is_carried: bool,
    /// Node and pause between two looks of each reader, ns.
    pub readers: Vec<(usize, u64)>,
}

impl StreamPlan {
    /// The level of its writer's class.
    pub fn level(&self, bulk_below: u8) -> u8 {
        let class = self.id.name.class().0;
        if class < bulk_below { LEVELS as u8 - 1 } else { (15 - (class >> 4)) * 2 }
    }

    /// Whether some of its records are left out on purpose.
    pub(super) fn is_sampled(&self) -> bool {
        self.changed || self.sampling != Sampling::Each
    }

    /// Whether a node has a replica.
    pub fn is_on(&self, node: usize) -> bool {
        self.to & 1 << node != 0
    }
}
