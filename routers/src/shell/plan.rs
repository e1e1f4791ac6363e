//! What an installation says to the router of one of its nodes.

use crate::settings::{NodeSettings, Route, Settings};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, local};
use std::net::SocketAddr;

/// The settings of a node's router, and where it takes packages; none if there is one node only, or no such node. `incarnation`
/// tells this life of the router from its others.
pub fn plan(installation: &Installation, node: &str, incarnation: u64) -> Option<(Settings, SocketAddr)> {
    let network = installation.network?;
    let own = installation.node_index(node)?;
    let addressed =
        |node: &rohrpost_config::Node| Some(NodeSettings { name: node.name.clone(), address: node.address? });
    let nodes = installation.nodes.iter().map(addressed).collect::<Option<Vec<_>>>()?;
    let address = nodes[usize::from(own)].address;
    let route = |route: rohrpost_config::Route| Route { first: route.first, last: route.last, node: route.node };
    let settings = Settings {
        system: installation.system.id,
        own,
        nodes,
        digest: installation.digest().lan(),
        incarnation: incarnation.max(1),
        datagram_bytes_max: network.datagram_bytes_max,
        overhead_bytes: Settings::overhead_bytes(address),
        rate_bytes_s: network.rate_bytes_s,
        quota_bytes: network.quota_bytes,
        bulk_below: network.bulk_below,
        routes: installation.routes_from(node).into_iter().map(route).collect(),
        senders: installation.modules_on(node).map(|module| module.names().collect()).collect(),
    };
    Some((settings, (address, network.port).into()))
}

/// The ranges of names that lie on other nodes, as the mailboxes of a node want them; neighbours become one.
pub(super) fn ranges(routes: &[Route]) -> Vec<(Name, Name)> {
    let mut ranges: Vec<(Name, Name)> = Vec::new();
    for route in routes {
        match ranges.last_mut() {
            Some(last) if last.1.raw().checked_add(1) == Some(route.first.raw()) => last.1 = route.last,
            _ => ranges.push((route.first, route.last)),
        }
    }
    ranges
}

/// The mailbox of a router, by the router's name.
pub(super) fn transit(router: Name) -> Name {
    router.with_local(local::TRANSIT)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_ranges_become_one() {
        let name = |instance, local| Name::new(1, 9, instance, local);
        let route = |instance, node| Route { first: name(instance, 0), last: name(instance, 255), node };
        let routes = [route(0, 1), route(1, 2), route(3, 1)];
        assert_eq!(ranges(&routes), [(name(0, 0), name(1, 255)), (name(3, 0), name(3, 255))]);
        assert_eq!(ranges(&[]), []);
    }
}
