//! Who is master: the order, the silence after which the next takes over, and which of two masters yields.

use super::message::{Request, Sync};
use super::unverified::UnverifiedPeers;
use super::{TAKEOVER_HALF_INTERVALS, Term};
use crate::broken::broken;
use crate::frame::NodeIndex;

/// So long a master is given at least to answer: it takes an exchange, and some of its datagrams may be lost.
const DEAF_NS_MIN: u64 = 200_000_000;
/// The same in slots of who asks and who answers.
const DEAF_SLOTS: u64 = 4;
/// In time slots others may be unheard for so long since the last frame was due, and send by a time that they have.
const BEGINS_AFTER_NS: u64 = 100_000_000;
/// In time slots a master that misses three Syncs has a successor in the third cycle: one that misses two may still be heard.
const SUCCEEDED_HALF_INTERVALS: u64 = 5;

/// By what time a node would reign.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Origin {
    /// Its own, which is that of the others.
    Own,
    /// That of the others, as it heard it.
    Heard,
    /// One that nobody else may have.
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
    /// When it last answered this node, or said that it is followed; at first when it was found.
    answered_ns: u64,
    followed: bool,
    id: u64,
}

/// What a node is at the moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum State {
    /// Hears no master.
    Listening,
    Slave(Followed),
    /// Master of this term.
    Master(Term),
}

/// What a Sync changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Heard {
    /// Late, twice, or of a master that must yield.
    Ignored,
    /// Of the master that this node follows.
    Followed,
    /// Of another master, or another timeline of the same: what was measured before does not count any more.
    Turned,
}

#[derive(Debug)]
pub(super) struct Election {
    own: NodeIndex,
    masters: Vec<NodeIndex>,
    interval_ns: u64,
    /// So long a master is given to answer.
    deaf_ns: u64,
    /// Who would begin a time hears nobody that has one for so long before; 0: its turn is enough.
    begins_after_ns: u64,
    /// Whoever has not heard its master for so long turns to a later one, though nobody may follow that yet.
    succeeded_after_ns: u64,
    state: State,
    /// Since when no master is heard, and who was the last.
    quiet_since_ns: u64,
    lost: Option<NodeIndex>,
    /// The highest term and epoch that anybody spoke of.
    highest: Term,
    highest_epoch: u64,
    /// When somebody that has time said that it hears no master.
    timed_heard_ns: Option<u64>,
    /// Until when somebody was heard that may have time, if it lives: as long as that is a reason to wait.
    overheard_ns: u64,
    /// As long as it was no reason to wait any more: who begins a time does so this much after who could before it; else 0.
    apart_ns: u64,
    /// This node stood still before.
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
            state: State::Listening,
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

    /// A slave takes so many intervals until it asks, and it asks and is answered in slots, which come this often: a master must not be replaced
    /// before that for not having answered. A time begins only where for so long nobody that has one was heard. A successor speaks before the silence of its master is over.
    pub(super) fn asks_after(&mut self, intervals: u64, asks_every_ns: u64) {
        self.succeeded_after_ns = self.interval_ns.saturating_mul(SUCCEEDED_HALF_INTERVALS) / 2;
        let asks_ns = self.interval_ns.saturating_mul(2 * intervals);
        self.deaf_ns = DEAF_NS_MIN.max(asks_ns).max(asks_every_ns.saturating_mul(DEAF_SLOTS));
        self.begins_after_ns = BEGINS_AFTER_NS.saturating_add(self.interval_ns.saturating_mul(intervals));
    }

