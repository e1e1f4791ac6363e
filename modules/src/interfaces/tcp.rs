//! What is beyond the LAN, seen by tools: the TCP router, and a node's client of it.

use super::router::{CarriedLoss, ReplicaStates};
use crate::interface;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// Whether packages go to the TCP router and come from it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum BeyondState {
    /// There is no connection.
    #[default]
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
    #[schema(unit = "packages")]
    pub packages: u64,
    /// Packages that were handed on.
    #[schema(unit = "packages")]
    pub passed: u64,
    /// Packages of data of which only the newest counts, replaced by newer ones while they waited. No loss.
    #[schema(unit = "packages")]
    pub replaced: u64,
    /// Lost, and why.
    pub lost: Vec<CarriedLoss>,
}

/// The system time of a node that has it from the TCP router.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondTime {
    /// Raised with each step of time.
    pub epoch: u64,
    /// System time when this was said, ns since 1970.
    pub now_ns: u64,
    /// How far off it may be then, ns; none: nobody knows.
    pub error_ns: Option<u64>,
}

/// When a client took part no more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondOutage {
    /// From then on, system time, ns since 1970.
    pub began_ns: u64,
    /// Until then; none: it is not over.
    pub ended_ns: Option<u64>,
}

impl BeyondOutage {
    /// How long it took, or has taken until `now_ns`.
    pub fn duration(&self, now_ns: u64) -> std::time::Duration {
        std::time::Duration::from_nanos(self.ended_ns.unwrap_or(now_ns).saturating_sub(self.began_ns))
    }
}

/// A node's client of the TCP router. Counts are since it began, and only grow.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
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
    #[schema(unit = "connections")]
    pub reconnects: u64,
    /// Shortest way there and back of late; none: not measured.
    #[schema(unit = "ns")]
    pub round_trip_ns: Option<u64>,
    /// How far off the system time that the server tells is at most here; none: it does not know it.
    #[schema(unit = "ns")]
    pub time_error_ns: Option<u64>,
    /// The node's system time, if it is what the server tells.
    pub time: Option<BeyondTime>,
    /// How often it was disconnected.
    #[schema(unit = "outages")]
    pub outages: u64,
    /// The last time; none: never.
    pub outage: Option<BeyondOutage>,
    /// Memory that waiting packages take up.
    #[schema(unit = "bytes")]
    pub waiting_bytes: u64,
    /// Parts of replicas that this node has not.
    #[schema(unit = "parts")]
    pub unknown_parts: u64,
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
    #[schema(unit = "ranges")]
    pub ranges: u64,
    /// Time since its connection was made.
    #[schema(unit = "ms")]
    pub age_ms: u64,
    /// Time since something came from it.
    #[schema(unit = "ms")]
    pub heard_ms: u64,
    /// Packages lost in queues because it sent more than its share. Connections with the same certificate, or without
    /// one from the same address, share one count.
    #[schema(unit = "packages")]
    pub lost: u64,
    /// Memory that it takes up, with what waits for it.
    #[schema(unit = "bytes")]
    pub bytes: u64,
}

/// How often somebody wanted more than its part of what all share, and others were served before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondCrowded {
    /// Connections before their hello that gave way to others.
    #[schema(unit = "connections")]
    pub greetings: u64,
    /// Clients that gave way to those of others, or were not let in.
    #[schema(unit = "clients")]
    pub clients: u64,
    /// Registrations of too many ranges.
    #[schema(unit = "registrations")]
    pub ranges: u64,
    /// Packages lost in queues.
    #[schema(unit = "packages")]
    pub packages: u64,
}

/// The TCP router. Counts are since it began, and only grow.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondClients {
    /// Where it listens.
    pub address: String,
    /// Time since it began.
    #[schema(unit = "ms")]
    pub uptime_ms: u64,
    /// The connections that are there; of many the first.
    pub clients: Vec<BeyondClient>,
    /// Connections besides these.
    pub more: u64,
    /// Clients that were connected and are not any more.
    #[schema(unit = "clients")]
    pub left: u64,
    /// Connections that were refused.
    #[schema(unit = "connections")]
    pub refused: u64,
    /// The last of them, and why it was refused; empty without one.
    pub refusal: String,
    /// What went beyond the part of one certificate, or one address.
    pub crowded: BeyondCrowded,
    /// Registrations that a later one of the same client replaced before they were handled.
    #[schema(unit = "registrations")]
    pub superseded: u64,
    /// Lines of output that were only counted, since there were too many of their cause.
    #[schema(unit = "lines")]
    pub held_lines: u64,
    /// Parts of replicas that this node has not, from any client.
    #[schema(unit = "parts")]
    pub unknown_parts: u64,
    /// Classes of which something passed, the most urgent first.
    pub classes: Vec<ClassPassed>,
}

/// Names that somebody hosts, all from the first to the last.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondHost {
    /// The first, by number.
    pub first: u32,
    /// The last.
    pub last: u32,
    /// The client that hosts them.
    pub client: String,
}

/// All names that are registered at the TCP router.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondHosts {
    /// By client, in the order of names.
    pub hosts: Vec<BeyondHost>,
    /// Further ranges, which are not told.
    pub more: u64,
}

/// A node that has streams by the TCP router.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondNode {
    /// The node.
    pub name: String,
    /// The name of its client: parts go to the host of that.
    pub client: u32,
}

/// A stream that the TCP router sends.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondStream {
    /// Its number in parts: the place of its `[[replica]]` in the file, from 0.
    pub place: u16,
    /// The module that writes it.
    pub source: u32,
    /// Its name in that module's interface.
    pub item: String,
    /// Bytes of a record at most.
    #[schema(unit = "bytes")]
    pub record_bytes: u32,
    /// The nodes that have it, by their places in the list of these.
    pub to: Vec<u16>,
}

/// All streams that the TCP router sends, as its file says.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct BeyondStreams {
    /// The nodes beyond the LAN.
    pub nodes: Vec<BeyondNode>,
    /// In the order of their places.
    pub streams: Vec<BeyondStream>,
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

    /// Which names are registered at the TCP router, and by which host.
    #[data(3)]
    fn hosts() -> BeyondHosts;

    /// What this end carries of streams, where there are replicas by the TCP router.
    #[data(4)]
    fn replicas() -> ReplicaStates;

    /// Which streams the TCP router sends to which node.
    #[data(5)]
    fn streams() -> BeyondStreams;
}
