//! Packages to other nodes: which one next, in which datagram, and when.
//!
//! ```text
//!  accept: route ─ age ─ peer there? ─┬─ nothing waits, may leave now ──▶ at once, without a copy
//!                                     └─ Queue ──▶ poll: first level first, and all that fits for that peer
//! ```
//!
//! Each accepted package is sent or lost with a cause; see [`Stats`].

use crate::counts::Cause;
use crate::frame::{self, Fragment, FrameKind, NodeIndex};
use crate::link::PeerLinkState;
use crate::queue::{Place, Queue, QueuedPackage};
use crate::report::Report;
use crate::security::PeerSessions;
use crate::settings::Settings;
use crate::stats::Stats;
use rohrpost_mailbox::{HEAD_BYTES as PACKAGE_HEAD_BYTES, Head, Name, Priority};
use rohrpost_network::LEVELS;
use std::sync::Arc;

mod accept;
mod carry;
mod datagram;
mod flows;
mod own;
mod pace;
mod slot;

use flows::Aboard;
pub(crate) use own::kind_of_own;
use pace::Pacer;

/// Longest time from the publishing of a package to its leaving. "At most once" allows 2 s to its mailbox, so this
/// leaves half a second for the wire and the other end.
pub const WAIT_MAX_NS: u64 = 1_500_000_000;
/// Packages that cannot leave are searched for this often.
const SWEEP_EVERY_NS: u64 = 100_000_000;
/// Bytes before the body of a package that leaves at once.
pub const DIRECT_HEAD_BYTES: usize = frame::HEAD_BYTES + PACKAGE_HEAD_BYTES;

/// A package to carry.
#[derive(Clone, Copy, Debug)]
pub struct Package<'a> {
    /// Its head.
    pub head: Head,
    /// When its sender published it, ns.
    pub published_ns: u64,
    /// Its body; as long as the head says.
    pub body: &'a [u8],
}

/// Result for a package that is handed over.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Accepted {
    /// Send these bytes and then the body, now, as one datagram.
    Send {
        /// Receiver.
        to: NodeIndex,
        /// The bytes before the body.
        head: [u8; DIRECT_HEAD_BYTES],
    },
    /// It waits; `poll`.
    Waits,
    /// It was reported as lost.
    Lost,
}

/// Next step for the code around the core, from [`Outbound::poll`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OutboundStep {
    /// Send the first bytes of the buffer as one datagram, then ask again.
    Send {
        /// Receiver.
        to: NodeIndex,
        /// Length.
        bytes: usize,
    },
    /// Nothing before this time, unless a package comes.
    Wait {
        /// Ns of the monotonic clock.
        until_ns: u64,
    },
}

/// The outgoing half of a router. One thread has it.
#[derive(Debug)]
pub struct Outbound {
    settings: Settings,
    stats: Arc<Stats>,
    queue: Queue,
    pace: Pacer,
    levels: [u8; 256],
    /// Modules of this node by their numbers, sorted, and the quota of each.
    senders: Box<[(u32, u16)]>,
    /// The quota of all other senders.
    others: u16,
    peers: Box<[KeepAlive]>,
    /// Most bytes of a datagram.
    datagram_bytes: usize,
    aboard: Aboard,
    /// Where datagrams are sealed: the peers with a session. Packages to others wait.
    peer_sessions: Option<Arc<PeerSessions>>,
    /// The only peers that it sends to, one bit each.
    only: u64,
    /// Those of them that it reaches.
    reached: u64,
    /// Peers with no socket room at present, one bit each: they are passed over.
    full: u64,
    /// Peers that hear this incarnation by their word, one bit each; all peers where that does not matter.
    hearing: u64,
    /// Counters of those that go before, and their counted bytes: all share one rate. The real-time half is the first.
    shares_with: Vec<(Arc<Stats>, u64)>,
    /// It sends in time slots only.
    in_slots: bool,
    /// No keep-alive is due before this, ns.
    alive_ns: u64,
    sweep_ns: u64,
}