    pub(super) fn state(&self) -> State {
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

    /// Whether somebody else may act for the master of a term.
    pub(super) fn stands_in(&self, node: NodeIndex, term: Term) -> bool {
        self.rank_of(node).is_some_and(|rank| rank != term.rank())
    }

    /// Whether this node's turn in an interval comes after that of the master of a term.
    pub(super) fn stands_behind(&self, term: Term) -> bool {
        self.rank().is_some_and(|rank| rank > term.rank())
    }

    /// How many others would take the place of a master before this node does.
    pub(super) fn before(&self, last: Option<NodeIndex>) -> usize {
        let before = self.masters.iter().take_while(|master| **master != self.own);
        before.filter(|master| Some(**master) != last).count()
    }

    /// Whether a master that was heard last then has had the time to tell, and has not.
    pub(super) fn is_succeeded(&self, master: &Followed, now_ns: u64) -> bool {
        now_ns.saturating_sub(master.heard_ns) >= self.succeeded_after_ns
    }

    pub(super) fn silence_ns(&self) -> u64 {
        self.interval_ns.saturating_mul(TAKEOVER_HALF_INTERVALS) / 2
    }

    /// A master's Sync. `followed`: whether slaves answer this node, should it be a master itself.
    pub(super) fn sync(
        &mut self,
        from: NodeIndex,
        incarnation: u64,
        sync: &Sync,
        received_ns: u64,
        followed: bool,
    ) -> Heard {
        self.speaks_of(sync.term, sync.epoch);
        if self.masters.get(usize::from(sync.term.rank())) != Some(&from) {
            return Heard::Ignored;
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
            State::Listening => Heard::Turned,
            State::Master(own) if theirs.claim() > (followed, own) => Heard::Turned,
            State::Master(own) => {
                // It will yield. So that nobody who heard it takes this term for an older one, this becomes the later.
                if let (true, Some(rank)) = (theirs.term > own, self.rank()) {
                    self.state = State::Master(self.next_term(rank));
                }
                Heard::Ignored
            }
            State::Slave(master) if (master.node, master.incarnation) == (from, incarnation) => {
                if id <= master.id || term < master.term {
                    Heard::Ignored
                } else if began != master.began {
                    Heard::Turned
                } else {
                    Heard::Followed
                }
            }
            State::Slave(master) if theirs.claim() > master.claim() => Heard::Turned,
            State::Slave(master) if theirs.term > master.term && self.is_succeeded(&master, received_ns) => {
                Heard::Turned
            }
            State::Slave(_) => Heard::Ignored,
        };
        match (heard, self.state) {
            (Heard::Ignored, _) => {}
            (Heard::Followed, State::Slave(before)) if !sync.followed => {
                self.state = State::Slave(Followed { answered_ns: before.answered_ns, ..theirs });
            }
            _ => self.state = State::Slave(theirs),
        }
        heard
    }

    /// The master's answer says more lately what its Sync said.
    pub(super) fn reply(&mut self, epoch: u64, error_ns: u64, received_ns: u64) {
        if let State::Slave(master) = &mut self.state {
            (master.epoch, master.error_ns, master.answered_ns) = (master.epoch.max(epoch), error_ns, received_ns);
        }
    }

    /// Something else came than a Sync. If it was of the master that this node follows: when that was heard last, local ns.
    pub(super) fn speaks(&mut self, from: NodeIndex, incarnation: u64, received_ns: u64) -> Option<u64> {
        match &mut self.state {
            State::Slave(master) if (master.node, master.incarnation) == (from, incarnation) => {
                master.heard_ns = master.heard_ns.max(received_ns);
                Some(master.heard_ns)
            }
            _ => None,
        }
    }

    /// Somebody that hears no master.
    pub(super) fn hello(&mut self, request: &Request, received_ns: u64) {
        self.is_told(request);
        if request.timed {
            self.timed_heard_ns = Some(received_ns);
        }
    }

    /// Somebody asks, and says by which term it goes. A master whose term is not the latest begins another, so that all take it for the
    /// latest.
    pub(super) fn is_told(&mut self, request: &Request) {
        self.speaks_of(request.term, request.epoch);
        if let (State::Master(own), Some(rank)) = (self.state, self.rank())
            && request.term > own
        {
            self.state = State::Master(self.next_term(rank));
        }
    }

    /// This node stood still until now: that it heard nobody says nothing of the others. What they sent is still to be read. Who waits to
    /// begin a time has waited so much less.
    pub(super) fn awakes(&mut self, stood_since_ns: u64, now_ns: u64) {
        self.awake_since_ns = now_ns;
        let stood_ns = now_ns.saturating_sub(stood_since_ns);
        for since_ns in std::iter::once(&mut self.quiet_since_ns).chain(&mut self.timed_heard_ns) {
            // Who must not speak before a time that comes does not sooner.
            *since_ns = since_ns.saturating_add(stood_ns).min(now_ns.max(*since_ns));
        }
    }

    /// Whether this node is a master that stood still for so long that others may have begun another time meanwhile. They may have done so in new
    /// lives; with keys this node does not hear these before they have greeted each other.
    pub(super) fn may_be_forgotten(&self, stood_ns: u64) -> bool {
        let is_alone = self.masters.len() < 2;
        matches!(self.state, State::Master(_)) && !is_alone && stood_ns > self.begins_after_ns
    }

    /// Somebody that has time sent in the place of the master.
    pub(super) fn replaced(&mut self, received_ns: u64) {
        self.timed_heard_ns = Some(received_ns);
    }

    /// Somebody was heard that may live.
    pub(super) fn overhears(&mut self, overheard: &UnverifiedPeers) {
        (self.overheard_ns, self.apart_ns) = (overheard.until_ns(), overheard.apart_ns());
    }

    /// Whether this node, as a master, would yield to a Sync if its sender is known to live.
    pub(super) fn would_yield(&self, from: NodeIndex, sync: &Sync, followed: bool) -> bool {
        let is_masters = self.masters.get(usize::from(sync.term.rank())) == Some(&from) && !sync.replacement;
        matches!(self.state, State::Master(own) if is_masters && (sync.followed, sync.term) > (followed, own))
    }

    /// It is no master any more, and hears none.
    pub(super) fn steps_back(&mut self, now_ns: u64) {
        (self.state, self.quiet_since_ns, self.lost) = (State::Listening, now_ns, None);
    }

    /// Whether it begins to listen only at some time to come.
    pub(super) fn waits(&self, now_ns: u64) -> bool {
        self.state == State::Listening && self.quiet_since_ns > now_ns
    }

    /// Nothing keeps it from speaking any more: it listens from now on.
    pub(super) fn waits_no_longer(&mut self, now_ns: u64) {
        self.quiet_since_ns = self.quiet_since_ns.min(now_ns);
    }

    pub(super) fn speaks_of(&mut self, term: Term, epoch: u64) {
        self.highest = self.highest.max(term);
        self.highest_epoch = self.highest_epoch.max(epoch);
    }

    fn next_term(&mut self, rank: u8) -> Term {
        let own = if let State::Master(own) = self.state { own } else { Term::NONE };
        let next = Term::new(self.highest.max(own).round().saturating_add(1), rank);
        self.highest = next;
        next
    }

    /// Whether the master that this node follows fell silent.
    pub(super) fn falls_silent(&mut self, now_ns: u64) -> bool {
        let State::Slave(master) = self.state else { return false };
        let heard_ns = master.heard_ns.max(self.awake_since_ns);
        let silent = now_ns.saturating_sub(heard_ns) >= self.silence_ns();
        if silent {
            self.state = State::Listening;
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

    /// Takes over: it is known to be this node's turn.
    pub(super) fn succeeds(&mut self) -> Option<Term> {
        let term = self.next_term(self.rank()?);
        self.state = State::Master(term);
        Some(term)
    }

    /// When something changes without a datagram.
    pub(super) fn deadline_ns(&self, now_ns: u64, origin: Origin) -> Option<u64> {
        let takeover_ns = self.takeover_ns(now_ns, origin);
        match self.state {
            State::Slave(master) => {
                let heard_ns = master.heard_ns.max(self.awake_since_ns);
                let silent_ns = heard_ns.saturating_add(self.silence_ns());
                Some(takeover_ns.map_or(silent_ns, |takeover_ns| takeover_ns.min(silent_ns)))
            }
            State::Listening | State::Master(_) => takeover_ns,
        }
    }

    /// When it is this node's turn. A master that is heard, but answers nobody, hears nobody: it has to be replaced as well.
    fn takeover_ns(&self, now_ns: u64, origin: Origin) -> Option<u64> {
        self.rank()?;
        if broken!(BeginsAtOnce) && (origin, self.state) == (Origin::New, State::Listening) {
            return Some(now_ns);
        }
        let (since_ns, patience_ns, last) = match self.state {
            State::Listening => (self.quiet_since_ns, self.silence_ns(), self.lost),
            State::Slave(master) => (master.answered_ns, self.silence_ns().max(self.deaf_ns), Some(master.node)),
            State::Master(_) => return None,
        };
        // Who has no time leaves it to who has, as long as there is one.
        let recently_ns = self.interval_ns.saturating_mul(4);
        let others_timed = self.timed_heard_ns.is_some_and(|heard| now_ns.saturating_sub(heard) < recently_ns);
        let waits = if others_timed && origin != Origin::Own { self.masters.len() } else { 0 };
        // Who is deaf to others until they are known to live leaves the time to get known to who begins before it.
        let is_deaf = (origin, self.state) == (Origin::New, State::Listening) && self.apart_ns > 0;
        let apart_ns = if is_deaf { self.apart_ns.saturating_add(self.begins_after_ns) } else { self.interval_ns };
        let staggered_ns = self.interval_ns.saturating_mul(waits as u64);
        let staggered_ns = staggered_ns.saturating_add(apart_ns.saturating_mul(self.before(last) as u64));
        let takes_over_ns = since_ns.max(self.awake_since_ns).saturating_add(patience_ns);
        let begins_ns = match (origin, self.begins_after_ns, self.state) {
            (Origin::Own | Origin::Heard, _, _) | (_, 0, _) => 0,
            (Origin::New, begins_ns, State::Slave(master)) => master.heard_ns.saturating_add(begins_ns),
            (Origin::New, begins_ns, _) => {
                let heard_ns = self.timed_heard_ns.unwrap_or(0).max(self.overheard_ns);
                since_ns.max(heard_ns).saturating_add(begins_ns)
            }
        };
        Some(takes_over_ns.max(begins_ns).saturating_add(staggered_ns))
    }
}

impl Followed {
    /// Who has the greater one is the master. A master that nobody follows may be one that hears nobody.
    fn claim(&self) -> (bool, Term) {
        (self.followed, self.term)
    }
}
