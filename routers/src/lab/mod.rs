//! A network of several nodes on one computer: a network namespace for each, joined by a bridge.
//!
//! ```text
//!  namespace of `base`        namespace of the hub         namespace of `desk`
//!   lan 10.77.0.1 ────veth──── n0 ──┬── bridge ──┬── n1 ────veth──── lan 10.77.0.2
//! ```
//!
//! No namespace has a name, so there is nothing to clean up: they and all devices in them vanish with the last process
//! and the last descriptor that hold them, however those end. Nothing in a namespace sees the computer's own network.
//!
//! A thread goes into the namespace of a node ([`Lab::enter`]) and comes out again; sockets that it makes and processes
//! that it starts meanwhile stay in. A process without root's rights goes into a user namespace first
//! ([`become_able`]).

mod beyond;
mod capture;
mod error;
mod namespace;

pub use capture::{Capture, Crossing};
pub use error::LabError;
pub use namespace::{Inside, become_able};

use crate::netlink::{DeviceIndex, VethEnd};
use error::RUNS_WITHIN;
use namespace::Namespace;
use std::io;
use std::net::IpAddr;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// The device of each node.
pub const DEVICE: &str = "lan";

/// Numbers of devices, which each namespace counts for itself.
const LOOPBACK: DeviceIndex = 1;
const LAN: DeviceIndex = 2;
const BRIDGE: DeviceIndex = 2;
const FIRST_PORT: DeviceIndex = 3;
const LOOK: Duration = Duration::from_millis(2);

/// A node of a lab.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct NodeSpec {
    /// What [`Lab::enter`] and the others call it.
    pub name: String,
    /// Its address; those of all nodes are of one kind.
    pub address: IpAddr,
}

/// Nodes in namespaces. Dropping it, and ending all that runs in it, removes everything.
#[derive(Debug)]
pub struct Lab {
    nodes: Vec<Node>,
    hub: Namespace,
    /// Largest packet of all links at first, bytes.
    mtu: u32,
}

#[derive(Debug)]
struct Node {
    spec: NodeSpec,
    namespace: Namespace,
    /// Its end of the link, in the hub.
    port: DeviceIndex,
}

impl Lab {
    /// Makes namespaces and joins them; when this returns, every node reaches every other. `mtu` is that of all links,
    /// in bytes.
    ///
    /// # Errors
    /// When the system does not allow it, or lacks a part.
    pub fn new(nodes: &[NodeSpec], mtu: u16) -> Result<Self, LabError> {
        let hub = Namespace::new()?;
        let node = |(spec, port): (&NodeSpec, DeviceIndex)| {
            Ok(Node { spec: spec.clone(), namespace: Namespace::new()?, port })
        };
        let nodes = nodes.iter().zip(FIRST_PORT..).map(node).collect::<Result<Vec<_>, LabError>>()?;
        let lab = Self { nodes, hub, mtu: mtu.into() };
        lab.join()?;
        for node in &lab.nodes {
            lab.wait_until_it_runs(node)?;
        }
        Ok(lab)
    }

    fn join(&self) -> Result<(), LabError> {
        let mtu = self.mtu;
        let mut hub = self.hub.netlink()?;
        told("make a bridge", hub.add_bridge(BRIDGE, "bridge", mtu))?;
        told("set the bridge up", hub.set_up(BRIDGE, true))?;
        for (index, node) in self.nodes.iter().enumerate() {
            let (name, at) = (format!("n{index}"), &node.spec.name);
            let (own, far) = (VethEnd { device: node.port, name: &name }, VethEnd { device: LAN, name: DEVICE });
            told(&format!("make the link of {at}"), hub.add_veth(own, BRIDGE, far, &node.namespace, mtu))?;
            told(&format!("set the link of {at} up"), hub.set_up(node.port, true))?;
            self.set_up(node, node.spec.address)?;
        }
        Ok(())
    }

    /// Its nodes.
    pub fn nodes(&self) -> impl Iterator<Item = &NodeSpec> {
        self.nodes.iter().map(|node| &node.spec)
    }

    /// Takes this thread into the namespace of a node, until what is returned is dropped. Sockets that it makes and
    /// processes and threads that it starts meanwhile stay there.
    ///
    /// # Errors
    /// [`LabError::NoNode`], or when the system does not allow it.
    pub fn enter(&self, node: &str) -> Result<Inside, LabError> {
        self.node(node)?.namespace.enter()
    }

    /// Takes this thread to the bridge, which all frames between nodes cross: a packet socket made there sees each when
    /// it comes in by the port of its sender. As [`Lab::enter`].
    ///
    /// # Errors
    /// When the system does not allow it.
    pub fn enter_bridge(&self) -> Result<Inside, LabError> {
        self.hub.enter()
    }

