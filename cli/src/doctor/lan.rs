//! The network between the nodes of a configuration, as one of them sees it.

use std::net::IpAddr;

/// The network of a node, as its configuration has it and as this computer sees it.
#[derive(Clone, Debug)]
pub(super) struct LanView {
    pub(super) node: String,
    pub(super) address: IpAddr,
    pub(super) mtu: u16,
    /// Whether this computer has the address.
    pub(super) is_here: bool,
    /// The addresses that it has, and on which device.
    pub(super) addresses: Vec<(String, IpAddr)>,
    /// That of packages, that of time, and without time slots that of packages that are not real time.
    pub(super) ports: Vec<Port>,
    /// A router of this node runs here.
    pub(super) runs: bool,
    pub(super) stamps: Stamps,
    pub(super) peers: Vec<PeerNode>,
}

/// A port that a router needs.
#[derive(Clone, Debug)]
pub(super) struct Port {
    pub(super) number: u16,
    pub(super) state: PortState,
}

/// Whether a port can be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum PortState {
    Free,
    InUse,
    /// Not known, since the address is not here.
    Unknown,
    Refused(String),
}

/// Which times of datagrams the kernel tells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Stamps {
    Both,
    /// Not those of leaving.
    NoSent,
    None(String),
    /// There was no peer to send anything to.
    Unknown,
}

/// Another node.
#[derive(Clone, Debug)]
pub(super) struct PeerNode {
    pub(super) name: String,
    pub(super) address: IpAddr,
    /// Largest packet on the way there, as far as this computer knows.
    pub(super) mtu: Option<u32>,
    pub(super) reach: Reach,
}

/// What came back from a peer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// It is there, and nobody has its port.
    NoRouter,
    /// It is there; its router, if that was it, answers nobody who says nothing.
    Neighbour,
    /// Nothing.
    Silent,
    /// The system sends nothing there.
    NoWay(String),
}
