//! When this node sends, and why not.

use super::GATE_NS;
use super::lead::Lead;
use super::table::{SlotTable, UNPROVEN_CYCLES, Window, WindowKind};
use super::tx_window::{Carries, TransmitWindow};
use crate::frame::NodeIndex;
use crate::time::{Clock, JOINING_SYNCS, Role, Stamp, SyncCounts, TIME_BYTES, TimeEstimate, Unsteady};

/// The next event.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// A window of this node: see [`Planned`].
    Window(Planned),
    /// This node may not send; ask again then, or when a datagram of time has come.
    Silent {
        /// Why.
        why: Silent,
        /// Local ns.
        until_ns: u64,
    },
}

/// The next window, by the present clock. All but the window itself is local monotonic time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Planned {
    /// The window, in system time.
    pub window: Window,
    /// When to wake up, and to read received datagrams.
    pub wake_ns: u64,
    /// When to validate, and to hand over the first datagram: the lead before the beginning.
    pub call_ns: u64,
    /// The first local ns in it.
    pub begin_ns: u64,
    /// The last local ns before its guard.
    pub end_ns: u64,
    /// What the time of the plan is good enough for.
    pub carries: Carries,
}

/// Why a node does not send.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Silent {
    /// There are nodes of another configuration, so with another table; which, see [`Clock::parted_by`].
    #[error(
        "{} goes by another configuration, of digest {digest:016x} (this node's: {own:016x}); launch all nodes from \
         the same file",
        named(*node)
    )]
    OtherTable {
        /// One of them; none if no node has its address.
        node: Option<NodeIndex>,
        /// Its digest.
        digest: u64,
        /// This node's.
        own: u64,
    },
    /// Its clock broke its limits.
    #[error("nothing is known of the time: {0}")]
    Unsteady(Unsteady),
    /// It has no system time, and no master is heard.
    #[error("no system time, and no master is heard")]
    NoTime,
    /// It has no system time, and listens to a master.
    #[error("joining: {heard} of {JOINING_SYNCS} Syncs heard, then it measures")]
    Joining {
        /// Syncs that count, so far.
        heard: u8,
    },
    /// It has no system time, and hears unverified peers only.
    #[error("joining: hears the time from unverified routers, and asks whether they live")]
    Asking,
    /// It is master, with a time that others may not follow yet.
    #[error(
        "new master without system time of its own: in the first {JOINING_SYNCS} cycles it sends nothing but Syncs"
    )]
    Beginning,
    /// Its time may be too far off: no master was heard for too long, or the network is too slow for such a guard.
    #[error("its clock may be {bound_ns} ns off, and {allowance_ns} ns are allowed: half of the guard")]
    BoundTooLarge {
        /// Its error bound.
        bound_ns: u64,
        /// The largest bound that is allowed.
        allowance_ns: u64,
    },
    /// The table has no slot for it, and it has nothing to synchronise.
    #[error("no slot in the table")]
    NoSlot,
}

fn named(node: Option<NodeIndex>) -> String {
    node.map_or_else(|| "a node that this one does not know".into(), |node| format!("node number {node}"))
}

/// The decision on a window at its call.
#[derive(Clone, Debug)]
pub enum WindowVerdict {
    /// Use it.
    Send(TransmitWindow),
    /// The clock was slewed meanwhile, or the node follows another time: ask for the next window anew.
    Early,
    /// The wake-up came too late: another node's window is too near.
    Late,
    /// Nothing to send: a synchronisation window, and another master has synchronised.
    Idle,
    /// This node may not send.
    Silent(Silent),
}

