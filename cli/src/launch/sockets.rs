//! Launch owns the sockets of a node's router: while a dead router is restarted, datagrams of peers wait in the kernel
//! for the next one.

use rohrpost_config::{Installation, Module, Replica};
use std::os::fd::OwnedFd;
use std::sync::Arc;

/// What launch keeps for a node's modules: the sockets of its router.
pub(super) fn of(installation: Arc<Installation>, node: String) -> impl Fn(&Module) -> Vec<OwnedFd> {
    move |module| {
        let network = installation.network.filter(|_| installation.router_of(&node) == Some(module.name));
        let address = installation.node(&node).and_then(|node| node.address);
        let (Some(network), Some(address)) = (network, address) else { return Vec::new() };
        let others = installation.lan_nodes().iter().filter(|other| other.name != node);
        let peers: Vec<_> = others.filter_map(|other| other.address).collect();
        // Also where a stream is written: parts of it are asked for again.
        let is_end =
            |replica: &Replica| replica.to.contains(&node) || installation.node_of(replica.from) == Some(node.as_str());
        let replicas = installation.replica_port().filter(|_| installation.replicas.iter().any(is_end));
        rohrpost_routers::shell::listen(address, (network.port, [installation.rest_port(), replicas]), &peers)
    }
}
