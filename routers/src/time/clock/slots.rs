//! A clock in time slots: the caller asks window by window what to send, and the interval is the cycle.
//!
//! Syncs leave in the master's synchronisation window alone. Requests wait for a slot of the slave, Replies for the
//! master's next window. So a Request may leave a cycle or more after its Sync. Both clocks drift meanwhile, and the
//! sample's interval includes that drift.

use super::{Clock, Draft};
use crate::frame::{FrameHead, NodeIndex};
use crate::stats::Stats;
use crate::time::clock_model::EVEN_PPB;
use crate::time::coarse::Coarse;
use crate::time::election::{ElectionState, Followed, Origin};
use crate::time::message::{Request, Sync};
use crate::time::unverified::UnverifiedPeers;
use crate::time::{Ignored, InSlots, JOINING_SYNCS, Stamp, Step, SyncCounts, TIME_BYTES, Term, TimeEstimate};
use rohrpost_mailbox::TimeRecord;

/// Cycles in which a master with a new or heard time sends only Syncs, so that nodes with another time hear of it.
const BEGINNING_CYCLES: u8 = JOINING_SYNCS;

/// Syncs in a row that a master misses before another node takes its place.
const MISSES: u64 = 3;

/// Cycles and slots of this node in which another configuration's time may continue when this one has the greater
/// claim. A node that hears this one has yielded by then.
const OTHERS_CYCLES: u64 = 2 * JOINING_SYNCS as u64;
const OTHERS_SLOTS: u64 = 2;

const MS: u64 = 1_000_000;

/// Which datagrams of time may leave now.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Allowed {
    /// None: only roles, page and bound advance.
    Nothing,
    /// In a slot of this node: Requests and Replies.
    Slot,
    /// In this node's synchronisation window.
    Synchronisation {
        /// Of this cycle.
        cycle: u64,
        /// When the window begins, system ns.
        nominal_ns: u64,
    },
}

/// State of a clock that exists only in time slots.
#[derive(Debug)]
pub(super) struct SlotClock {
    pub(super) settings: InSlots,
    coarse: Coarse,
    /// Frames of nodes that may not be alive any more.
    pub(super) overheard: UnverifiedPeers,
    counts: SyncCounts,
    /// The page does not follow the present master yet, since that one is not measured.
    pub(super) unsure: bool,
    /// The master's own error against an earlier term when the page was made, ns. Its followers share it.
    master_error_ns: u64,
    /// The last cycle with a Sync of the master, and the last with any Sync.
    heard_cycle: u64,
    lives_cycle: u64,
    /// The last cycle with another frame of the master.
    spoke_cycle: u64,
    /// This node woke up in this cycle: it knows nothing of those before.
    awake_cycle: u64,
    /// The cycle in synchronisation, the next receiver, and whether its warm-up was sent.
    synced_cycle: u64,
    next: usize,
    is_warm: bool,
    /// Cycles left in which this node sends only Syncs.
    pub(super) beginning: u8,
    /// When this node last ran, local ns.
    advanced_ns: u64,
}

impl SlotClock {
    /// The page follows the master's time, which may be this far off that of an earlier term.
    pub(super) fn goes_by(&mut self, master_error_ns: u64) {
        (self.unsure, self.master_error_ns) = (false, master_error_ns);
    }

    /// Forgets what was heard of the time.
    pub(super) fn goes_by_nobody(&mut self) {
        self.coarse.clear();
        self.overheard.forget();
    }

    /// This node is master; its time may be this far off that of an earlier term.
    pub(super) fn become_master(&mut self, error_ns: u64, origin: Origin) {
        self.goes_by(error_ns);
        self.beginning = if origin == Origin::Own { 0 } else { BEGINNING_CYCLES };
    }
}

