//! What is beyond the LAN, seen by tools: the TCP router, and a node's client of it.

use super::router::CarriedLoss;
use crate::interface;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Whether packages go to the TCP router and come from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum BeyondState {
    /// There is no connection.
    Away,
    /// There is one, but the node's names are not registered.
    Joining,
    /// They do.
    Up,
}

/// What a class did at one end of sessions; the packages that went with its priority.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ClassPassed {
    /// The class.
    pub class: u8,
    /// Packages that came.
    pub packages: u64,
    /// Of these, handed on.
    pub passed: u64,
    /// Lost, and why.
    pub lost: Vec<CarriedLoss>,
}

/// A node's client of the TCP router. Counts are since it began, and only grow.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondLink {
    /// The node.
    pub node: String,
    /// Where the TCP router is.
    pub server: String,
    /// Whether packages go there and come from there.
    pub state: BeyondState,
    /// Why not; empty if they do.
    pub why: String,
    /// Connections after the first.
    pub reconnects: u64,
    /// Shortest way there and back of late, ns; none: not measured.
    pub round_trip_ns: Option<u64>,
    /// How far off the system time that the server tells is at most here, ns; none: it does not know it.
    pub time_error_ns: Option<u64>,
    /// Bytes of memory that what waits takes up.
    pub waiting_bytes: u64,
    /// Classes that sent something there, the most urgent first.
    pub sent: Vec<ClassPassed>,
    /// Classes of which something came from there.
    pub received: Vec<ClassPassed>,
}

/// A connection, as the TCP router sees it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondClient {
    /// Its name; before it has said one, where it comes from.
    pub name: String,
    /// Where it comes from.
    pub address: String,
    /// First byte of the names that it hosts; 0 before it has said so.
    pub system: u8,
    /// Whether it takes part.
    pub takes_part: bool,
    /// Ranges of names that it hosts.
    pub ranges: u64,
    /// Time since its connection was made, ms.
    pub age_ms: u64,
    /// Time since something came from it, ms.
    pub heard_ms: u64,
    /// Bytes of memory that it takes up, with what waits for it.
    pub bytes: u64,
}

/// The TCP router. Counts are since it began, and only grow.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondClients {
    /// Where it listens.
    pub address: String,
    /// Time since it began, ms.
    pub uptime_ms: u64,
    /// The connections that are there.
    pub clients: Vec<BeyondClient>,
    /// Clients that took part and do not any more.
    pub left: u64,
    /// Connections that might not take part, or not any more.
    pub refused: u64,
    /// Who was the last of them, and why; empty without one.
    pub refusal: String,
    /// Classes of which something passed, the most urgent first.
    pub classes: Vec<ClassPassed>,
}

/// Carries packages beyond the LAN; it does so also while it is off.
#[interface(class = "tcp", crate = crate::macro_support)]
pub trait Tcp {
    /// How a node's client stands with the TCP router.
    #[data(1)]
    fn link() -> BeyondLink;

    /// How the TCP router stands with its clients.
    #[data(2)]
    fn clients() -> BeyondClients;
}
