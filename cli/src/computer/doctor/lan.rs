//! The network between the nodes of a configuration, as one of them sees it.

use std::net::IpAddr;

/// A node's network in its configuration and on this computer.
#[derive(Clone, Debug)]
pub(super) struct LanView {
    pub(super) node: String,
    pub(super) address: IpAddr,
    pub(super) mtu: u16,
    /// Whether this computer has the address.
    pub(super) is_here: bool,
    /// This computer's addresses, with their devices.
    pub(super) addresses: Vec<(String, IpAddr)>,
    /// The ports for packages, for time and, without time slots, for packages that are not real time.
    pub(super) ports: Vec<Port>,
    /// A router of this node runs here.
    pub(super) runs: bool,
    pub(super) stamps: Stamps,
    pub(super) peers: Vec<PeerNode>,
}

#[derive(Clone, Debug)]
pub(super) struct Port {
    pub(super) what: &'static str,
    pub(super) number: u16,
    pub(super) state: PortState,
}

/// Whether a port is free.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum PortState {
    Free,
    InUse,
    /// Unknown, since this computer does not have the address.
    Unknown,
    Refused(String),
}

/// Which kernel time stamps datagrams get.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Stamps {
    Both,
    /// Only on reception, not on transmission.
    NoSent,
    None(String),
    /// There was no peer to send to.
    Unknown,
}

#[derive(Clone, Debug)]
pub(super) struct PeerNode {
    pub(super) name: String,
    pub(super) address: IpAddr,
    /// Path MTU, as far as this computer knows.
    pub(super) mtu: Option<u32>,
    pub(super) reach: Reach,
}

/// A peer's reaction to a probe.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// The computer answers, but no program has the port.
    NoRouter,
    /// The computer is there. If its router has the port, it does not answer an empty datagram.
    Neighbour,
    /// No reaction.
    Silent,
    /// The system cannot send there.
    NoWay(String),
}