/// What to send in a window.
impl Clock {
    /// From now on the clock sends only through [`Clock::poll_in`], by the rules of time slots. The interval is the
    /// cycle. For a new clock: it listens first, whatever its page says.
    pub fn in_slots(mut self, settings: InSlots) -> Self {
        self.election.asks_after(JOINING_SYNCS.into(), settings.asks_every_ns);
        let hears_ns = self.interval_ns.saturating_mul(OTHERS_CYCLES);
        self.others.gives(hears_ns.saturating_add(settings.slot_every_ns.saturating_mul(OTHERS_SLOTS)));
        // A node that hears no other restarts its terms, but above those of its earlier incarnation, which others may
        // still follow: a term lasts longer than a millisecond.
        if self.line.record().epoch > 0 {
            self.election.speaks_of(Term::new(self.hello_ns / MS, 0), 0);
        }
        self.slots = Some(Box::new(SlotClock {
            settings,
            coarse: Coarse::default(),
            overheard: UnverifiedPeers::new(self.settings.nodes, self.interval_ns, settings.hello_every_ns),
            counts: SyncCounts::default(),
            unsure: true,
            master_error_ns: 0,
            heard_cycle: 0,
            lives_cycle: 0,
            spoke_cycle: 0,
            awake_cycle: 0,
            synced_cycle: 0,
            next: 0,
            is_warm: false,
            beginning: 0,
            // Frames may be read before the first call: a stall lasts since the clock began, not since the computer
            // did.
            advanced_ns: self.hello_ns,
        }));
        self.forget();
        self
    }

    /// Like [`Clock::poll`], for a clock in time slots: what may leave now. Handle all received datagrams before: a
    /// backup master sends when it has not heard the master's Sync of this cycle. Datagrams that need another window
    /// are dropped.
    pub fn poll_in(&mut self, now_ns: u64, allowed: Allowed, datagram: &mut [u8; TIME_BYTES]) -> Step {
        self.advance(now_ns);
        if allowed == Allowed::Slot && self.drafts.is_empty() && self.election.state() == ElectionState::Listening {
            self.draft_hello(now_ns);
        }
        while let Some((to, draft)) = self.next_in(now_ns, allowed) {
            if let Some(stamp) = self.write(now_ns, to, draft, datagram) {
                return Step::Send { to, stamp };
            }
        }
        Step::Wait { until_ns: self.deadline_ns(now_ns) }
    }

    /// In time slots this node runs at least once a cycle, from the first call on.
    pub(super) fn stood_still(&mut self, now_ns: u64) {
        let cycle = self.line.at(now_ns).ns / self.interval_ns;
        let Some(slots) = &mut self.slots else { return };
        let before_ns = std::mem::replace(&mut slots.advanced_ns, now_ns);
        let stood_ns = now_ns.saturating_sub(before_ns);
        if stood_ns <= 2 * self.interval_ns {
            return;
        }
        slots.awake_cycle = cycle;
        self.election.awakes(before_ns, now_ns);
        slots.overheard.awakes(stood_ns);
        self.election.overhears(&slots.overheard);
        if self.election.may_be_forgotten(stood_ns) {
            self.step_back(now_ns);
        }
    }

    fn next_in(&mut self, now_ns: u64, allowed: Allowed) -> Option<(NodeIndex, Draft)> {
        let replies_wait = self.slots.as_ref()?.settings.replies_in_synchronisation;
        let is_reply = |draft: &Draft| matches!(draft, Draft::Reply { .. });
        match allowed {
            Allowed::Nothing => None,
            Allowed::Synchronisation { cycle, nominal_ns } => {
                self.next_sync(now_ns, cycle, nominal_ns).or_else(|| self.take_draft(is_reply))
            }
            Allowed::Slot => self.take_draft(|draft| !(replies_wait && is_reply(draft))),
        }
    }

    fn take_draft(&mut self, may_leave: impl Fn(&Draft) -> bool) -> Option<(NodeIndex, Draft)> {
        let at = self.drafts.iter().position(|(_, draft)| may_leave(draft))?;
        self.drafts.remove(at)
    }

