//! A stream of a simulated network with its replicas, as it is planned.

use rohrpost_config::Sampling;
use rohrpost_mailbox::{StreamId, StreamShape};
use rohrpost_network::LEVELS;

#[derive(Clone, Debug)]
pub(crate) struct StreamPlan {
    pub(crate) id: StreamId,
    /// The node on which it is written.
    pub(crate) node: usize,
    /// What it is there and on all others.
    pub(crate) shape: StreamShape,
    /// The nodes that have a replica, one bit each.
    pub(crate) to: u64,
    /// Which records are sent.
    pub(crate) sampling: Sampling,
    /// Of these only those with other bytes.
    pub(crate) changed: bool,
    /// See [`ReplicaSettings`](rohrpost_routers::replication::ReplicaSettings).
    pub(crate) deadline_ns: u64,
    /// From one record to the next, ns.
    pub(crate) period_ns: u64,
    /// Shortest and longest record.
    pub(crate) bytes: (u64, u64),
    /// Of a hundred records, those with the bytes of the one before.
    pub(crate) same_percent: u64,
    /// Whether the wire carries it; else its records may all be overwritten while they leave.
    pub(crate) is_carried: bool,
    /// Node and pause between two looks of each reader, ns.
    pub(crate) readers: Vec<(usize, u64)>,
}

impl StreamPlan {
    /// The level of its writer's class.
    pub(crate) fn level(&self, bulk_below: u8) -> u8 {
        let class = self.id.name.class().0;
        if class < bulk_below { LEVELS as u8 - 1 } else { (15 - (class >> 4)) * 2 }
    }

    /// Whether some of its records are left out on purpose.
    pub(super) fn is_sampled(&self) -> bool {
        self.changed || self.sampling != Sampling::Each
    }

    pub(crate) fn is_on(&self, node: usize) -> bool {
        self.to & 1 << node != 0
    }
}
