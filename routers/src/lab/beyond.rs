//! Nodes that are not on the LAN, as a laptop in another network: a second bridge, which one node of the LAN is on as
//! well.
//!
//! ```text
//!  namespace of `base`              namespace of the hub                namespace of `desk`
//!   lan 10.77.0.1 ────veth──── n0 ──── bridge
//!   far 192.168.7.1 ──veth──── home ── far bridge ──── n2 ────veth──── lan 198.18.0.1
//! ```
//!
//! Nothing is forwarded between the bridges: a node beyond reaches that one node, and the others of the LAN only by
//! what runs there.

use super::namespace::Namespace;
use super::{DEVICE, FIRST_PORT, LAN, LOOPBACK, Lab, LabError, Node, NodeSpec, told};
use crate::netlink::{DeviceIndex, VethEnd};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// Above all ports of nodes.
const FAR_BRIDGE: DeviceIndex = 1000;
const HOME_PORT: DeviceIndex = FAR_BRIDGE + 1;
/// The second device of the node that is on both.
const FAR: DeviceIndex = LAN + 1;

impl Lab {
    /// Adds nodes that reach one node of the LAN, `home`, at this address and nothing else; so do its other nodes. To
    /// be called once in a lab.
    ///
    /// # Errors
    /// As for [`Lab::new`].
    pub fn join_beyond(&mut self, home: &str, address: IpAddr, names: &[&str]) -> Result<(), LabError> {
        let mut hub = self.hub.netlink()?;
        told("make the bridge of those beyond", hub.add_bridge(FAR_BRIDGE, "far", self.mtu))?;
        told("set it up", hub.set_up(FAR_BRIDGE, true))?;
        let first = self.nodes.len();
        for (name, index) in names.iter().zip(1..) {
            let port = FIRST_PORT + self.nodes.len() as DeviceIndex;
            let spec = NodeSpec { name: (*name).into(), address: far_address(address, index) };
            self.nodes.push(Node { spec, namespace: Namespace::new()?, port });
        }
        self.join_home(home, address, first)?;
        for index in first..self.nodes.len() {
            self.join_far(index)?;
        }
        self.nodes[first..].iter().try_for_each(|node| self.wait_until_it_runs(node))
    }

    /// The second link of a node of the LAN; those from `first` on are beyond.
    fn join_home(&self, name: &str, address: IpAddr, first: usize) -> Result<(), LabError> {
        let home = self.node(name)?;
        let (own, far) = (VethEnd { device: HOME_PORT, name: "home" }, VethEnd { device: FAR, name: "far" });
        let what = format!("join {name} to those beyond");
        let mut hub = self.hub.netlink()?;
        told(&what, hub.add_veth(own, FAR_BRIDGE, far, &home.namespace, self.mtu))?;
        told(&what, hub.set_up(HOME_PORT, true))?;
        let mut inside = home.namespace.netlink()?;
        // An address of the LAN is its own by both devices; of IPv6 each device must have it.
        if address != home.spec.address || address.is_ipv6() {
            told(&format!("give {name} the address {address}"), inside.add_address(FAR, address, None))?;
        }
        told(&what, inside.set_up(FAR, true))?;
        for node in &self.nodes[first..] {
            told(
                &format!("give {name} its route to {}", node.spec.name),
                inside.add_route(FAR, node.spec.address, None),
            )?;
        }
        let others = self.nodes[..first].iter().filter(|node| node.spec.name != name && address != home.spec.address);
        for node in others {
            let what = format!("give {} its route to {address}", node.spec.name);
            told(&what, node.namespace.netlink()?.add_route(LAN, address, Some(home.spec.address)))?;
        }
        Ok(())
    }

    fn join_far(&self, index: usize) -> Result<(), LabError> {
        let Node { spec: NodeSpec { name: at, address }, namespace, port } = &self.nodes[index];
        let name = format!("n{index}");
        let (own, far) = (VethEnd { device: *port, name: &name }, VethEnd { device: LAN, name: DEVICE });
        let mut hub = self.hub.netlink()?;
        told(&format!("make the link of {at}"), hub.add_veth(own, FAR_BRIDGE, far, namespace, self.mtu))?;
        told(&format!("set the link of {at} up"), hub.set_up(*port, true))?;
        self.set_up(&self.nodes[index], *address)
    }

    /// Gives a node its address, and takes its devices up.
    pub(super) fn set_up(&self, node: &Node, address: IpAddr) -> Result<(), LabError> {
        let (at, mut inside) = (&node.spec.name, node.namespace.netlink()?);
        told(&format!("set the loopback of {at} up"), inside.set_up(LOOPBACK, true))?;
        told(&format!("give {at} the address {address}"), inside.add_address(LAN, address, None))?;
        told(&format!("set the device of {at} up"), inside.set_up(LAN, true))?;
        told(&format!("give {at} its route"), inside.add_route_to_all(LAN, address))
    }
}

/// An address of the networks that are set aside for tests (RFC 2544, RFC 5180), so that no file has it.
fn far_address(like: IpAddr, index: u8) -> IpAddr {
    match like {
        IpAddr::V4(_) => Ipv4Addr::new(198, 18, 0, index).into(),
        IpAddr::V6(_) => Ipv6Addr::new(0x2001, 2, 0, 0, 0, 0, 0, index.into()).into(),
    }
}