#[derive(Clone, Debug, Default)]
struct KeepAlive {
    /// When the next keep-alive is due: without other traffic, and in any case, ns.
    quiet_until_ns: u64,
    tell_ns: u64,
    /// Its incarnation at the last look.
    incarnation: u64,
}

impl Outbound {
    /// State for the router of `settings.own`. Takes all its memory now.
    pub fn new(settings: &Settings, stats: Arc<Stats>) -> Self {
        let groups = settings.senders.iter().enumerate();
        let names = groups.flat_map(|(index, names)| names.iter().map(move |name| (name.module().raw(), index as u16)));
        let mut senders: Vec<_> = names.collect();
        senders.sort_unstable();
        let others = settings.senders.len();
        Self {
            queue: Queue::new(others + 1, settings.nodes.len(), settings.network.quota_bytes),
            pace: Pacer::new(settings),
            levels: std::array::from_fn(|priority| settings.network.level(Priority(priority as u8))),
            senders: senders.into(),
            others: others as u16,
            peers: vec![KeepAlive::default(); settings.nodes.len()].into(),
            datagram_bytes: settings.datagram_bytes(),
            aboard: Aboard::new(settings.datagram_bytes()),
            peer_sessions: None,
            only: u64::MAX,
            reached: u64::MAX,
            full: 0,
            hearing: u64::MAX,
            shares_with: Vec::new(),
            in_slots: settings.tdma.is_some(),
            alive_ns: 0,
            sweep_ns: 0,
            settings: settings.clone(),
            stats,
        }
    }

    /// From now on the caller seals datagrams, and they go only to peers with a session.
    #[must_use]
    pub fn sealed(self, peer_sessions: Arc<PeerSessions>) -> Self {
        Self { reached: 0, hearing: u64::MAX, peer_sessions: Some(peer_sessions), ..self }
    }

    /// From now on it sends what is not real time, at the rate that real time leaves. Where nothing is sealed, a
    /// package waits until its peer has said that it hears this incarnation: before that the peer takes nothing of it
    /// at the port for what is not real time. Call it before [`Self::sealed`].
    #[must_use]
    pub fn behind(self, real_time: &Arc<Stats>) -> Self {
        Self { hearing: 0, ..self.yielding_to(real_time) }
    }

    /// The sockets of these peers, one bit each, have no room: packages to them wait, without delay of others.
    pub fn pass_over(&mut self, full: u64) {
        if full != self.full {
            (self.full, self.alive_ns) = (full, 0);
        }
    }

    /// Whether any package waits to leave.
    pub fn waits(&self) -> bool {
        !self.queue.is_empty()
    }

    /// Whether only more important packages are of use. False if all waits for closed peers.
    pub fn has_plenty(&self) -> bool {
        let enough = (2 * self.datagram_bytes).max(self.settings.network.quota_bytes / 2);
        self.queue.used_bytes() >= enough as u64 && self.first_level().is_some()
    }

    /// Bytes of memory of all packages that share a quota with this sender.
    pub fn waiting_bytes_of(&self, sender: Name) -> u64 {
        self.queue.used_by(self.sender_of(sender))
    }

    /// The level of a priority.
    pub fn level(&self, priority: Priority) -> u8 {
        self.levels[usize::from(priority.0)]
    }

    /// The first level on which something waits that may leave.
    pub fn first_level(&self) -> Option<u8> {
        self.queue.first_among(self.open()).map(|place| self.queue.at(place).level)
    }

    /// Highest priority that waits: only more important packages may leave before.
    pub fn waits_up_to(&self) -> Priority {
        let level = self.first_level();
        let highest = (0..=u8::MAX).rev().find(|priority| Some(self.levels[usize::from(*priority)]) == level);
        Priority(highest.unwrap_or_default())
    }

