//! Settings of a router: its node, the other nodes, and its share of the wire.
//!
//! They come from an installation and the name of a node; a test or a simulation makes them from plain values.

use crate::admission::{Admission, ArrivalPath, capped};
use crate::counts::Cause;
use crate::flows::Flow;
use crate::frame::{self, FRAGMENT_HEAD_BYTES, NodeIndex, PARTS_MAX};
use crate::moving::MovingNames;
use crate::tdma::{LATE_NS, Wire};
use rohrpost_config::Installation;
use rohrpost_mailbox::{BODY_BYTES_MAX, HEAD_BYTES, Head, Name};
use rohrpost_network::{Network, Route, Security, Tdma};
use std::net::IpAddr;
use std::sync::Arc;

/// Least quota of a sender: two of the largest packages.
pub const QUOTA_BYTES_MIN: usize = 128 * 1024;
/// The smallest datagram that carries a package of any size in fragments.
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

/// One router, and its network.
#[derive(Clone, Debug)]
pub struct Settings {
    /// First byte of the names of its mailboxes.
    pub system: u8,
    /// Its node among `nodes`.
    pub own: NodeIndex,
    /// All nodes of the LAN, in the order of the configuration; [`NODES_MAX`](rohrpost_network::NODES_MAX) at most.
    pub nodes: Vec<NodeSettings>,
    /// Digest of the configuration; equal on all nodes.
    pub digest: u64,
    /// Distinguishes this incarnation of the router from its others; not 0, and never reused.
    pub incarnation: u64,
    /// How it sends.
    pub network: Network,
    /// Time slots; none: it sends as packages come.
    pub tdma: Option<Tdma>,
    /// The node of each name that is not on this node; sorted, without overlap.
    pub routes: Vec<Route>,
    /// Names that move from node to node with their module; not among `routes`.
    pub moving: Arc<MovingNames>,
    /// The modules of this node: the names of a group share a quota, and so do all other names.
    pub senders: Vec<Vec<Name>>,
    /// The names of this node, with all their mailboxes, as ranges that do not overlap: packages from others to other
    /// names are dropped.
    pub hosts: Vec<(Name, Name)>,
    /// Rules for packages from other nodes.
    pub admission: Admission,
    /// Measured flows that leave this node.
    pub flows: Vec<Flow>,
    /// Packages of lower priority are not real time. Without time slots they have threads of their own, with the
    /// modules' scheduling, and a port of their own. 0: all are real time.
    pub real_time_from: u16,
}

/// A node, as others see it.
#[derive(Clone, Debug)]
pub struct NodeSettings {
    /// Its name in the configuration.
    pub name: String,
    /// Source and destination of its datagrams.
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
        // Of several nodes on a LAN each has an address: configuration checks that.
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
            moving: Arc::new(MovingNames::new(installation.moving_names(), installation.lan_nodes().len())),
            senders: installation.modules_on(node).map(|module| module.names().collect()).collect(),
            hosts: installation.names_on(node),
            admission: Admission::new(installation, node),
            flows: Flow::all_from(installation, node),
            real_time_from: installation.real_time_from(),
        })
    }

    /// Bytes around each datagram: IP, UDP and the seal; the rate includes them.
    pub fn overhead_bytes(&self) -> usize {
        let is_v6 = self.nodes.iter().any(|node| node.address.is_ipv6());
        Network::around_bytes(is_v6, self.network.security)
    }

    /// Whether packages that are not real time have threads and a port of their own. In time slots all packages share
    /// one path, by level.
    pub fn parts_rest(&self) -> bool {
        self.tdma.is_none() && self.real_time_from > 0
    }

    /// Whether a package with this head takes that path.
    pub fn is_rest(&self, head: &Head) -> bool {
        self.parts_rest() && u16::from(capped(head).priority.0) < self.real_time_from
    }

    /// Whether datagrams between nodes are sealed.
    pub fn is_sealed(&self) -> bool {
        self.network.security == Security::Keys
    }

    /// The longest datagram of this node. It fits into each of its time slots, even if the thread is as late as
    /// allowed: so each slot can carry the most important package.
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

    /// The node of a name; none for names of this node and for unknown ones.
    pub fn node_of(&self, name: Name) -> Option<NodeIndex> {
        if let Some(node) = self.moving.node_of(name) {
            return node.filter(|node| *node != self.own);
        }
        let after = self.routes.partition_point(|route| route.first <= name);
        let route = self.routes.get(after.checked_sub(1)?)?;
        (name <= route.last).then_some(route.node)
    }

    /// Why a package of a node is refused, whatever its mailbox allows. A right seal proves the sending node, and a
    /// node may send from its own names alone. Without seals anybody can claim to be any node; but what comes from a
    /// node where a moving name is no more is late, whatever it claims.
    pub fn refuses(&self, node: NodeIndex, head: &Head, body: &[u8]) -> Option<Cause> {
        let may_lie = !self.is_sealed() && self.moving.node_of(head.from).is_none();
        let is_its_name = may_lie || self.node_of(head.from) == Some(node);
        self.admission.validate(ArrivalPath::Lan { node, is_its_name }, head, body).err().map(Cause::from)
    }

    /// The nodes besides this one.
    pub fn peers(&self) -> impl Iterator<Item = NodeIndex> {
        (0..self.nodes.len() as NodeIndex).filter(|node| *node != self.own)
    }

    /// Source addresses of the others.
    pub fn peer_addresses(&self) -> Vec<IpAddr> {
        self.peers().map(|peer| self.nodes[usize::from(peer)].address).collect()
    }

    /// The node with an address.
    pub fn node_at(&self, address: IpAddr) -> Option<NodeIndex> {
        self.nodes.iter().position(|node| node.address == address).map(|index| index as NodeIndex)
    }
}
