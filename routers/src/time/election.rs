//! Election of the master: the order of candidates, the silence that ends a term, and which of two masters yields.

use super::message::{Request, Sync};
use super::unverified::UnverifiedPeers;
use super::{TAKEOVER_HALF_INTERVALS, Term};
use crate::frame::NodeIndex;

/// Minimum time in which a master must answer: one exchange, some datagrams of which may be lost.
const DEAF_NS_MIN: u64 = 200_000_000;
/// The same in time slots, in slots of the node that asks and of the master.
const DEAF_SLOTS: u64 = 4;
/// In time slots: wait after the last frame was due before a new time. Unheard nodes may still send by theirs.
const BEGINS_AFTER_NS: u64 = 100_000_000;
/// In time slots a master that misses three Syncs has a successor in the third cycle; after two it may still be heard.
const SUCCEEDED_HALF_INTERVALS: u64 = 5;

/// The time that a node would use as master.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Origin {
    /// Its own, which the others follow.
    Own,
    /// The others' time, as this node heard it.
    Heard,
    /// A new time, different from any that other nodes may have.
    New,
}

/// A master that is heard.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Followed {
    pub(super) node: NodeIndex,
    pub(super) incarnation: u64,
    pub(super) term: Term,
    pub(super) began: Term,
    pub(super) epoch: u64,
    pub(super) error_ns: u64,
    pub(super) heard_ns: u64,
    /// When it last answered this node, or said that it has followers; at first when it was found.
    answered_ns: u64,
    followed: bool,
    id: u64,
}

/// Election state of a node.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum ElectionState {
    /// Hears no master.
    Listening,
    Slave(Followed),
    /// Master of this term.
    Master(Term),
}

/// What a Sync changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum SyncOutcome {
    /// Late, a duplicate, or from a master that must yield.
    Ignored,
    /// From the master that this node follows.
    Followed,
    /// From another master, or another timeline of the same one: earlier measurements are void.
    Turned,
}

#[derive(Debug)]
pub(super) struct Election {
    own: NodeIndex,
    masters: Vec<NodeIndex>,
    interval_ns: u64,
    /// How long a master has to answer.
    deaf_ns: u64,
    /// How long a node must hear no time at all before it begins one; 0: its turn is enough.
    begins_after_ns: u64,
    /// A node that has not heard its master for this long turns to a later one, even if that has no followers yet.
    succeeded_after_ns: u64,
    state: ElectionState,
    /// Since when no master is heard, and which one was heard last.
    quiet_since_ns: u64,
    lost: Option<NodeIndex>,
    /// The highest term and epoch seen in any frame.
    highest: Term,
    highest_epoch: u64,
    /// When a node that has time last said that it hears no master.
    timed_heard_ns: Option<u64>,
    /// Until when unverified frames are a reason to wait: their sender may be alive and have time.
    overheard_ns: u64,
    /// Once unverified frames are no reason to wait any more: the extra distance between two nodes that begin a time;
    /// else 0.
    apart_ns: u64,
    /// This node was stalled before this moment.
    awake_since_ns: u64,
}

impl Election {
    pub(super) fn new(own: NodeIndex, masters: Vec<NodeIndex>, interval_ns: u64, now_ns: u64) -> Self {
        Self {
            own,
            masters,
            interval_ns,
            deaf_ns: DEAF_NS_MIN,
            begins_after_ns: 0,
            succeeded_after_ns: u64::MAX,
            state: ElectionState::Listening,
            quiet_since_ns: now_ns,
            lost: None,
            highest: Term::NONE,
            highest_epoch: 0,
            timed_heard_ns: None,
            overheard_ns: 0,
            apart_ns: 0,
            awake_since_ns: 0,
        }
    }

    /// Sets the delays that depend on slots. A slave needs `intervals` to ask; request and reply wait for slots, so a
    /// master must not be replaced earlier for not answering. A new time begins only after no time was heard for long
    /// enough. A successor sends before the silence of its master is over.
    pub(super) fn asks_after(&mut self, intervals: u64, asks_every_ns: u64) {
        self.succeeded_after_ns = self.interval_ns.saturating_mul(SUCCEEDED_HALF_INTERVALS) / 2;
        let asks_ns = self.interval_ns.saturating_mul(2 * intervals);
        self.deaf_ns = DEAF_NS_MIN.max(asks_ns).max(asks_every_ns.saturating_mul(DEAF_SLOTS));
        self.begins_after_ns = BEGINS_AFTER_NS.saturating_add(self.interval_ns.saturating_mul(intervals));
    }

