//! The router, seen by tools: its links to other nodes, and the common time.

use super::slots::SlotState;
use crate::interface;
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};

/// Whether packages reach another node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum LinkState {
    /// The router has just begun, and has heard nothing yet.
    #[default]
    Unknown,
    /// It is heard, and hears this one.
    Alive,
    /// Nothing came for a second.
    Silent,
    /// It is heard, but does not hear this one.
    Unheard,
    /// One of both takes nothing from the other.
    Refused,
}

/// What went one way between two routers, since the counting one began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Carried {
    /// Packages, whole.
    #[schema(unit = "packages")]
    pub packages: u64,
    /// Datagrams, with those that only say "still there".
    #[schema(unit = "datagrams")]
    pub datagrams: u64,
    /// Bytes of the datagrams, as UDP's payload.
    #[schema(unit = "bytes")]
    pub bytes: u64,
    /// Fragments of packages that are larger than a datagram.
    #[schema(unit = "fragments")]
    pub fragments: u64,
}

/// What went wrong between two routers, since the counting one began.
///
/// Tools, charts and the book take names, units and texts from here, by [`quantities`](rohrpost_schema::quantities).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct LinkCounters {
    /// Datagrams from the peer that never came.
    #[schema(unit = "datagrams")]
    pub lost: u64,
    /// Datagrams to the peer that never came there, as it says.
    #[schema(unit = "datagrams")]
    pub missed: u64,
    /// Datagrams from the peer that came twice; dropped.
    #[schema(unit = "datagrams")]
    pub duplicates: u64,
    /// Datagrams from the peer that came after later ones; taken.
    #[schema(unit = "datagrams")]
    pub reordered: u64,
    /// Datagrams from the peer that were changed on the way; dropped.
    #[schema(unit = "datagrams")]
    pub damaged: u64,
    /// Datagrams from the peer's address of another version or configuration, or of another incarnation of its router;
    /// dropped.
    #[schema(unit = "datagrams")]
    pub refused: u64,
    /// Datagrams to the peer that this computer did not send.
    #[schema(unit = "datagrams")]
    pub unsent: u64,
    /// New starts of the peer's router.
    #[schema(unit = "starts")]
    pub restarts: u64,
}

/// Another node, as a router sees it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct PeerLink {
    /// Its name.
    pub node: String,
    /// Its address.
    pub address: String,
    /// Whether packages reach it.
    pub state: LinkState,
    /// What differs, if one refuses the other; else empty.
    pub why: String,
    /// Time since the last datagram of it, ms; none: never.
    pub heard_ms: Option<u64>,
    /// To it.
    pub sent: Carried,
    /// From it.
    pub received: Carried,
    /// What went wrong.
    pub counters: LinkCounters,
}

/// What a class did in a router; the packages that went with its priority.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ClassCarried {
    /// The class.
    pub class: u8,
    /// Packages taken from modules of this node.
    #[schema(unit = "packages")]
    pub taken: u64,
    /// Packages of modules of this node that were sent.
    #[schema(unit = "packages")]
    pub sent: u64,
    /// Packages that came from other nodes.
    #[schema(unit = "packages")]
    pub came: u64,
    /// Packages of other nodes that were put into mailboxes.
    #[schema(unit = "packages")]
    pub delivered: u64,
    /// Lost, and why.
    pub lost: Vec<CarriedLoss>,
    /// How old data from other nodes were when they were put into mailboxes; none without data.
    pub age: Option<Age>,
}

/// How old data are, from their stamp, by system time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Age {
    /// Packages with a stamp.
    pub packages: u64,
    /// Half were not older, ns.
    pub p50_ns: u64,
    /// 99 of 100 were not older, ns.
    pub p99_ns: u64,
    /// The oldest, ns.
    pub max_ns: u64,
}

/// Packages lost for one cause.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct CarriedLoss {
    /// The cause, in a word: `quota`, `silent`, `mailbox-full`, …
    pub cause: String,
    /// How many.
    pub packages: u64,
}

/// Packages that wait on one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct LevelWaiting {
    /// 0 goes first, 30 is the last of real time, 31 is what is not real time.
    pub level: u8,
    /// How many.
    pub packages: u64,
}

