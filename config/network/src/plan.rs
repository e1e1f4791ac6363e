//! Input of a plan for time slots: the link, and the flows between nodes.

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
