//! The network: a namespace for each node and for two bystanders, joined by a bridge.

use crate::lan::junk::Junk;
use crate::lan::load::Load;
use crate::lan::udp::Datagrams;
use crate::lan::wire::failure;
use rohrpost_bench_local::Failure;
use rohrpost_routers::lab::{Lab, NodeSpec};
use std::net::{IpAddr, Ipv4Addr};

/// So many nodes send in slots.
pub const NODES: u8 = 3;
/// Of a current Ethernet.
const MTU: u16 = 1_500;
/// Of the bystanders' flood.
const FLOOD_PORT: u16 = 20_117;

/// A place on the network.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Place {
    /// The node with this index.
    Node(u8),
    /// The flooder, without slots.
    Flooder,
    /// The receiver of the flood.
    Swamp,
}

impl Place {
    const ALL: [Self; NODES as usize + 2] = [Self::Node(0), Self::Node(1), Self::Node(2), Self::Flooder, Self::Swamp];

    /// As the configuration calls a node.
    pub fn name(self) -> String {
        match self {
            Self::Node(index) => format!("n{index}"),
            Self::Flooder => "flooder".into(),
            Self::Swamp => "swamp".into(),
        }
    }

    /// Its address.
    pub fn address(self) -> IpAddr {
        let host = match self {
            Self::Node(index) => index + 1,
            Self::Flooder => 101,
            Self::Swamp => 102,
        };
        Ipv4Addr::new(10, 118, 0, host).into()
    }
}

/// Freed with the last process on it.
pub struct Stage {
    lab: Lab,
}

impl Stage {
    /// Makes it.
    ///
    /// # Errors
    /// [`Failure::Skipped`] when the system allows no namespaces.
    pub fn new() -> Result<Self, Failure> {
        let specs = Place::ALL.map(|place| NodeSpec { name: place.name(), address: place.address() });
        Lab::new(&specs, MTU).map(|lab| Self { lab }).map_err(failure)
    }

    /// Moves the calling process there for good.
    ///
    /// # Errors
    /// When it may not.
    pub fn enter(&self, place: Place) -> Result<(), Failure> {
        // Dropped, it would lead out again.
        self.lab.enter(&place.name()).map(std::mem::forget).map_err(failure)
    }

    /// Moves the calling process to the bridge for good.
    ///
    /// # Errors
    /// When it may not.
    pub fn enter_bridge(&self) -> Result<(), Failure> {
        self.lab.enter_bridge().map(std::mem::forget).map_err(failure)
    }

    /// Junk to ports of the last node, from an address that no node has.
    ///
    /// # Errors
    /// When there can be no further process, or no socket.
    pub fn junk(&self, ports: &[u16]) -> Result<Junk, Failure> {
        Junk::start(|| self.enter(Place::Flooder), Place::Node(NODES - 1).address(), ports)
    }

    /// Work on both processors, and a flood across the bridge from one bystander to the other.
    ///
    /// # Errors
    /// When there can be no further process.
    pub fn load(&self) -> Result<Load, Failure> {
        let open = |own: Place, other: Place| {
            self.enter(own)?;
            Datagrams::connect((own.address(), FLOOD_PORT).into(), (other.address(), FLOOD_PORT).into())
        };
        Load::start(|| open(Place::Flooder, Place::Swamp), || open(Place::Swamp, Place::Flooder))
    }
}