/// Counters of this node's slots, and of synchronisation, since the start.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct SlotCounts {
    /// Slots in which something was sent.
    pub used: u64,
    /// Slots in which nothing had to be sent.
    pub empty: u64,
    /// Slots not used because the wake-up came too late.
    pub late: u64,
    /// Slots that passed without any wake-up: the thread was stalled.
    pub skipped: u64,
    /// Slots without packages because the time was not exact enough.
    pub silent: u64,
    /// Datagrams in slots and synchronisation windows.
    pub datagrams: u64,
    /// Bytes of these on the wire, with all headers.
    pub wire_bytes: u64,
    /// Hellos that left by the time of an unverified peer.
    pub unproven: u64,
    /// Synchronisation windows of the master not used because the wake-up came too late.
    pub synchronisations_late: u64,
    /// Changes of role.
    pub roles: u64,
    /// Counters of synchronisation.
    pub syncs: SyncCounts,
}

/// Decides when this node sends. Holds no clock: the caller passes it.
#[derive(Debug)]
pub struct SlotScheduler {
    table: SlotTable,
    spin_ns: u64,
    lead: Lead,
    counts: SlotCounts,
    role: Role,
    silent: Option<Silent>,
    /// Slots before this are counted, system time of this epoch; none without time.
    done: Option<(u64, u64)>,
    /// No hello leaves by an unverified time before this, local ns.
    hello_from_ns: u64,
}

impl SlotScheduler {
    /// `spin_ns`: the wake-up comes this much earlier, to spin until the call.
    pub fn new(table: SlotTable, spin_ns: u64) -> Self {
        Self {
            table,
            spin_ns,
            lead: Lead::default(),
            counts: SlotCounts::default(),
            role: Role::Listening,
            silent: Some(Silent::NoTime),
            done: None,
            hello_from_ns: 0,
        }
    }

    /// The slots.
    pub fn table(&self) -> &SlotTable {
        &self.table
    }

    /// Why this node does not send at present; none if it does.
    pub fn silent(&self) -> Option<Silent> {
        self.silent
    }

    /// Time from the call to the wire, ns: the median, and the lead.
    pub fn lead_ns(&self) -> (u64, u64) {
        (self.lead.median_ns(), self.lead.ns())
    }

    /// Counters of slots so far.
    pub fn counts(&self, clock: &Clock) -> SlotCounts {
        SlotCounts { syncs: clock.sync_counts(), ..self.counts }
    }

    /// Slots since the start without packages, though some may have waited.
    pub fn left_out(&self) -> u64 {
        let SlotCounts { late, skipped, silent, .. } = self.counts;
        late + skipped + silent
    }

    /// The next window of this node. Hand received datagrams to the clock before.
    pub fn next(&mut self, now_ns: u64, clock: &Clock) -> Next {
        if self.role != clock.role() {
            self.role = clock.role();
            self.counts.roles += 1;
        }
        let sure = self.reckon(now_ns, clock);
        let proven = sure.as_ref().ok().filter(|(_, carries)| *carries != Carries::Hello);
        let basis = proven.map(|(estimate, _)| *estimate);
        self.pass(now_ns, basis.or_else(|| clock.estimate()).or_else(|| clock.coarse(now_ns)), basis.is_some());
        let carries_all = matches!(sure, Ok((_, Carries::All)) | Err(_));
        self.silent = (!carries_all).then(|| self.why_silent(now_ns, clock));
        let planned = sure.and_then(|(estimate, carries)| {
            let from_ns = match (carries, self.done) {
                // Progress by another time does not apply to an unverified one.
                (Carries::Hello, _) => estimate.system_ns(now_ns.max(self.hello_from_ns)),
                (_, Some((_, done_ns))) => done_ns,
                (_, None) => estimate.system_ns(now_ns),
            };
            let window = self.next_window(from_ns, clock, carries);
            window.and_then(|window| self.plan(window, &estimate, carries)).ok_or(Silent::NoSlot)
        });
        match planned {
            Ok(planned) => Next::Window(planned),
            Err(why) => {
                self.silent = Some(why);
                Next::Silent { why, until_ns: now_ns.saturating_add(self.table.cycle_ns()) }
            }
        }
    }