    /// Starts a program on a node. Its parent is this thread: what it asks to be told of its parent's death, it is told
    /// of this thread's.
    ///
    /// # Errors
    /// [`LabError::NoNode`], or when it cannot be started.
    pub fn command(&self, node: &str, command: &mut Command) -> Result<Child, LabError> {
        let _inside = self.enter(node)?;
        command.spawn().map_err(|error| LabError::Start(command.get_program().to_string_lossy().into(), error))
    }

    /// Cuts a node off, as if its cable was pulled out.
    ///
    /// # Errors
    /// [`LabError::NoNode`], or when the system does not allow it.
    pub fn cut(&self, node: &str) -> Result<(), LabError> {
        let node = self.node(node)?;
        told(&format!("cut {} off", node.spec.name), self.hub.netlink()?.set_up(node.port, false))
    }

    /// Puts the cable in again; when this returns, packets pass.
    ///
    /// # Errors
    /// As for [`Lab::cut`]; [`LabError::NoCarrier`].
    pub fn fix(&self, node: &str) -> Result<(), LabError> {
        let node = self.node(node)?;
        told(&format!("join {} again", node.spec.name), self.hub.netlink()?.set_up(node.port, true))?;
        self.wait_until_it_runs(node)
    }

    /// Divides the network: these nodes reach each other, and so do the others, but none of these any of those.
    /// [`Lab::capture`] sees both parts. A node that was separated before stays separated, until [`Lab::unite`].
    ///
    /// # Errors
    /// As for [`Lab::cut`].
    pub fn divide(&self, nodes: &[&str]) -> Result<(), LabError> {
        let (mut hub, second) = (self.hub.netlink()?, FIRST_PORT + self.nodes.len() as DeviceIndex);
        match hub.add_bridge(second, "second", self.mtu) {
            // Of an earlier division.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            made => told("make a second bridge", made)?,
        }
        told("set the second bridge up", hub.set_up(second, true))?;
        self.move_to(nodes, second)
    }

    /// Joins again what [`Lab::divide`] divided.
    ///
    /// # Errors
    /// As for [`Lab::cut`].
    pub fn unite(&self, nodes: &[&str]) -> Result<(), LabError> {
        self.move_to(nodes, BRIDGE)
    }

    fn move_to(&self, nodes: &[&str], bridge: DeviceIndex) -> Result<(), LabError> {
        let mut hub = self.hub.netlink()?;
        for name in nodes {
            let node = self.node(name)?;
            told(&format!("move {name} to another bridge"), hub.set_bridge(node.port, bridge))?;
            self.wait_until_it_runs(node)?;
        }
        Ok(())
    }

    /// Changes the largest packet of a node's link, at both ends, in bytes.
    ///
    /// # Errors
    /// As for [`Lab::cut`].
    pub fn set_mtu(&self, node: &str, mtu: u16) -> Result<(), LabError> {
        let node = self.node(node)?;
        let what = format!("change the MTU of {}", node.spec.name);
        told(&what, self.hub.netlink()?.set_mtu(node.port, mtu.into()))?;
        told(&what, node.namespace.netlink()?.set_mtu(LAN, mtu.into()))
    }

    fn node(&self, name: &str) -> Result<&Node, LabError> {
        self.nodes.iter().find(|node| node.spec.name == name).ok_or_else(|| {
            let names: Vec<&str> = self.nodes().map(|node| node.name.as_str()).collect();
            LabError::NoNode(name.into(), names.join(", "))
        })
    }

    /// The kernel tells its devices a little later that a link works; what is sent before is lost.
    fn wait_until_it_runs(&self, node: &Node) -> Result<(), LabError> {
        let deadline = Instant::now() + RUNS_WITHIN;
        let (mut hub, mut inside) = (self.hub.netlink()?, node.namespace.netlink()?);
        let what = format!("look at the link of {}", node.spec.name);
        loop {
            let runs = [hub.runs(node.port), hub.runs(BRIDGE), inside.runs(LAN)];
            let runs = runs.into_iter().collect::<io::Result<Vec<bool>>>();
            if told(&what, runs)?.into_iter().all(|runs| runs) {
                return Ok(());
            }
            if Instant::now() >= deadline {
                return Err(LabError::NoCarrier(node.spec.name.clone()));
            }
            std::thread::sleep(LOOK);
        }
    }
}

fn told<T>(what: &str, result: io::Result<T>) -> Result<T, LabError> {
    result.map_err(|error| LabError::Device(what.into(), error))
}
