//! What a router knows before the first datagram: who it is, who the others are, and how much of the wire is its.
//!
//! Comes from an installation and the name of a node; a test or a simulation makes one from plain values.

use crate::frame::{self, FRAGMENT_HEAD_BYTES, NodeIndex, PARTS_MAX};
use rohrpost_mailbox::{BODY_BYTES_MAX, HEAD_BYTES, Name, Priority};
use std::net::IpAddr;

/// Levels of the queue; 0 goes first, the last takes what is not real time.
pub const LEVELS: usize = 32;
/// Least that a sender may have waiting: two of the largest packages.
pub const QUOTA_BYTES_MIN: usize = 128 * 1024;
/// The smallest datagram that a package of any size goes into, in parts.
pub const DATAGRAM_BYTES_MIN: usize = 528;
/// The largest that UDP carries over IPv4.
pub const DATAGRAM_BYTES_MAX: usize = 65507;

const _: () = {
    let part = DATAGRAM_BYTES_MIN - frame::HEAD_BYTES - FRAGMENT_HEAD_BYTES;
    assert!(
        BODY_BYTES_MAX.div_ceil(part) <= PARTS_MAX as usize,
        "the largest package fits in the parts that there may be"
    );
    assert!(
        QUOTA_BYTES_MIN >= 2 * (BODY_BYTES_MAX + HEAD_BYTES),
        "a sender's next package fits behind the one that leaves"
    );
};

/// One router, and the network that it is on.
#[derive(Clone, Debug)]
pub struct Settings {
    /// First byte of the names of its mailboxes.
    pub system: u8,
    /// Which of `nodes` it runs on.
    pub own: NodeIndex,
    /// All nodes, in the order of the configuration; 255 at most.
    pub nodes: Vec<NodeSettings>,
    /// What must be equal on both ends of a wire.
    pub digest: u64,
    /// Tells this life of the router from its others; not 0, and never the same again.
    pub incarnation: u64,
    /// Largest datagram, as UDP's payload.
    pub datagram_bytes_max: usize,
    /// Bytes that a datagram takes on the wire besides its own: IP, UDP and Ethernet.
    pub overhead_bytes: usize,
    /// What may leave, wire bytes a second; not 0.
    pub rate_bytes_s: u64,
    /// What one sender may have waiting, heads included.
    pub quota_bytes: usize,
    /// Classes below this id are not real time.
    pub bulk_below: u8,
    /// Where names are that are not on this node; sorted, without overlap.
    pub routes: Vec<Route>,
    /// The modules of this node: each group has a quota, all other names have one together.
    pub senders: Vec<Vec<Name>>,
}

/// A node, as others see it.
#[derive(Clone, Debug)]
pub struct NodeSettings {
    /// Its name in the configuration.
    pub name: String,
    /// Where its datagrams come from and go to.
    pub address: IpAddr,
}

/// Names that are on another node: from `first` to `last`, both included, by their numbers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Route {
    /// The lowest.
    pub first: Name,
    /// The highest.
    pub last: Name,
    /// The node.
    pub node: NodeIndex,
}

impl Settings {
    /// Bytes of a datagram on Ethernet that are not UDP's payload: preamble, head, check and gap of the frame (38), IP and UDP.
    pub fn overhead_bytes(address: IpAddr) -> usize {
        if address.is_ipv4() { 38 + 20 + 8 } else { 38 + 40 + 8 }
    }

    /// The level of a priority: two to each value of the highest four bits, which are what counts on the wire (seed 002, 4.2);
    /// the even ones are in use.
    pub fn level(&self, priority: Priority) -> u8 {
        if priority.0 < self.bulk_below { LEVELS as u8 - 1 } else { (15 - (priority.0 >> 4)) * 2 }
    }

    /// The node that a name is on; none for names of this node and for those that nobody has.
    pub fn node_of(&self, name: Name) -> Option<NodeIndex> {
        let after = self.routes.partition_point(|route| route.first <= name);
        let route = self.routes.get(after.checked_sub(1)?)?;
        (name <= route.last).then_some(route.node)
    }

    /// The nodes besides this one.
    pub fn peers(&self) -> impl Iterator<Item = NodeIndex> {
        (0..self.nodes.len() as NodeIndex).filter(|node| *node != self.own)
    }

    /// The node with an address.
    pub fn node_at(&self, address: IpAddr) -> Option<NodeIndex> {
        self.nodes.iter().position(|node| node.address == address).map(|index| index as NodeIndex)
    }
}