    /// Whether a planned window may be used. Call it at the window's call time, after the clock has all received
    /// datagrams. Once for each window, unless it is early.
    pub fn validate(&mut self, planned: &Planned, now_ns: u64, clock: &Clock) -> WindowVerdict {
        let verdict = self.look(planned, now_ns, clock);
        let is_slot = matches!(planned.window.kind, WindowKind::Slot { .. });
        match &verdict {
            WindowVerdict::Early => return verdict,
            // A window of an unverified time does not count as progress by another.
            _ if planned.carries == Carries::Hello => {
                self.hello_from_ns = planned.end_ns;
                return verdict;
            }
            WindowVerdict::Late if is_slot => self.counts.late += 1,
            WindowVerdict::Late => self.counts.synchronisations_late += 1,
            WindowVerdict::Silent(_) if is_slot => self.counts.silent += 1,
            _ => {}
        }
        self.done = self.done.map(|(epoch, _)| (epoch, planned.window.begin_ns + 1));
        verdict
    }

    /// A window is over, or nothing is left to send.
    pub fn close(&mut self, tx_window: &TransmitWindow) {
        self.counts.datagrams += tx_window.datagrams();
        self.counts.wire_bytes += tx_window.wire_bytes();
        if tx_window.carries == Carries::Hello && tx_window.datagrams() > 0 {
            self.counts.unproven += 1;
            let pause_ns = UNPROVEN_CYCLES * self.table.cycle_ns();
            self.hello_from_ns = tx_window.begin_ns.saturating_add(pause_ns);
        }
        if let WindowKind::Slot { .. } = tx_window.window.kind {
            *match (tx_window.carries, tx_window.datagrams()) {
                (Carries::Time | Carries::Hello, _) => &mut self.counts.silent,
                (Carries::All, 0) => &mut self.counts.empty,
                (Carries::All, _) => &mut self.counts.used,
            } += 1;
        }
    }

    /// The first datagram of a window, handed over at `user_ns`, left then.
    pub fn left(&mut self, user_ns: u64, stamp: Stamp) {
        self.lead.add(user_ns, stamp);
    }

    /// The time that this node follows, and what it is good enough for.
    fn reckon(&self, now_ns: u64, clock: &Clock) -> Result<(TimeEstimate, Carries), Silent> {
        let allowance_ns = self.table.allowance_ns();
        let is_sure = |estimate: &TimeEstimate| estimate.bound_ns(now_ns) <= allowance_ns;
        let own = clock.estimate().filter(|own| is_sure(own));
        let coarse = || clock.coarse(now_ns).filter(is_sure).map(|coarse| (coarse, Carries::Time));
        let carries = if clock.is_beginning() { Carries::Time } else { Carries::All };
        let overheard = || clock.overheard(now_ns).map(|(_, estimate)| (estimate, Carries::Hello));
        let carries = own.map(|own| (own, carries)).or_else(coarse).or_else(overheard);
        carries.ok_or_else(|| self.why_silent(now_ns, clock))
    }

    /// Why this node does not follow its own time.
    fn why_silent(&self, now_ns: u64, clock: &Clock) -> Silent {
        if let Some(why) = clock.unsteady(now_ns) {
            return Silent::Unsteady(why);
        }
        if let Some((node, digest)) = clock.parted_by(now_ns).next() {
            return Silent::OtherTable { node, digest, own: clock.digest() };
        }
        match (clock.estimate(), clock.joining()) {
            _ if clock.is_beginning() => Silent::Beginning,
            (Some(own), _) => {
                Silent::BoundTooLarge { bound_ns: own.bound_ns(now_ns), allowance_ns: self.table.allowance_ns() }
            }
            (None, Some(heard)) => Silent::Joining { heard },
            (None, None) if clock.overheard(now_ns).is_some() => Silent::Asking,
            (None, None) => Silent::NoTime,
        }
    }