    /// The next Sync of a cycle, or its warm-up; none when each node has got one.
    fn next_sync(&mut self, now_ns: u64, cycle: u64, nominal_ns: u64) -> Option<(NodeIndex, Draft)> {
        if self.slots.as_ref()?.synced_cycle != cycle {
            if !self.synchronises(cycle) {
                return None;
            }
            self.succeed(now_ns, cycle);
            let is_master = self.is_master();
            let slots = self.slots.as_mut()?;
            (slots.synced_cycle, slots.next, slots.is_warm) = (cycle, 0, false);
            slots.beginning = slots.beginning.saturating_sub(1);
            if slots.beginning == 0 {
                slots.overheard.forget();
                self.election.overhears(&slots.overheard);
            }
            *(if is_master { &mut slots.counts.sent } else { &mut slots.counts.replacements_sent }) += 1;
        }
        let is_master = self.is_master();
        let slots = self.slots.as_ref()?;
        let to = self.receiver(cycle, slots.next)?;
        let warms = slots.settings.warm_ups && is_master && !slots.is_warm;
        let warms = warms && self.answers(&self.slaves[usize::from(to)], now_ns);
        let slots = self.slots.as_mut()?;
        slots.is_warm = warms;
        if warms {
            return Some((to, Draft::WarmUp));
        }
        slots.next += 1;
        Some((to, if is_master { Draft::Sync { nominal_ns } } else { Draft::Replacement { nominal_ns } }))
    }

    /// A stand-in becomes master when enough Syncs are missing; the next in order before others.
    fn succeed(&mut self, now_ns: u64, cycle: u64) {
        let (ElectionState::Slave(master), Some(slots)) = (self.election.state(), &self.slots) else { return };
        let is_next = self.election.before(Some(master.node)) == 0;
        let heard_cycle = if is_next { slots.heard_cycle } else { slots.lives_cycle };
        let since_cycle = heard_cycle.max(slots.spoke_cycle).max(slots.awake_cycle);
        let misses = self.due_cycle(cycle, &master).saturating_sub(since_cycle);
        if misses < MISSES || self.sure(now_ns).is_none() {
            return;
        }
        if let Some(term) = self.election.succeeds() {
            self.become_master(now_ns, term, Origin::Own);
        }
    }

    /// The receiver at this place of a cycle. The first one changes each cycle, since it finds the wire empty.
    fn receiver(&self, cycle: u64, place: usize) -> Option<NodeIndex> {
        let (nodes, own) = (u64::from(self.settings.nodes), u64::from(self.settings.own));
        let others = nodes.saturating_sub(1);
        // Counted from this node on, without it.
        let after = (place as u64) < others;
        after.then(|| ((own + 1 + (place as u64 + cycle % others) % others) % nodes) as NodeIndex)
    }

    pub(super) fn write_replacement(&mut self, now_ns: u64, nominal_ns: u64) -> Option<Sync> {
        let ElectionState::Slave(master) = self.election.state() else { return None };
        self.last_id += 1;
        Some(Sync {
            id: self.last_id,
            cycle: nominal_ns / self.interval_ns,
            nominal_ns,
            sent_ns: self.line.at(now_ns).ns,
            error_ns: self.line.error_ns(now_ns),
            epoch: master.epoch,
            term: master.term,
            began: master.began,
            followed: false,
            replacement: true,
        })
    }
}

/// Received frames, as far as slots are concerned.
impl Clock {
    /// A Sync of this or a later master came: whether the present one lives, so that there are two.
    pub(super) fn is_contested(&self, received_ns: u64) -> bool {
        match self.election.state() {
            ElectionState::Listening => false,
            ElectionState::Slave(master) => !self.election.is_succeeded(&master, received_ns),
            ElectionState::Master(_) => true,
        }
    }

