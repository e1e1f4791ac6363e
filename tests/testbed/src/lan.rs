//! Nodes of a LAN with real routers: their names, settings and slots, and namespaces and processes for them.

use crate::report;
use rohrpost_mailbox::Name;
use rohrpost_network::{Network, Route, Security, Tdma, TimeSlot};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::frame::{Alive, FrameHead, NodeIndex};
pub use rohrpost_routers::lab::Lab;
use rohrpost_routers::lab::{LabError, NodeSpec};
use rohrpost_routers::settings::{NodeSettings, Settings};
use std::net::IpAddr;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// The module of a node; its mailboxes take what the others send.
pub fn module(node: NodeIndex) -> Name {
    Name::new(1, 100, node, 0)
}

/// The router of a node.
pub fn router(node: NodeIndex) -> Name {
    Name::new(1, 250, node, 0)
}

/// Settings of a router among nodes with these addresses, each with a module.
pub fn settings(own: NodeIndex, addresses: &[IpAddr], tdma: Option<Tdma>) -> Settings {
    let nodes = specs(addresses).into_iter().map(|NodeSpec { name, address }| NodeSettings { name, address });
    let others = || (0..addresses.len() as NodeIndex).filter(|node| *node != own);
    let route = |name: Name| Route { first: name, last: name.with_local(u8::MAX), node: name.instance() };
    let tunnel = tdma.as_ref().and_then(|tdma| tdma.tunnel);
    Settings {
        system: 1,
        own,
        nodes: nodes.collect(),
        digest: 7,
        incarnation: 1,
        network: Network {
            security: Security::None,
            port: 21_117,
            mtu: 1500,
            datagram_bytes_max: 1472,
            rate_bytes_s: 1 << 30,
            quota_bytes: 1 << 20,
            bulk_below: 16,
        },
        tdma,
        routes: others().map(module).chain(others().map(router)).map(route).collect(),
        senders: vec![vec![module(own)]],
        moving: Default::default(),
        hosts: [module(own), router(own)].map(|name| (name, name.with_local(u8::MAX))).into(),
        admission: Admission {
            router: Some(router(own).class()),
            tunnel: tunnel.map(|tunnel| (tunnel, own)),
            ..Admission::default()
        },
        real_time_from: 0,
        flows: Vec::new(),
    }
}

/// A slot for each node, one every 2 ms from the first on, on a wire of 1 Gbit/s. `lengths_us`: of the cycle, and of a
/// slot.
pub fn slots(nodes: NodeIndex, first_us: u64, [cycle_us, length_us]: [u64; 2]) -> Tdma {
    let us = Duration::from_micros;
    let offset = |node| us(first_us + 2000 * u64::from(node));
    let slot = |node| TimeSlot { node, offset: offset(node), length: us(length_us), period: 1, phase: 0 };
    Tdma {
        cycle: us(cycle_us),
        synchronisation: us(1000),
        guard: us(400),
        link_bytes_s: 125_000_000,
        slots: (0..nodes).map(slot).collect(),
        tunnel: None,
    }
}

/// "Still there", with this head, from a router that hears nobody.
pub fn alive(head: FrameHead) -> Vec<u8> {
    let alive = Alive::default().to_bytes();
    [&head.to_bytes(&[&alive])[..], &alive].concat()
}

/// A process that is killed when this is dropped.
pub struct Killed(pub Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// One test of this program, as a process of its own with this variable in its environment.
pub fn role(test: &str, variable: &str, value: &str) -> Command {
    let program = std::env::current_exe().unwrap_or_else(|error| panic!("this program: {error}"));
    let mut command = Command::new(program);
    command.args(["--exact", test, "--nocapture", "--test-threads=1"]).env(variable, value);
    command.stdin(Stdio::null()).stdout(Stdio::null());
    command
}

/// Nodes `n0`, `n1` and so on with these addresses.
pub fn specs(addresses: &[IpAddr]) -> Vec<NodeSpec> {
    let spec = |(index, address): (usize, &IpAddr)| NodeSpec { name: format!("n{index}"), address: *address };
    addresses.iter().enumerate().map(spec).collect()
}

/// Namespaces for nodes, joined by links for packets of up to `mtu` bytes; none, and told, where they are not allowed.
///
/// # Panics
/// Panics if they are allowed, and cannot be made.
pub fn lab(nodes: &[NodeSpec], mtu: u16) -> Option<Lab> {
    match Lab::new(nodes, mtu) {
        Ok(lab) => Some(lab),
        Err(LabError::NotAllowed(error)) => {
            report::skipped(&format!("network namespaces ({error})"));
            None
        }
        Err(error) => panic!("{error}"),
    }
}