    /// The next datagram, or when to ask again. `datagram` has room for the largest. For time slots see
    /// [`Self::poll_slot`].
    ///
    /// # Panics
    /// If it has not.
    pub fn poll(&mut self, now_ns: u64, datagram: &mut [u8], report: &mut impl Report) -> OutboundStep {
        let datagram = &mut datagram[..self.datagram_bytes];
        self.aboard.clear();
        self.announce_to_new_sessions();
        self.look_at_what_is_real_time(now_ns);
        if now_ns >= self.sweep_ns {
            self.sweep(now_ns, report);
        }
        if now_ns >= self.alive_ns
            && let Some(peer) = self.due(now_ns)
        {
            return OutboundStep::Send { to: peer, bytes: self.alive(now_ns, peer, datagram) };
        }
        let quiet_until_ns = if self.queue.is_empty() { self.alive_ns } else { self.alive_ns.min(self.sweep_ns) };
        while let Some(place) = self.queue.first_among(self.open()) {
            let waiting = *self.queue.at(place);
            if let Err(until_ns) = self.pace.may_leave(now_ns, waiting.level) {
                return OutboundStep::Wait { until_ns: until_ns.min(quiet_until_ns) };
            }
            if let Some(cause) = self.why_not(now_ns, waiting.peer, waiting.published_ns) {
                self.drop_out(place, cause, report);
                continue;
            }
            let bytes = if self.is_large(&waiting) {
                self.part(now_ns, place, datagram)
            } else {
                self.pack(now_ns, (waiting.peer, waiting.level, LEVELS as u8), datagram, report)
            };
            return OutboundStep::Send { to: waiting.peer, bytes };
        }
        // A package for a peer without a session may become too old.
        OutboundStep::Wait { until_ns: if self.queue.is_empty() { self.alive_ns } else { quiet_until_ns } }
    }

    /// The socket did not take the last datagram; nor the body if it was [`Accepted::Send`].
    pub fn unsent(&mut self, datagram: &[u8], body: &[u8], report: &mut impl Report) {
        let Some((kind, peer, mut rest)) = kind_of_own(datagram) else { return };
        self.stats.peer(peer).sent.unsent.add(1);
        if kind == FrameKind::Packages {
            while let Ok(head) = Head::from_bytes(rest) {
                rest = &rest[PACKAGE_HEAD_BYTES..];
                let (inside, behind) = rest.split_at_checked(head.len.into()).unwrap_or((body, &[]));
                self.came_back(peer, &head, inside, report);
                rest = behind;
            }
        }
        if kind == FrameKind::Fragment
            && let Ok(part) = Fragment::parse(rest)
        {
            // Without this fragment the others are worth nothing.
            let level = self.levels[usize::from(part.head.priority.0)];
            let under_way = self.queue.first_of(peer, level);
            match under_way
                .filter(|place| self.queue.at(*place).fragments > 0 && self.queue.at(*place).first == part.first)
            {
                Some(place) => self.drop_out(place, Cause::Socket, report),
                None => self.came_back(peer, &part.head, &[], report),
            }
        }
    }

    /// Makes a keep-alive to every peer due now.
    #[cfg(test)]
    pub(crate) fn tell_all(&mut self, now_ns: u64) {
        self.alive_ns = now_ns;
        self.peers.iter_mut().for_each(|peer| peer.tell_ns = now_ns);
    }

    fn came_back(&mut self, peer: NodeIndex, head: &Head, body: &[u8], report: &mut impl Report) {
        self.stats.peer(peer).sent.packages.take_back(1);
        self.stats.out.came_back(head.priority, head.len);
        lose(&self.stats, Some(peer), head, body, Cause::Socket, report);
    }

    fn why_not(&self, now_ns: u64, peer: NodeIndex, published_ns: u64) -> Option<Cause> {
        match self.stats.state(peer, now_ns) {
            _ if is_stale(now_ns, published_ns) => Some(Cause::Stale),
            PeerLinkState::Unknown | PeerLinkState::Alive => None,
            PeerLinkState::Silent => Some(Cause::Silent),
            PeerLinkState::Unheard => Some(Cause::Unheard),
            PeerLinkState::Refused(_) => Some(Cause::Refused),
        }
    }

