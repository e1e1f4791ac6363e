//! What routers of a simulated network are configured with.

use crate::access::Access;
use crate::frame::NodeIndex;
use crate::settings::{NodeSettings, Settings};
use crate::sim::plan::{Plan, SYSTEM};
use rohrpost_config::{Network, Route, Security};
use std::net::{IpAddr, Ipv4Addr};

/// Of the configuration.
pub(in crate::sim) const DIGEST: u64 = 0x1234_5678;

/// Address of a node.
pub fn address(node: usize) -> IpAddr {
    IpAddr::V4(Ipv4Addr::new(10, 77, 0, node as u8 + 1))
}

/// What one life of a router is configured with.
pub fn settings(plan: &Plan, node: usize, incarnation: u64) -> Settings {
    let others = plan.nodes.iter().enumerate().filter(|(other, _)| *other != node);
    let mut routes: Vec<Route> = others
        .flat_map(|(index, other)| other.modules.iter().map(move |module| (index, *module)))
        .map(|(index, module)| Route { first: module, last: module.with_local(u8::MAX), node: index as NodeIndex })
        .collect();
    routes.sort_unstable_by_key(|route| route.first);
    let nodes = (0..plan.nodes.len()).map(|index| NodeSettings { name: format!("n{index}"), address: address(index) });
    Settings {
        system: SYSTEM,
        own: node as NodeIndex,
        nodes: nodes.collect(),
        digest: DIGEST,
        incarnation,
        network: Network {
            security: if plan.sealed { Security::Keys } else { Security::None },
            datagram_bytes_max: plan.shape.datagram_bytes_max,
            rate_bytes_s: plan.shape.rate_bytes_s,
            quota_bytes: plan.shape.quota_bytes,
            bulk_below: plan.shape.bulk_below,
            port: 21117,
            mtu: u16::MAX,
        },
        tdma: plan.slots.as_ref().map(|slots| slots.table.clone()),
        routes,
        senders: plan.nodes[node].modules.iter().map(|module| vec![*module]).collect(),
        access: Access::default(),
        flows: Vec::new(),
    }
}
