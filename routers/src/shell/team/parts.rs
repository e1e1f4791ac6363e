//! What a router of the team is made of, why it cannot be, and how it shows.

use crate::shell::Faults;
use crate::team::{TeamSettings, Teammate};
use rohrpost_config::Team;
use rohrpost_mailbox::{CreateError, Name, Node, NodeError};
use std::io;
use std::net::IpAddr;
use std::sync::Arc;

/// Why a router of the team does not run.
#[derive(Debug, thiserror::Error)]
pub enum TeamError {
    /// The node's memory.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// Mailbox of the router.
    #[error(transparent)]
    Mailbox(#[from] CreateError),
    /// What it sleeps with.
    #[error("a pipe that wakes the router of the team: {0}")]
    Watches(io::Error),
    /// The system has no thread for it.
    #[error("a thread of the router of the team: {0}; is the limit of processes reached (ulimit -u)?")]
    Thread(io::Error),
}

/// Parts of a router of the team.
pub struct TeamParts<'a> {
    /// The node that it serves.
    pub node: &'a Arc<Node>,
    /// Name of the module, `team-router.I`.
    pub name: Name,
    /// What it knows.
    pub settings: TeamSettings,
    /// How others are reached.
    pub team: &'a Team,
    /// The node's address on the network of the team.
    pub address: IpAddr,
    /// The names that its node hosts.
    pub hosts: Vec<(Name, Name)>,
    /// The names that other nodes of its system host.
    pub others: Vec<(Name, Name)>,
    /// The names of other systems, which it is the way to.
    pub names: Vec<(Name, Name)>,
    /// How commands are answered that cannot be carried.
    pub faults: Arc<dyn Faults>,
    /// The node's client of the TCP router, if there is one: what leaves goes there, too.
    pub tcp: Option<Name>,
}

/// How a router of the team does.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct TeamLinks {
    /// Why its network is not there; empty if it is.
    pub why: String,
    /// The nodes of other systems that are or were heard, by system.
    pub teammates: Vec<Teammate>,
}
