//! What the TCP router is made of, and why it cannot be.

use crate::session::server::{Names, ServerSettings};
use crate::shell::Faults;
use crate::tcp::replicas::LineParts;
use crate::tcp::seal::ServerSeal;
use rohrpost_mailbox::{Node, NodeError};
use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

/// Why the TCP router does not run.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Somebody is there.
    #[error(
        "{0} is in use: does the TCP router run already, or another program? Stop it, or choose another `port` in [tcp]"
    )]
    InUse(SocketAddr),
    /// It is another computer's address.
    #[error(
        "{0} is no address of this computer: let `server` of [tcp] name the node that has it, or correct `address` \
         (`ip addr` shows which there are)"
    )]
    NotHere(SocketAddr),
    /// The system says no for another reason.
    #[error("{1} for {0}: {2}")]
    Io(SocketAddr, &'static str, io::Error),
    /// The node's memory.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// The system has no thread for it.
    #[error("a thread of the TCP router: {0}; is the limit of processes reached (ulimit -u)?")]
    Thread(io::Error),
}

/// Parts of a server.
pub struct ServerParts<'a> {
    /// Where it listens.
    pub address: SocketAddr,
    /// What it knows.
    pub settings: ServerSettings,
    /// How commands are answered that cannot be handed on.
    pub faults: Arc<dyn Faults>,
    /// Its certificates; none: nothing is sealed, and no client proves its identity.
    pub seal: Option<ServerSeal>,
    /// What each node of its own system hosts, by its configuration: no certificate lets one register more. Of other
    /// systems it knows nothing.
    pub names: BTreeMap<String, Names>,
    /// The node that it takes system time from.
    pub node: &'a Arc<Node>,
    /// Its replicas; none: it has none.
    pub replicas: Option<LineParts>,
}
