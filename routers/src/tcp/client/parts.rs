//! What a client is made of, and why it cannot be.

use crate::impair;
use crate::session::client::ClientSettings;
use crate::shell::Faults;
use crate::tcp::replicas::LineParts;
use crate::tcp::seal::ClientSeal;
use rohrpost_mailbox::{CreateError, Name, Node, NodeError};
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

/// Why a client does not run.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The node's memory.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// Its mailbox.
    #[error(transparent)]
    Mailbox(#[from] CreateError),
    /// What it sleeps with.
    #[error("a pipe that wakes the client of the TCP router: {0}")]
    Watches(io::Error),
    /// What makes the network to the server worse.
    #[error("a bad line to the TCP router: {0}")]
    BadLine(io::Error),
    /// The system has no thread for it.
    #[error("a thread of the client of the TCP router: {0}; is the limit of processes reached (ulimit -u)?")]
    Thread(io::Error),
}

/// Parts of a client.
pub struct ClientParts<'a> {
    /// The node that it serves.
    pub node: &'a Arc<Node>,
    /// Its name, `tcp.I`.
    pub name: Name,
    /// Where the server is.
    pub server: SocketAddr,
    /// What it knows.
    pub settings: ClientSettings,
    /// The names that its node hosts, also those that it hosts only while it holds their lease.
    pub hosts: Vec<(Name, Name)>,
    /// Those of them that it registers.
    pub registers: Vec<(Name, Name)>,
    /// The names that other nodes of its system host, and those that move, if it brings packages for all systems there
    /// itself.
    pub others: Vec<(Name, Name)>,
    /// The names for which packages go to the server if neither the node nor its LAN has them.
    pub beyond: Vec<(Name, Name)>,
    /// How commands are answered that cannot be carried.
    pub faults: Arc<dyn Faults>,
    /// Its certificates; none: nothing is sealed.
    pub seal: Option<ClientSeal>,
    /// Whether the node's system time is what the server tells.
    pub keeps_time: bool,
    /// A bad network to the server; none: as it is.
    pub impair: Option<impair::ImpairmentSettings>,
    /// The node's router of the team, if there is one.
    pub team: Option<Name>,
    /// Its replicas; none: it has none.
    pub replicas: Option<LineParts>,
}