    /// A Sync was accepted.
    pub(super) fn heard_in_slots(&mut self, received: Stamp, sync: &Sync, contested: bool, turned: bool) {
        let Some(slots) = &mut self.slots else { return };
        slots.overheard.forget();
        self.election.overhears(&slots.overheard);
        if turned {
            slots.coarse.clear();
            (slots.heard_cycle, slots.spoke_cycle) = (0, 0);
        }
        // All followers of a master share its error.
        slots.coarse.add(sync.epoch, sync.sent_ns, received.ns, 0);
        // A master that is not measured may have another time. Sending by the old one would hit the slots of its
        // followers.
        let is_measured = self.timeline == sync.began;
        let off_ns = slots.coarse.off_ns(received.ns, self.line.at(received.ns).ns);
        let is_other = sync.epoch != self.line.record().epoch || off_ns > slots.settings.allowance_ns;
        slots.unsure |= contested || (!is_measured && is_other);
        slots.counts.heard += u64::from(sync.cycle != slots.heard_cycle);
        if slots.heard_cycle != 0 {
            slots.counts.missed += sync.cycle.saturating_sub(slots.heard_cycle).saturating_sub(1);
        }
        (slots.heard_cycle, slots.lives_cycle) = (sync.cycle, sync.cycle);
    }

    /// A frame other than a Sync came from a node, perhaps a package: the last of this incarnation at `received_ns`,
    /// local. A master that sends is alive even if its Syncs are missing. Matters in time slots alone.
    pub fn hears(&mut self, from: NodeIndex, incarnation: u64, received_ns: u64) {
        if let Some(slots) = &mut self.slots
            && let Some(heard_ns) = self.election.speaks(from, incarnation, received_ns)
        {
            slots.spoke_cycle = self.line.at(heard_ns).ns / self.interval_ns;
        }
    }

    /// The same for packages, from their counters, with now by their monotonic clock and by the clock of time.
    pub fn hears_by(&mut self, packages: &Stats, now_ns: u64, local_ns: u64) {
        self.refused_by(packages, now_ns, local_ns);
        let ElectionState::Slave(Followed { node, .. }) = self.election.state() else { return };
        let link = &packages.peer(node).link;
        let since_ns = now_ns.saturating_sub(link.heard_ns.get());
        self.hears(node, link.incarnation.get(), local_ns.saturating_sub(since_ns));
    }

    /// Another node hears no master either, and has time: a new master continues that time.
    pub(super) fn hello_in_slots(&mut self, received: Stamp, hello: &Request) {
        if let (Some(slots), ElectionState::Listening, true) = (&mut self.slots, self.election.state(), hello.timed) {
            slots.coarse.add(hello.epoch, hello.sent_ns, received.ns, hello.error_ns);
        }
    }

    /// Another node sent in the master's place: the cycle lives. The master still counts as unheard.
    pub(super) fn replaced(&mut self, received: Stamp, head: &FrameHead, sync: &Sync) -> Result<(), Ignored> {
        let (ElectionState::Slave(master), Some(slots)) = (self.election.state(), &mut self.slots) else {
            return Err(Ignored::Late);
        };
        if sync.term != master.term || !self.election.stands_in(head.from, sync.term) {
            return Err(Ignored::Late);
        }
        self.election.replaced(received.ns);
        slots.counts.replacements_heard += u64::from(sync.cycle != slots.lives_cycle);
        slots.lives_cycle = slots.lives_cycle.max(sync.cycle);
        Ok(())
    }
}

/// What a node in time slots follows.
impl Clock {
    /// The time by which a node in time slots sends. None without time, or before the present master has confirmed it.
    pub fn estimate(&self) -> Option<TimeEstimate> {
        let slots = self.slots.as_ref().filter(|slots| !slots.unsure && self.line.is_synchronised())?;
        let record = *self.line.record();
        let error_ns = record.error_ns.saturating_sub(slots.master_error_ns);
        Some(TimeEstimate::new(TimeRecord { error_ns, ..record }))
    }

    /// The present time, if its bound is small enough to send by it.
    pub(super) fn sure(&self, now_ns: u64) -> Option<TimeEstimate> {
        let allowance_ns = self.slots.as_ref()?.settings.allowance_ns;
        self.estimate().filter(|own| own.bound_ns(now_ns) <= allowance_ns)
    }