    pub(super) fn state(&self) -> ElectionState {
        self.state
    }

    pub(super) fn masters(&self) -> &[NodeIndex] {
        &self.masters
    }

    pub(super) fn highest_epoch(&self) -> u64 {
        self.highest_epoch
    }

    fn rank(&self) -> Option<u8> {
        self.rank_of(self.own)
    }

    fn rank_of(&self, node: NodeIndex) -> Option<u8> {
        let rank = self.masters.iter().position(|master| *master == node)?;
        u8::try_from(rank).ok()
    }

    /// Whether another node may act for the master of a term.
    pub(super) fn stands_in(&self, node: NodeIndex, term: Term) -> bool {
        self.rank_of(node).is_some_and(|rank| rank != term.rank())
    }

    /// Whether this node's turn in an interval comes after that of the master of a term.
    pub(super) fn stands_behind(&self, term: Term) -> bool {
        self.rank().is_some_and(|rank| rank > term.rank())
    }

    /// How many other nodes replace a master before this node does.
    pub(super) fn before(&self, last: Option<NodeIndex>) -> usize {
        let before = self.masters.iter().take_while(|master| **master != self.own);
        before.filter(|master| Some(**master) != last).count()
    }

    /// Whether a master that was last heard then had time to show that it has followers, and did not.
    pub(super) fn is_succeeded(&self, master: &Followed, now_ns: u64) -> bool {
        now_ns.saturating_sub(master.heard_ns) >= self.succeeded_after_ns
    }

    pub(super) fn silence_ns(&self) -> u64 {
        self.interval_ns.saturating_mul(TAKEOVER_HALF_INTERVALS) / 2
    }

    /// Handles a master's Sync. `followed`: whether slaves would answer this node if it were master.
    pub(super) fn sync(
        &mut self,
        from: NodeIndex,
        incarnation: u64,
        sync: &Sync,
        received_ns: u64,
        followed: bool,
    ) -> SyncOutcome {
        self.speaks_of(sync.term, sync.epoch);
        if self.masters.get(usize::from(sync.term.rank())) != Some(&from) {
            return SyncOutcome::Ignored;
        }
        let (term, began, epoch) = (sync.term, sync.began, sync.epoch);
        let (error_ns, id) = (sync.error_ns, sync.id);
        let theirs = Followed {
            node: from,
            incarnation,
            term,
            began,
            epoch,
            error_ns,
            heard_ns: received_ns,
            answered_ns: received_ns,
            followed: sync.followed,
            id,
        };
        let heard = match self.state {
            ElectionState::Listening => SyncOutcome::Turned,
            ElectionState::Master(own) if theirs.claim() > (followed, own) => SyncOutcome::Turned,
            ElectionState::Master(own) => {
                // The other will yield. A higher own term: no node that heard the other takes this one for older.
                if let (true, Some(rank)) = (theirs.term > own, self.rank()) {
                    self.state = ElectionState::Master(self.next_term(rank));
                }
                SyncOutcome::Ignored
            }
            ElectionState::Slave(master) if (master.node, master.incarnation) == (from, incarnation) => {
                if id <= master.id || term < master.term {
                    SyncOutcome::Ignored
                } else if began != master.began {
                    SyncOutcome::Turned
                } else {
                    SyncOutcome::Followed
                }
            }
            ElectionState::Slave(master) if theirs.claim() > master.claim() => SyncOutcome::Turned,
            ElectionState::Slave(master) if theirs.term > master.term && self.is_succeeded(&master, received_ns) => {
                SyncOutcome::Turned
            }
            ElectionState::Slave(_) => SyncOutcome::Ignored,
        };
        match (heard, self.state) {
            (SyncOutcome::Ignored, _) => {}
            (SyncOutcome::Followed, ElectionState::Slave(before)) if !sync.followed => {
                self.state = ElectionState::Slave(Followed { answered_ns: before.answered_ns, ..theirs });
            }
            _ => self.state = ElectionState::Slave(theirs),
        }
        heard
    }

