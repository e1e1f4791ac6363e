//! What a router knows before the first datagram: who it is, who the others are, and how much of the wire is its.
//!
//! Comes from an installation and the name of a node; a test or a simulation makes one from plain values.

use crate::admission::{Admission, ArrivalPath, capped};
use crate::counts::Cause;
use crate::flows::Flow;
use crate::frame::{self, FRAGMENT_HEAD_BYTES, NodeIndex, PARTS_MAX};
use crate::tdma::{LATE_NS, Wire};
use rohrpost_config::Installation;
use rohrpost_mailbox::{BODY_BYTES_MAX, HEAD_BYTES, Head, Name};
use rohrpost_network::{Network, Route, Security, Tdma};
use std::net::IpAddr;

/// Least that a sender may have waiting: two of the largest packages.
pub const QUOTA_BYTES_MIN: usize = 128 * 1024;
/// The smallest datagram that a package of any size goes into, in parts.
pub const DATAGRAM_BYTES_MIN: usize = 528;

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
    /// All nodes of the LAN, in the order of the configuration; [`NODES_MAX`](rohrpost_network::NODES_MAX) at most.
    pub nodes: Vec<NodeSettings>,
    /// What must be equal on both ends of a wire.
    pub digest: u64,
    /// Tells this incarnation of the router from its others; not 0, and never the same again.
    pub incarnation: u64,
    /// How it sends.
    pub network: Network,
    /// When it sends; none: as packages come.
    pub tdma: Option<Tdma>,
    /// Where names are that are not on this node; sorted, without overlap.
    pub routes: Vec<Route>,
    /// The modules of this node: the names of a group have a quota together, and so have all other names.
    pub senders: Vec<Vec<Name>>,
    /// The names of this node, with all their mailboxes, as ranges that do not overlap: what others send to no other name is delivered.
    pub hosts: Vec<(Name, Name)>,
    /// What is admitted of what comes from other nodes.
    pub admission: Admission,
    /// Declared flows that leave this node, to be measured.
    pub flows: Vec<Flow>,
    /// Packages of lower priority are not real time: without time slots, threads that are scheduled as their modules carry them, by a port
    /// of their own. 0: all are.
    pub real_time_from: u16,
}

/// A node, as others see it.
#[derive(Clone, Debug)]
pub struct NodeSettings {
    /// Its name in the configuration.
    pub name: String,
    /// Where its datagrams come from and go to.
    pub address: IpAddr,
}

/// Why there is no router for a node.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SettingsError {
    /// There is one node on the LAN.
    #[error("the installation has one node on the LAN, so it needs no router; add the other nodes and `[network]`")]
    OneNode,
    /// There is no such node on the LAN.
    #[error("the installation has no node `{0}` on the LAN; there it has {1}")]
    NoNode(String, String),
}

impl Settings {
    /// The router of a node. `incarnation`: never the same for two incarnations of it; not 0.
    ///
    /// # Errors
    /// [`SettingsError`]
    pub fn new(installation: &Installation, node: &str, incarnation: u64) -> Result<Self, SettingsError> {
        let network = installation.network.ok_or(SettingsError::OneNode)?;
        let Some(own) = installation.lan_index(node) else {
            let known: Vec<_> = installation.lan_nodes().iter().map(|node| format!("`{}`", node.name)).collect();
            return Err(SettingsError::NoNode(node.into(), known.join(", ")));
        };
        // Of several nodes on a LAN each has an address: configuration sees to it.
        let address = |address: Option<IpAddr>| address.unwrap_or(IpAddr::V4(std::net::Ipv4Addr::UNSPECIFIED));
        let nodes = installation.lan_nodes().iter();
        Ok(Self {
            system: installation.system.id,
            own,
            nodes: nodes.map(|node| NodeSettings { name: node.name.clone(), address: address(node.address) }).collect(),
            digest: installation.digest().lan(),
            incarnation,
            network,
            tdma: installation.tdma.clone(),
            routes: installation.routes_from(node),
            senders: installation.modules_on(node).map(|module| module.names().collect()).collect(),
            hosts: installation.names_on(node),
            admission: Admission::new(installation, node),
            flows: Flow::all_from(installation, node),
            real_time_from: installation.real_time_from(),
        })
    }

    /// Bytes around each datagram, of IP and UDP and of what seals it; the rate counts them.
    pub fn overhead_bytes(&self) -> usize {
        let is_v6 = self.nodes.iter().any(|node| node.address.is_ipv6());
        Network::around_bytes(is_v6, self.network.security)
    }

    /// Whether what is not real time goes by threads and a port of its own. In time slots all goes through these, by its level.
    pub fn parts_rest(&self) -> bool {
        self.tdma.is_none() && self.real_time_from > 0
    }

    /// Whether a package of this head goes that way.
    pub fn is_rest(&self, head: &Head) -> bool {
        self.parts_rest() && u16::from(capped(head).priority.0) < self.real_time_from
    }

    /// Whether what passes between nodes is sealed.
    pub fn is_sealed(&self) -> bool {
        self.network.security == Security::Keys
    }

    /// The longest datagram that this node sends. Where it has time slots, it fits into each of them, also if the thread comes as late
    /// as it may: so each of them serves whatever is most important.
    pub fn datagram_bytes(&self) -> usize {
        let Some(tdma) = &self.tdma else { return self.network.datagram_bytes_max };
        let wire = Wire::new(tdma, self.overhead_bytes());
        let own = tdma.slots.iter().filter(|slot| slot.node == self.own);
        let rooms = own.map(|slot| {
            let length_ns = slot.length.saturating_sub(tdma.guard).as_nanos().saturating_sub(LATE_NS.into());
            wire.datagram_bytes_in(u64::try_from(length_ns).unwrap_or(u64::MAX)).unwrap_or(0)
        });
        let smallest = rooms.min().unwrap_or(usize::MAX).max(DATAGRAM_BYTES_MIN);
        smallest.min(self.network.datagram_bytes_max)
    }

    /// The node that a name is on; none for names of this node and for those that nobody has.
    pub fn node_of(&self, name: Name) -> Option<NodeIndex> {
        let after = self.routes.partition_point(|route| route.first <= name);
        let route = self.routes.get(after.checked_sub(1)?)?;
        (name <= route.last).then_some(route.node)
    }

    /// Why a package of a node is not to be delivered, whatever its mailbox says. That a seal is right says which node has sent it, so a
    /// node speaks for its own names alone; without seals anyone may say that.
    pub fn refuses(&self, node: NodeIndex, head: &Head, body: &[u8]) -> Option<Cause> {
        let is_its_name = !self.is_sealed() || self.node_of(head.from) == Some(node);
        self.admission.validate(ArrivalPath::Lan { node, is_its_name }, head, body).err().map(Cause::from)
    }

    /// The nodes besides this one.
    pub fn peers(&self) -> impl Iterator<Item = NodeIndex> {
        (0..self.nodes.len() as NodeIndex).filter(|node| *node != self.own)
    }

    /// Where datagrams of the others come from.
    pub fn peer_addresses(&self) -> Vec<IpAddr> {
        self.peers().map(|peer| self.nodes[usize::from(peer)].address).collect()
    }

    /// The node with an address.
    pub fn node_at(&self, address: IpAddr) -> Option<NodeIndex> {
        self.nodes.iter().position(|node| node.address == address).map(|index| index as NodeIndex)
    }
}