    /// The time that this node would use as master: the others' time, if it knows that well enough.
    pub(super) fn origin_in_slots(&self, slots: &SlotClock, now_ns: u64) -> Origin {
        let is_heard =
            || self.coarse(now_ns).is_some_and(|heard| heard.bound_ns(now_ns) <= slots.settings.allowance_ns);
        match self.sure(now_ns) {
            Some(_) => Origin::Own,
            None if is_heard() => Origin::Heard,
            None => Origin::New,
        }
    }

    /// The page takes over the time that was heard. A large difference is a step, but not back within an epoch.
    pub(super) fn take_up_heard(&mut self, now_ns: u64) {
        let Some((heard, slots)) = self.coarse(now_ns).zip(self.slots.as_ref()) else { return };
        let (epoch, system_ns) = (self.line.record().epoch, heard.system_ns(now_ns));
        let is_timed = self.line.is_synchronised();
        let off_ns = self.line.at(now_ns).ns.abs_diff(system_ns);
        if is_timed && epoch == heard.epoch() && off_ns <= slots.settings.allowance_ns {
            return;
        }
        // A node that lost its time must not go back within an epoch that it was in, either.
        let is_back = epoch == heard.epoch() && system_ns < self.line.at(now_ns).ns;
        let epoch = if (is_timed && epoch >= heard.epoch()) || is_back { epoch + 1 } else { heard.epoch() };
        self.line.step(now_ns, epoch, system_ns, EVEN_PPB, heard.bound_ns(now_ns), 0);
    }

    /// Whether this node is a master with a time that others may not follow yet: it sends only Syncs.
    pub fn is_beginning(&self) -> bool {
        self.is_master() && self.slots.as_ref().is_some_and(|slots| slots.beginning > 0)
    }

    /// The time by the last Syncs alone, good enough to send Requests. None if there are too few.
    pub fn coarse(&self, now_ns: u64) -> Option<TimeEstimate> {
        let slots = self.slots.as_ref()?;
        slots.coarse.estimate(now_ns, slots.settings.delay_max_ns)
    }

    /// How many Syncs of a master count for [`Clock::coarse`]; none if no master is heard.
    pub fn joining(&self) -> Option<u8> {
        let slots = self.slots.as_ref()?;
        matches!(self.election.state(), ElectionState::Slave(_)).then(|| slots.coarse.heard())
    }

    /// Whether this node may have to send in its synchronisation windows.
    pub fn may_synchronise(&self) -> bool {
        match self.election.state() {
            ElectionState::Master(_) => true,
            ElectionState::Slave(master) => self.election.stands_in(self.settings.own, master.term),
            ElectionState::Listening => false,
        }
    }

    /// Whether it must send in that window of this cycle: as the master, or because the master's Sync is missing.
    pub fn synchronises(&self, cycle: u64) -> bool {
        let is_missing = |master: &Followed| {
            let due_cycle = self.due_cycle(cycle, master);
            self.slots.as_ref().is_some_and(|slots| slots.lives_cycle < due_cycle)
        };
        match self.election.state() {
            ElectionState::Master(_) => true,
            ElectionState::Slave(master) => self.may_synchronise() && is_missing(&master),
            ElectionState::Listening => false,
        }
    }

    /// The last cycle with a Sync that is due before this node's own window of a cycle.
    fn due_cycle(&self, cycle: u64, master: &Followed) -> u64 {
        if self.election.stands_behind(master.term) { cycle } else { cycle.saturating_sub(1) }
    }

    fn is_master(&self) -> bool {
        matches!(self.election.state(), ElectionState::Master(_))
    }

    /// Counters of synchronisation in time slots.
    pub fn sync_counts(&self) -> SyncCounts {
        self.slots.as_ref().map(|slots| slots.counts).unwrap_or_default()
    }
}