    /// The master's answer repeats, more recently, what its Sync said.
    pub(super) fn reply(&mut self, epoch: u64, error_ns: u64, received_ns: u64) {
        if let ElectionState::Slave(master) = &mut self.state {
            (master.epoch, master.error_ns, master.answered_ns) = (master.epoch.max(epoch), error_ns, received_ns);
        }
    }

    /// A frame other than a Sync came. If it is from this node's master: when that was last heard, local ns.
    pub(super) fn speaks(&mut self, from: NodeIndex, incarnation: u64, received_ns: u64) -> Option<u64> {
        match &mut self.state {
            ElectionState::Slave(master) if (master.node, master.incarnation) == (from, incarnation) => {
                master.heard_ns = master.heard_ns.max(received_ns);
                Some(master.heard_ns)
            }
            _ => None,
        }
    }

    /// A node reports that it hears no master.
    pub(super) fn hello(&mut self, request: &Request, received_ns: u64) {
        self.is_told(request);
        if request.timed {
            self.timed_heard_ns = Some(received_ns);
        }
    }

    /// A node asks and names its term. A master with an older term begins another, so that its term is the latest.
    pub(super) fn is_told(&mut self, request: &Request) {
        self.speaks_of(request.term, request.epoch);
        if let (ElectionState::Master(own), Some(rank)) = (self.state, self.rank())
            && request.term > own
        {
            self.state = ElectionState::Master(self.next_term(rank));
        }
    }

    /// After a stall frames of others may still be in the socket. A wait before a new time is extended by the stall.
    pub(super) fn awakes(&mut self, stood_since_ns: u64, now_ns: u64) {
        self.awake_since_ns = now_ns;
        let stood_ns = now_ns.saturating_sub(stood_since_ns);
        for since_ns in std::iter::once(&mut self.quiet_since_ns).chain(&mut self.timed_heard_ns) {
            // A wait that lies in the future does not end sooner.
            *since_ns = since_ns.saturating_add(stood_ns).min(now_ns.max(*since_ns));
        }
    }

    /// Whether this node is a master that was stalled so long that others may have begun another time, perhaps in new
    /// incarnations; with keys this node hears these only after a handshake.
    pub(super) fn may_be_forgotten(&self, stood_ns: u64) -> bool {
        let is_alone = self.masters.len() < 2;
        matches!(self.state, ElectionState::Master(_)) && !is_alone && stood_ns > self.begins_after_ns
    }

    /// Another node that has time sent in place of the master.
    pub(super) fn replaced(&mut self, received_ns: u64) {
        self.timed_heard_ns = Some(received_ns);
    }

    /// An unverified frame came: its sender may be alive.
    pub(super) fn overhears(&mut self, overheard: &UnverifiedPeers) {
        (self.overheard_ns, self.apart_ns) = (overheard.until_ns(), overheard.apart_ns());
    }

    /// Whether this node, as a master, would yield to a Sync if its sender is verified.
    pub(super) fn would_yield(&self, from: NodeIndex, sync: &Sync, followed: bool) -> bool {
        let is_masters = self.masters.get(usize::from(sync.term.rank())) == Some(&from) && !sync.replacement;
        matches!(self.state, ElectionState::Master(own) if is_masters && (sync.followed, sync.term) > (followed, own))
    }

    /// This node is no master any more, and hears none.
    pub(super) fn steps_back(&mut self, now_ns: u64) {
        (self.state, self.quiet_since_ns, self.lost) = (ElectionState::Listening, now_ns, None);
    }

    /// Whether this node must wait before it listens.
    pub(super) fn waits(&self, now_ns: u64) -> bool {
        self.state == ElectionState::Listening && self.quiet_since_ns > now_ns
    }

    /// The wait is over: it listens from now on.
    pub(super) fn waits_no_longer(&mut self, now_ns: u64) {
        self.quiet_since_ns = self.quiet_since_ns.min(now_ns);
    }

    pub(super) fn speaks_of(&mut self, term: Term, epoch: u64) {
        self.highest = self.highest.max(term);
        self.highest_epoch = self.highest_epoch.max(epoch);
    }

