//! The socket of a node's router is launch's: what peers send while a router that died is started again waits in the kernel for the next one.

use rohrpost::config::{Installation, Module};
use std::net::SocketAddr;
use std::os::fd::OwnedFd;
use std::sync::Arc;

/// What launch keeps for the modules of a node: for its router, the socket by which that is reached.
pub(super) fn of(installation: Arc<Installation>, node: String) -> impl Fn(&Module) -> Option<OwnedFd> {
    move |module| {
        let network = installation.network.filter(|_| installation.router_of(&node) == Some(module.name))?;
        let address = installation.node(&node)?.address?;
        let others = installation.lan_nodes().iter().filter(|other| other.name != node);
        let peers: Vec<_> = others.filter_map(|other| other.address).collect();
        // Where it cannot be made now, each process of the router makes its own, or says why it cannot.
        rohrpost_routers::shell::listen(SocketAddr::new(address, network.port), &peers).ok()
    }
}
