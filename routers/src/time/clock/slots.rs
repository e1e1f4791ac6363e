//! A clock in time slots: what it may send is asked of it window by window, and the interval is the cycle.

use super::Clock;
use crate::time::coarse::Coarse;
use crate::time::election::State;
use crate::time::{InSlots, Reckoning, Step, SyncCounts, TIME_BYTES};

/// What of time may leave now.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Allowed {
    /// Nothing: only what the passing of time does, with roles, page and bound.
    Nothing,
    /// It is a slot of this node: what asks and answers.
    Slot,
    /// It is the window of this node's synchronisation.
    Synchronisation {
        /// Of this cycle.
        cycle: u64,
        /// When the window begins, system ns.
        nominal_ns: u64,
    },
}

/// What a clock in time slots remembers besides.
#[derive(Debug)]
pub(super) struct Slots {
    pub(super) settings: InSlots,
    pub(super) coarse: Coarse,
    pub(super) counts: SyncCounts,
    /// The page goes by something else than what others go by now: a master that is not measured yet.
    pub(super) unsure: bool,
    /// What the master was off an earlier term when the page was made, ns: all its followers are so.
    pub(super) master_error_ns: u64,
    /// The last cycles of which a Sync of the master came, and any.
    pub(super) heard_cycle: u64,
    pub(super) lives_cycle: u64,
}

impl Clock {
    /// From now on it sends only what it is asked for with [`Clock::poll_in`], and goes by the rules of time slots. The interval is the cycle.
    /// For a clock that is new.
    pub fn in_slots(mut self, settings: InSlots) -> Self {
        self.slots = Some(Box::new(Slots {
            settings,
            coarse: Coarse::default(),
            counts: SyncCounts::default(),
            unsure: true,
            master_error_ns: 0,
            heard_cycle: 0,
            lives_cycle: 0,
        }));
        self
    }

    /// As [`Clock::poll`], of a clock in time slots: what may leave now. All that came is to be handed over before: a backup master
    /// sends when it has not heard the master's Sync of this cycle.
    pub fn poll_in(&mut self, now_ns: u64, allowed: Allowed, datagram: &mut [u8; TIME_BYTES]) -> Step {
        self.advance(now_ns);
        let _ = (allowed, datagram);
        Step::Wait { until_ns: self.deadline_ns(now_ns) }
    }

    /// By what a node in time slots goes. None if it has no time, or one that the present master has not confirmed.
    pub fn reckoning(&self, now_ns: u64) -> Option<Reckoning> {
        let slots = self.slots.as_ref().filter(|slots| !slots.unsure && self.line.is_synchronised())?;
        let _ = now_ns;
        let record = *self.line.record();
        let error_ns = record.error_ns.saturating_sub(slots.master_error_ns);
        Some(Reckoning::new(rohrpost_mailbox::TimeRecord { error_ns, ..record }))
    }

    /// The time by the last Syncs alone, good enough to ask for more. None if there are too few.
    pub fn coarse(&self, now_ns: u64) -> Option<Reckoning> {
        let slots = self.slots.as_ref()?;
        slots.coarse.reckoning(now_ns, slots.settings.delay_max_ns)
    }

    /// How many Syncs of a master count for [`Clock::coarse`]; none if no master is heard.
    pub fn joining(&self) -> Option<u8> {
        let slots = self.slots.as_ref()?;
        matches!(self.election.state(), State::Slave(_)).then(|| slots.coarse.heard())
    }

    /// Whether this node may have to send in its synchronisation windows.
    pub fn may_synchronise(&self) -> bool {
        match self.election.state() {
            State::Master(_) => true,
            State::Slave(master) => self.election.rank().is_some_and(|rank| rank > master.term.rank()),
            State::Listening => false,
        }
    }

    /// Whether it has to, in that of this cycle: as the master, or in place of one whose Sync has not come.
    pub fn synchronises(&self, cycle: u64) -> bool {
        let is_master = matches!(self.election.state(), State::Master(_));
        let is_missing = self.slots.as_ref().is_some_and(|slots| slots.lives_cycle < cycle);
        is_master || (is_missing && self.may_synchronise())
    }

    /// What was sent and heard of synchronisation in time slots.
    pub fn sync_counts(&self) -> SyncCounts {
        self.slots.as_ref().map(|slots| slots.counts).unwrap_or_default()
    }
}