/// A router's view of all other nodes, and what it did. Counts are since it began, and only grow.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Links {
    /// Its node.
    pub node: String,
    /// Digest that all nodes must share, of the configuration that it runs.
    pub digest: u64,
    /// Time since it began, ms.
    pub uptime_ms: u64,
    /// The other nodes, in the order of the configuration.
    pub peers: Vec<PeerLink>,
    /// Levels on which packages wait.
    pub waiting: Vec<LevelWaiting>,
    /// Bytes of memory that they take.
    pub waiting_bytes: u64,
    /// Classes that did something, the most urgent first.
    pub classes: Vec<ClassCarried>,
    /// Datagrams from addresses of no node, for which the router's socket had no room, or that are nothing of
    /// Rohrpost's.
    pub foreign: u64,
    /// What this computer said when it was to send a datagram, and how often.
    pub failures: Vec<SocketFailure>,
    /// Datagrams that were not taken, since they were not sealed as they must be.
    pub rejections: Vec<Rejected>,
}

/// Datagrams that were not taken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Rejected {
    /// The node that has the address they came from, which anybody can write on a datagram; empty: no node has it.
    pub node: String,
    /// In a word: `unsealed`, `other-key`, `not-ours`, `other-incarnation`, `replay`, `forged`, `version`.
    pub cause: String,
    /// Of packages and of time.
    pub datagrams: u64,
}

/// Why datagrams could not be sent.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct SocketFailure {
    /// In a word: `nobody-there` (of an earlier one), `no-way`, `too-long`, `no-room`, `full`, `unacquainted`, `other`.
    pub cause: String,
    /// How often.
    pub times: u64,
}

/// What a node does for the common time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[serde(rename_all = "lowercase")] // in JSON; postcard knows numbers only
pub enum ClockRole {
    /// It hears no master; if it has time, it goes on by its own clock.
    Listening,
    /// It follows the master.
    Slave,
    /// Its time is everyone's.
    Master,
}

/// System time on a node.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ClockState {
    /// The node.
    pub node: String,
    /// What it does for the common time.
    pub role: ClockRole,
    /// The master that it follows, or is; empty if there is none yet.
    pub master: String,
    /// The term of the master; later terms are greater.
    pub term: u64,
    /// Raised with each step of time.
    pub epoch: u64,
    /// System time when this was said, ns since 1970.
    pub now_ns: u64,
    /// How far off it may be then, ns: the distance to the time of the term is not larger; none: nobody knows.
    pub error_ns: Option<u64>,
    /// How far off it seemed at the last exchange, ns; positive: it was ahead.
    pub offset_ns: i64,
    /// How much faster than the master's its own clock runs, ns a second.
    pub rate_ppb: i64,
    /// Shortest way there and back of late, ns; none: not measured.
    pub round_trip_ns: Option<u64>,
    /// Exchanges with the master so far.
    pub exchanges: u64,
    /// Whether the kernel stamps the frames; else they are stamped by the router, and the error is larger.
    pub by_kernel: bool,
    /// How far the clock of its computer was set away from system time, ns; positive: it is ahead; none: they lie less
    /// than a day apart.
    pub clock_set_by_ns: Option<i64>,
}

/// Why a router begins no new epoch.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum NewEpochError {
    /// The router's node is not the master of time.
    #[error("its node is not the master of time; `rohrpost time` shows which is")]
    NotMaster,
    /// Each one has all nodes measure their clocks anew.
    #[error("an epoch began less than 10 s ago; ask again then")]
    TooSoon,
}

/// Declared flows that leave a node, in their order in the configuration. Counts are since its router began, and only
/// grow.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct FlowStates {
    /// The node.
    pub node: String,
    /// Its flows.
    pub flows: Vec<FlowState>,
}

