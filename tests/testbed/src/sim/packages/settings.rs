//! What routers of a simulated network are configured with.

use crate::sim::plan::{Plan, SYSTEM};
use rohrpost_mailbox::{Class, Name};
use rohrpost_network::{Network, Route, Security, Tunnel};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::settings::{NodeSettings, Settings};
use std::net::{IpAddr, Ipv4Addr};

/// Of a configuration.
pub(in crate::sim) fn digest(edition: usize) -> u64 {
    const DIGEST: u64 = 0x1234_5678;
    // In no order.
    DIGEST.wrapping_mul(1 + edition as u64) & u64::MAX >> 1
}

/// Of routers; no module has it.
pub(in crate::sim) const ROUTER_CLASS: Class = Class(250);
const TUNNEL: Tunnel = Tunnel { network: Ipv4Addr::new(10, 78, 0, 0), prefix: 24 };

pub(crate) fn address(node: usize) -> IpAddr {
    IpAddr::V4(Ipv4Addr::new(10, 77, 0, node as u8 + 1))
}

/// What one incarnation of a router is configured with.
pub(crate) fn settings(plan: &Plan, node: usize, incarnation: u64, edition: usize) -> Settings {
    let others = plan.nodes.iter().enumerate().filter(|(other, _)| *other != node);
    let mut routes: Vec<Route> = others
        .flat_map(|(index, other)| {
            let router = Name::new(SYSTEM, ROUTER_CLASS.0, index as u8, 0);
            other.modules.iter().copied().chain([router]).map(move |module| (index, module))
        })
        .map(|(index, module)| Route { first: module, last: module.with_local(u8::MAX), node: index as NodeIndex })
        .collect();
    routes.sort_unstable_by_key(|route| route.first);
    let nodes = (0..plan.nodes.len()).map(|index| NodeSettings { name: format!("n{index}"), address: address(index) });
    Settings {
        system: SYSTEM,
        own: node as NodeIndex,
        nodes: nodes.collect(),
        digest: digest(edition),
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
        tdma: plan.slots_of(edition).map(|slots| slots.table.clone()),
        routes,
        senders: plan.nodes[node].modules.iter().map(|module| vec![*module]).collect(),
        moving: plan.leases.as_ref().map_or_else(Default::default, |leases| leases.moving[node].clone()),
        hosts: Vec::new(),
        admission: Admission {
            router: Some(ROUTER_CLASS),
            tunnel: Some((TUNNEL, node as NodeIndex)),
            ..Admission::default()
        },
        flows: Vec::new(),
        real_time_from: 0,
    }
}