    fn next_term(&mut self, rank: u8) -> Term {
        let own = if let ElectionState::Master(own) = self.state { own } else { Term::NONE };
        let next = Term::new(self.highest.max(own).round().saturating_add(1), rank);
        self.highest = next;
        next
    }

    /// Whether the master that this node follows fell silent.
    pub(super) fn falls_silent(&mut self, now_ns: u64) -> bool {
        let ElectionState::Slave(master) = self.state else { return false };
        let heard_ns = master.heard_ns.max(self.awake_since_ns);
        let silent = now_ns.saturating_sub(heard_ns) >= self.silence_ns();
        if silent {
            self.state = ElectionState::Listening;
            (self.quiet_since_ns, self.lost) = (heard_ns, Some(master.node));
        }
        silent
    }

    /// Takes over if it is this node's turn.
    pub(super) fn takes_over(&mut self, now_ns: u64, origin: Origin) -> Option<Term> {
        if self.takeover_ns(now_ns, origin)? > now_ns {
            return None;
        }
        self.succeeds()
    }

    /// Takes over without a check: the caller knows that it is this node's turn.
    pub(super) fn succeeds(&mut self) -> Option<Term> {
        let term = self.next_term(self.rank()?);
        self.state = ElectionState::Master(term);
        Some(term)
    }

    /// When the state changes without a datagram.
    pub(super) fn deadline_ns(&self, now_ns: u64, origin: Origin) -> Option<u64> {
        let takeover_ns = self.takeover_ns(now_ns, origin);
        match self.state {
            ElectionState::Slave(master) => {
                let heard_ns = master.heard_ns.max(self.awake_since_ns);
                let silent_ns = heard_ns.saturating_add(self.silence_ns());
                Some(takeover_ns.map_or(silent_ns, |takeover_ns| takeover_ns.min(silent_ns)))
            }
            ElectionState::Listening | ElectionState::Master(_) => takeover_ns,
        }
    }

    /// When it is this node's turn. A master that is heard but answers nobody is deaf, and is replaced as well.
    fn takeover_ns(&self, now_ns: u64, origin: Origin) -> Option<u64> {
        self.rank()?;
        let (since_ns, patience_ns, last) = match self.state {
            ElectionState::Listening => (self.quiet_since_ns, self.silence_ns(), self.lost),
            ElectionState::Slave(of) => (of.answered_ns, self.silence_ns().max(self.deaf_ns), Some(of.node)),
            ElectionState::Master(_) => return None,
        };
        // A node without time waits for one that has time.
        let recently_ns = self.interval_ns.saturating_mul(4);
        let others_timed = self.timed_heard_ns.is_some_and(|heard| now_ns.saturating_sub(heard) < recently_ns);
        let waits = if others_timed && origin != Origin::Own { self.masters.len() } else { 0 };
        // A node that cannot hear others until they are verified lets a node that began earlier finish the handshake.
        let is_deaf = (origin, self.state) == (Origin::New, ElectionState::Listening) && self.apart_ns > 0;
        let apart_ns = if is_deaf { self.apart_ns.saturating_add(self.begins_after_ns) } else { self.interval_ns };
        let staggered_ns = self.interval_ns.saturating_mul(waits as u64);
        let staggered_ns = staggered_ns.saturating_add(apart_ns.saturating_mul(self.before(last) as u64));
        let takes_over_ns = since_ns.max(self.awake_since_ns).saturating_add(patience_ns);
        let begins_ns = match (origin, self.begins_after_ns, self.state) {
            (Origin::Own | Origin::Heard, _, _) | (_, 0, _) => 0,
            (Origin::New, begins_ns, ElectionState::Slave(master)) => master.heard_ns.saturating_add(begins_ns),
            (Origin::New, begins_ns, _) => {
                let heard_ns = self.timed_heard_ns.unwrap_or(0).max(self.overheard_ns);
                since_ns.max(heard_ns).saturating_add(begins_ns)
            }
        };
        Some(takes_over_ns.max(begins_ns).saturating_add(staggered_ns))
    }
}

impl Followed {
    /// The greater claim is the master. A master without followers may be deaf.
    fn claim(&self) -> (bool, Term) {
        (self.followed, self.term)
    }
}