/// How late packages of a declared flow were. Measured by the router that sends: from publishing to the arrival of the
/// last bit at the other computer, the link's time reckoned as bounds have it; where there are no time slots, until the
/// package is handed to the kernel.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct FlowState {
    /// The module that sends.
    pub from: String,
    /// The module that receives.
    pub to: String,
    /// What it carries, as declared: `data 1`, `reply`. By this, flows between the same modules are told apart. Empty:
    /// the file does not say so.
    pub carries: String,
    /// Bytes of a body at most, as declared. Flows between the same modules that do not say what they carry are told
    /// apart by it.
    #[schema(unit = "bytes")]
    pub size: u32,
    /// Packages sent.
    #[schema(unit = "packages")]
    pub packages: u64,
    /// The bound that `check` computes, if all slots are kept; none without time slots.
    #[schema(unit = "ns")]
    pub bound_ns: Option<u64>,
    /// The slowest package since the publishing of which no slot of the node was left out or cut short: the bound is
    /// about these.
    #[schema(unit = "ns")]
    pub kept_worst_ns: Option<u64>,
    /// The slowest package.
    #[schema(unit = "ns")]
    pub worst_ns: Option<u64>,
    /// The mean of all packages.
    #[schema(unit = "ns")]
    pub mean_ns: Option<u64>,
    /// 99 of 100 packages were not slower.
    #[schema(unit = "ns")]
    pub p99_ns: Option<u64>,
    /// The deadline, `within` in the file.
    #[schema(unit = "ns")]
    pub deadline_ns: u64,
    /// Packages slower than the bound.
    #[schema(unit = "packages")]
    pub over_bound: Option<u64>,
    /// Packages slower than the bound for which all slots were kept.
    #[schema(unit = "packages")]
    pub kept_over_bound: Option<u64>,
    /// Packages slower than the deadline.
    #[schema(unit = "packages")]
    pub over_deadline: u64,
    /// Packages lost in this router, and why.
    pub lost: Vec<CarriedLoss>,
}

/// Streams of other nodes that a node has, and streams of its own that others have. Counts are since its router began,
/// and only grow.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ReplicaStates {
    /// The node.
    pub node: String,
    /// What it sends: each stream for each node that has it.
    pub sent: Vec<ReplicaState>,
    /// What it has.
    pub received: Vec<ReplicaState>,
}

/// What became of the records of a replica, on one of its two ends.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ReplicaState {
    /// The stream, as the file names it: `camera.0/image`.
    pub stream: String,
    /// The node on the other end.
    pub node: String,
    /// Records of which all parts were sent; or that came whole.
    pub records: u64,
    /// Bytes of these records.
    pub bytes: u64,
    /// Records before the newest that are not in the replica, whatever the cause; none where it is sent.
    pub gaps: Option<u64>,
    /// Parts that were asked for, since they were lost; none where it is sent.
    pub asked: Option<u64>,
    /// Records that are whole since parts of them were asked for; none where it is sent.
    pub completed: Option<u64>,
    /// Parts that were sent again, since the node asked for them; none where it comes.
    pub again: Option<u64>,
    /// From writing to arrival, by system time, ns: the mean of the records that came since the last report; none
    /// where it is sent, without a common time, or if none came.
    pub delay_recent_ns: Option<u64>,
    /// The same of all: 99 of 100 records were not slower; none where it is sent, or
    /// without a common time.
    pub delay_p99_ns: Option<u64>,
    /// The slowest.
    pub delay_worst_ns: Option<u64>,
    /// Records that came later than `delay-alarm` allows.
    pub delayed: Option<u64>,
    /// What is not in the replica, and why.
    pub lost: Vec<ReplicaCause>,
}

/// Records or parts that are not in a replica, or requests that were not answered, for one cause.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ReplicaCause {
    /// In a word. Of records: `sampled`, `passed`, `absent` where they are sent, `incomplete` where they come. Of parts
    /// that were not taken: `duplicate`, `late`, `foreign`, `undescribed`, `too-large`, `unsound`, `unwritable`. Of
    /// requests for parts: `overwritten`, `not-sent`, `out-of-range`, `crowded`; of parts that are asked for again and
    /// again `exhausted`.
    pub cause: String,
    /// How many.
    pub times: u64,
}

/// Carries packages between nodes; it does so also while it is off.
#[interface(class = "router", crate = crate::macro_support)]
pub trait Router {
    /// How it stands with the other nodes.
    #[data(1)]
    fn links() -> Links;

    /// How it stands with system time.
    #[data(2)]
    fn clock() -> ClockState;

    /// How it keeps its time slots, where there are any.
    #[data(3)]
    fn slots() -> SlotState;

    /// How late packages of declared flows were that left this node.
    #[data(4)]
    fn flows() -> FlowStates;

    /// What it carries of streams between nodes, where there are replicas.
    #[data(5)]
    fn replicas() -> ReplicaStates;

    /// Begins a new epoch of the common time at the clock of the master's computer. Answers before it has begun: the
    /// epoch that is to end.
    #[command(16)]
    fn new_epoch(&mut self) -> Result<u64, NewEpochError>;
}
