//! From system to system without a server: what a router of the team sends, believes and delivers.
//!
//! ```text
//!  modules ─▶ team-router.I.3 ─▶ send ═ one datagram a package ═▶ handle: seal, incarnation, sequence ─▶ admission
//!                 ▲                                                                                         │
//!  tcp.I: what came by the TCP router ─▶ by_tcp ──────────────────────▶ two_ways: delivered once ◀──────────┘
//!                                                                            └─▶ mailboxes of this node
//! ```
//!
//! Best effort: nothing is sent again, nothing waits. Systems do not know each other beforehand, so there is no session
//! of two: each incarnation of a router seals for all, with a key that is derived from that of the team. That it lives
//! now it proves once to each that hears it. A *beat* says a random challenge, and repeats the newest challenge of each
//! incarnation that its sender hears. A node that finds its own challenge in a sealed beat knows that the beat was
//! made after it, and takes what that incarnation sends from there on, each sequence once:
//!
//! ```text
//!  A ── beat: challenge a ─────────────▶ B   may be a replay: B believes nothing, and answers soon
//!  A ◀── beat: challenge b, echo of a ── B   B lives: A takes what B sends
//!  A ── beat: challenge a', echo of b ─▶ B   B takes what A sends
//! ```
//!
//! Where nothing is sealed there is nothing to prove, and each incarnation is taken as soon as it is heard.
//!
//! No socket, thread or clock here: time is an argument, datagrams are bytes, and challenges come from a seed. Memory
//! is bounded: [`MEMBERS_MAX`] nodes of other systems, each with few incarnations.

mod challenges;
mod counts;
mod frame;
mod member;
mod receiving;
mod sending;
mod two_ways;

pub use counts::{TeamCounts, TeamRefusal};
pub use frame::{
    BadTeamFrame, Beat, ECHOES_MAX, Echo, TEAM_BODY_BYTES_MAX, TEAM_DATAGRAM_BYTES_MAX, TEAM_VERSION, TeamHead,
    TeamKind,
};
pub use two_ways::{COPY_MAX_NS, Way};

use crate::admission::Admission;
use crate::frame::NodeIndex;
use crate::report::NotDelivered;
use crate::security::{KeyRing, TeamSeal};
use crate::session::EndHost;
use challenges::Challenges;
use member::TeamMember;
use rohrpost_mailbox::{Head, Name};
use std::net::SocketAddr;
use std::sync::Arc;
use two_ways::TwoWays;

/// Nodes of other systems that are remembered; one that is silent gives way to another.
pub const MEMBERS_MAX: usize = ECHOES_MAX;
/// Longest time between two beats.
pub const BEAT_NS: u64 = 2_000_000_000;
/// Shortest time between two beats: somebody new was heard.
pub const BEAT_SOON_NS: u64 = 100_000_000;
/// A member of which nothing was believed for so long is silent.
pub const TEAM_SILENT_NS: u64 = 10_000_000_000;
/// Replies that wait to leave; those above are not made.
const REPLIES_MAX: usize = 16;

/// What a router of the team knows when it begins.
pub struct TeamSettings {
    /// System of the router.
    pub system: u8,
    /// Node in that system.
    pub node: NodeIndex,
    /// Digest of its classes.
    pub common: u64,
    /// This incarnation; never 0, and where datagrams are sealed a random number.
    pub incarnation: u64,
    /// Where challenges come from: random, and of this incarnation alone.
    pub seed: [u8; 32],
    /// The keys of the team; none: nothing is sealed.
    pub keys: Option<KeyRing>,
    /// The systems that have peers; none: all are reached.
    pub reached: Option<Vec<u8>>,
    /// Which packages may enter.
    pub admission: Admission,
}

/// What the core needs from the code that runs it.
pub trait TeamHost: EndHost {
    /// Puts a package that came into its mailbox.
    ///
    /// # Errors
    /// [`NotDelivered`]
    fn deliver(&mut self, head: &Head, body: &[u8]) -> Result<(), NotDelivered>;

    /// Whether this node hosts a name.
    fn hosts(&self, name: Name) -> bool;

    /// A command that came is not allowed, by the rule in this line of the configuration; its answer is asked for next.
    fn not_allowed(&mut self, _line: Option<usize>) {}
}

/// A member as it is shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Teammate {
    /// System of the router.
    pub system: u8,
    /// Node in that system.
    pub node: NodeIndex,
    /// Where its last datagram came from.
    pub address: SocketAddr,
    /// When something was last believed of it, monotonic ns.
    pub heard_ns: u64,
    /// Whether an incarnation of it is believed to live.
    pub is_proven: bool,
    /// Whether it says that it hears this router.
    pub hears_us: bool,
    /// Datagrams to all systems that its present incarnation sent, as far as it has said.
    pub sent: u64,
    /// Of these, those that did not come.
    pub lost: u64,
    /// Incarnations so far.
    pub incarnations: u64,
    /// How often one came back after another: two computers use one system and node.
    pub returns: u64,
}

/// A router of the team.
pub struct TeamRouter {
    settings: TeamSettings,
    seal: Option<TeamSeal>,
    counts: Arc<TeamCounts>,
    members: Vec<TeamMember>,
    two_ways: Option<TwoWays>,
    challenges: Challenges,
    /// Sequence of the next datagram.
    sequence: u64,
    sent_to_all: u64,
    last_beat_ns: u64,
    next_beat_ns: u64,
    /// Replies to commands that went no further, for their senders.
    replies: Vec<(Head, Vec<u8>)>,
}

impl TeamRouter {
    /// A router without members. `has_tcp`: packages of other systems come by the TCP router, too.
    pub fn new(settings: TeamSettings, has_tcp: bool, now_ns: u64) -> Self {
        let TeamSettings { system, node, incarnation, .. } = settings;
        let seal = settings.keys.as_ref().map(|keys| TeamSeal::new(keys, system, node, incarnation));
        Self {
            seal,
            counts: Arc::default(),
            members: Vec::with_capacity(MEMBERS_MAX),
            two_ways: has_tcp.then(TwoWays::default),
            challenges: Challenges::new(settings.seed, now_ns),
            settings,
            sequence: 0,
            sent_to_all: 0,
            last_beat_ns: 0,
            next_beat_ns: now_ns,
            replies: Vec::with_capacity(REPLIES_MAX),
        }
    }

    /// Counters of the router, which other threads may read.
    pub fn counts(&self) -> &Arc<TeamCounts> {
        &self.counts
    }

    /// The system that it is of.
    pub fn system(&self) -> u8 {
        self.settings.system
    }

    /// The nodes of other systems that are or were heard, by system.
    pub fn teammates(&self) -> Vec<Teammate> {
        let mut all: Vec<Teammate> = self.members.iter().map(Teammate::of).collect();
        all.sort_unstable_by_key(|mate| (mate.system, mate.node));
        all
    }

    /// A reply that this router made to a command from another system; it goes as what modules send.
    pub fn next_reply(&mut self) -> Option<(Head, Vec<u8>)> {
        self.replies.pop()
    }
}

impl Teammate {
    fn of(member: &TeamMember) -> Self {
        let TeamMember { system, node, address, heard_ns, incarnations, returns, .. } = *member;
        let present = member.present.as_ref();
        let loss = present.map(|present| present.loss).unwrap_or_default();
        Self {
            system,
            node,
            address,
            heard_ns,
            is_proven: present.is_some(),
            hears_us: present.is_some_and(|present| present.hears_us),
            sent: loss.sent(),
            lost: loss.lost(),
            incarnations,
            returns,
        }
    }
}

#[cfg(test)]
mod tests;