    fn reaches(&self, peer: NodeIndex) -> bool {
        let is_known = self.peer_sessions.as_ref().is_none_or(|all| all.reached() & 1 << peer != 0);
        is_known && self.full & 1 << peer == 0 && self.hearing & 1 << peer != 0
    }

    /// Peers to which something may leave now.
    fn open(&self) -> u64 {
        self.reached & !self.full & self.hearing
    }

    /// Accounts for the rate that others use which go before it, and copies which peers hear this node.
    fn look_at_what_is_real_time(&mut self, now_ns: u64) {
        for (others, counted) in &mut self.shares_with {
            let bytes = others.on_wire_bytes.get();
            self.pace.takes(now_ns, bytes.wrapping_sub(*counted) as usize);
            *counted = bytes;
        }
        let Some((real_time, _)) = self.shares_with.first() else { return };
        if self.peer_sessions.is_some() {
            return;
        }
        let hears = |peer: &NodeIndex| real_time.peer(*peer).link.hears_us_ns.get() > 0;
        let hearing = self.settings.peers().filter(hears).fold(0, |all, peer| all | 1 << peer);
        if hearing != self.hearing {
            (self.hearing, self.alive_ns) = (hearing, 0);
        }
    }

    /// A peer with a new session gets a keep-alive at once.
    fn announce_to_new_sessions(&mut self) {
        let Some(all) = &self.peer_sessions else { return };
        let reached = all.reached() & self.only;
        if reached != self.reached {
            (self.reached, self.alive_ns) = (reached, 0);
        }
    }

    /// A peer in a new incarnation soon gets a keep-alive that it is heard: it may wait for that.
    fn announce_to_new_incarnations(&mut self) {
        for (peer, stats) in self.peers.iter_mut().zip(0..).map(|(peer, node)| (peer, self.stats.peer(node))) {
            let incarnation = stats.link.incarnation.get();
            if std::mem::replace(&mut peer.incarnation, incarnation) != incarnation {
                (peer.tell_ns, self.alive_ns) = (0, 0);
            }
        }
    }

    fn sender_of(&self, name: Name) -> u16 {
        let raw = name.module().raw();
        self.senders.binary_search_by_key(&raw, |(name, _)| *name).map_or(self.others, |at| self.senders[at].1)
    }

    fn is_large(&self, waiting: &QueuedPackage) -> bool {
        DIRECT_HEAD_BYTES + usize::from(waiting.head.len) > self.datagram_bytes
    }

    fn drop_out(&mut self, place: Place, cause: Cause, report: &mut impl Report) {
        let (waiting, body) = self.queue.remove(place);
        lose(&self.stats, Some(waiting.peer), &waiting.head, body, cause, report);
        self.left_queue(waiting.level);
    }

    fn left_queue(&self, level: u8) {
        self.stats.waiting[usize::from(level)].take_back(1);
        self.stats.waiting_bytes.set(self.queue.used_bytes());
    }

    /// Drops packages that waited too long behind others, and those to peers that are gone.
    fn sweep(&mut self, now_ns: u64, report: &mut impl Report) {
        self.sweep_ns = now_ns + SWEEP_EVERY_NS;
        self.announce_to_new_incarnations();
        for peer in 0..self.settings.nodes.len() as NodeIndex {
            for level in 0..LEVELS as u8 {
                while let Some(place) = self.queue.first_of(peer, level) {
                    let Some(cause) = self.why_not(now_ns, peer, self.queue.at(place).published_ns) else { break };
                    self.drop_out(place, cause, report);
                }
            }
        }
    }
}

fn is_stale(now_ns: u64, published_ns: u64) -> bool {
    now_ns.saturating_sub(published_ns) > WAIT_MAX_NS
}

fn lose(stats: &Stats, peer: Option<NodeIndex>, head: &Head, body: &[u8], cause: Cause, report: &mut impl Report) {
    stats.out.lost(head.priority, cause);
    stats.flows.lost(head, cause);
    report.lost(peer, head, body, cause);
}

#[cfg(test)]
mod tests;
