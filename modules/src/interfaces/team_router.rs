//! What a router of the team says of the other systems.

use super::router::CarriedLoss;
use super::tcp::ClassPassed;
use crate::interface;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// A node of another system, as it is heard. Counts are of its present incarnation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TeamNode {
    /// First byte of the names that it hosts.
    pub system: u8,
    /// Its place among the nodes there.
    pub node: u8,
    /// Where its last datagram came from.
    pub address: String,
    /// Whether it has shown that it lives, so that its packages are taken.
    pub proven: bool,
    /// Whether it said that it hears this node.
    pub hears_us: bool,
    /// Time since something of it was believed.
    #[schema(unit = "ms")]
    pub heard_ms: u64,
    /// Datagrams to all systems that it sent since it was heard first, as far as it has said.
    #[schema(unit = "datagrams")]
    pub sent: u64,
    /// Of these, those that did not come.
    #[schema(unit = "datagrams")]
    pub missed: u64,
    /// Incarnations of its router that were heard.
    #[schema(unit = "incarnations")]
    pub incarnations: u64,
    /// How often an earlier incarnation came back: two computers have its system and place.
    #[schema(unit = "returns")]
    pub returns: u64,
}

/// A node's router of the team. Counts are since it began, and only grow.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct TeamLinks {
    /// The node.
    pub name: String,
    /// The group that it sends to, or its own address where it has peers.
    pub reach: String,
    /// Whether datagrams are sealed.
    pub sealed: bool,
    /// Why the network is not there; empty if it is.
    pub why: String,
    /// The nodes of other systems, by system.
    pub nodes: Vec<TeamNode>,
    /// Datagrams that left.
    #[schema(unit = "datagrams")]
    pub datagrams_sent: u64,
    /// Datagrams that came.
    #[schema(unit = "datagrams")]
    pub datagrams_came: u64,
    /// Packages that had come by the TCP router already, or came by it later.
    #[schema(unit = "packages")]
    pub copies: u64,
    /// Datagrams that were refused, and why.
    pub refused: Vec<CarriedLoss>,
    /// Classes that sent something to other systems, the most urgent first.
    pub sent: Vec<ClassPassed>,
    /// Classes of which something came from other systems.
    pub received: Vec<ClassPassed>,
}

/// Carries packages between systems without a server; it does so also while it is off.
#[interface(class = "team-router", crate = crate::macro_support)]
pub trait TeamRouter {
    /// Which systems are heard, and how well.
    #[data(1)]
    fn links() -> TeamLinks;
}
