//! Input of a plan for time slots: the link, and the flows and replicas between nodes.

use crate::link::Link;
use crate::setup::Network;
use rohrpost_mailbox::Priority;
use std::time::Duration;

/// A system with time slots, without its table: that is what may change.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Its link.
    pub link: Link,
    /// How its routers send.
    pub network: Network,
    /// All flows by their places elsewhere; none for one that does not go from node to node on the LAN.
    pub flows: Vec<Option<PlannedFlow>>,
    /// All replicas, in the same way.
    pub replicas: Vec<Option<PlannedReplica>>,
}

/// A flow from one node to another, as its router sees it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PlannedFlow {
    /// Node that sends, by its place on the LAN.
    pub node: u8,
    /// Node that receives.
    pub peer: u8,
    /// Bytes of a body, at most.
    pub size: u32,
    /// Time from one package to the next.
    pub period: Duration,
    /// Time within which a package arrives.
    pub deadline: Duration,
    /// Its priority: the sender's for commands, that of the receiver's request for data; both if it may be either.
    pub least: Priority,
    /// The more important of both.
    pub most: Priority,
}

/// A stream that other nodes have, as the router of its node sees it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PlannedReplica {
    /// Node that writes it, by its place on the LAN.
    pub node: u8,
    /// How many nodes have it: each is sent its own parts.
    pub receivers: u32,
    /// Bytes of a record, at most.
    pub record_bytes: u32,
    /// Time from one record that is sent to the next; none: nobody says it.
    pub period: Option<Duration>,
}

impl PlannedReplica {
    /// Parts of a record of full size, to all nodes that have it.
    pub fn parts(&self, link: &Link) -> u64 {
        let parts = u64::from(self.record_bytes).div_ceil(link.part_bytes() as u64).max(1);
        parts * u64::from(self.receivers.max(1))
    }

    /// Parts that it asks for in a second, in thousandths; none if nobody says how many records there are.
    pub fn asks(&self, link: &Link) -> Option<u64> {
        let period_ns = self.period?.as_nanos().max(1);
        let asked = (u128::from(self.parts(link)) * 1_000_000_000_000).div_ceil(period_ns);
        Some(u64::try_from(asked).unwrap_or(u64::MAX))
    }
}