    /// Counts the slots that passed since the last call.
    fn pass(&mut self, now_ns: u64, basis: Option<TimeEstimate>, sure: bool) {
        let Some(estimate) = basis else {
            self.done = None;
            return;
        };
        let system_ns = estimate.system_ns(now_ns);
        let reached_ns = system_ns.saturating_sub(GATE_NS);
        let done_ns = match self.done {
            // A node that followed a master with a wrong time may have been far ahead.
            Some((epoch, done_ns))
                if epoch == estimate.epoch() && done_ns <= system_ns.saturating_add(self.table.cycle_ns()) =>
            {
                done_ns
            }
            // In another epoch the present window may be one that was used.
            _ => system_ns,
        };
        let passed = self.table.slots_between(done_ns, reached_ns);
        let was_silent = self.silent.is_some() || !sure;
        *(if was_silent { &mut self.counts.silent } else { &mut self.counts.skipped }) += passed;
        self.done = Some((estimate.epoch(), done_ns.max(reached_ns)));
    }

    /// Own synchronisation windows matter only to a node that may have to send in them.
    fn next_window(&self, from_ns: u64, clock: &Clock, carries: Carries) -> Option<Window> {
        if clock.is_beginning() {
            self.table.next_synchronisation(from_ns)
        } else if carries == Carries::All && clock.may_synchronise() {
            self.table.next_window(from_ns)
        } else {
            self.table.next_slot(from_ns)
        }
    }

    fn plan(&self, window: Window, estimate: &TimeEstimate, carries: Carries) -> Option<Planned> {
        let begin_ns = estimate.first_ns(window.begin_ns)?;
        let end_ns = estimate.last_ns(window.end_ns)?;
        let call_ns = begin_ns.saturating_sub(self.lead.ns());
        Some(Planned { window, wake_ns: call_ns.saturating_sub(self.spin_ns), call_ns, begin_ns, end_ns, carries })
    }

    fn look(&self, planned: &Planned, now_ns: u64, clock: &Clock) -> WindowVerdict {
        let window = planned.window;
        let (estimate, carries) = match self.reckon(now_ns, clock) {
            Ok(sure) => sure,
            Err(why) => return WindowVerdict::Silent(why),
        };
        // Windows of an unverified time and of a verified one differ.
        if (carries == Carries::Hello) != (planned.carries == Carries::Hello) {
            return WindowVerdict::Early;
        }
        // No such window after an epoch began in another time.
        let Some(planned) = self.plan(window, &estimate, carries) else { return WindowVerdict::Late };
        if now_ns < planned.call_ns {
            return WindowVerdict::Early;
        }
        let is_slot = matches!(window.kind, WindowKind::Slot { .. });
        if is_slot && now_ns > planned.begin_ns.saturating_add(GATE_NS) {
            return WindowVerdict::Late;
        }
        let (bound_ns, allowance_ns) = (estimate.bound_ns(planned.end_ns), self.table.allowance_ns());
        if bound_ns > allowance_ns {
            return WindowVerdict::Silent(Silent::BoundTooLarge { bound_ns, allowance_ns });
        }
        let goes_by_own = carries == Carries::All || clock.is_beginning();
        let synchronises = goes_by_own && clock.synchronises(window.cycle);
        let carries = match window.kind {
            WindowKind::Slot { .. } if clock.is_beginning() => return WindowVerdict::Silent(Silent::Beginning),
            WindowKind::Slot { .. } => carries,
            WindowKind::Synchronisation { .. } if synchronises => Carries::Time,
            WindowKind::Synchronisation { .. } => return WindowVerdict::Idle,
        };
        let Planned { begin_ns, end_ns, .. } = planned;
        let tx_window = TransmitWindow::new(window, begin_ns, end_ns, carries, self.lead.ns(), *self.table.wire());
        // A Sync may leave anywhere in its window: it contains its own time.
        if is_slot || tx_window.fits(now_ns, TIME_BYTES) { WindowVerdict::Send(tx_window) } else { WindowVerdict::Late }
    }
}
