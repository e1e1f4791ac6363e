//! When the thread of the time slots wakes, and what it does then.
//!
//! ```text
//!        sleep, about a millisecond at a time                  wake    call begin              guard
//!  ──┬──────────────┬──────────────┬─────────────────────────┬───────┬────┬───────────────────┬─────▶ local time
//!    is the mailbox full?   the same      the same           │ spin  │lead│ time, refusal,    │
//!                                         mailbox ─▶ queue ──┼──────▶│    │ packages by level,│ stamps … ─▶ Clock ─▶ page, tools
//!                                                            │       │    │ parts of replicas │
//!                                       stamps, datagrams of time ─▶ Clock
//! ```

use super::answer_queue::AnswerQueue;
use super::held::{self, HeldDatagram};
use super::log::WindowLog;
use super::parts::NextPart;
use super::platform::{NotSent, Platform, SlotEvent};
use super::timing::{LAST_LOOK_NS, LOOK_BURST, NAP_NS, SLEEP_NS_MAX, SlotStep, TIDY_NS};
use crate::frame::{FrameHead, NodeIndex};
use crate::intake::{Intake, MAKING_NS, QUIET_NS, Transit};
use crate::outbound::Outbound;
use crate::security::PeerSessions;
use crate::settings::Settings;
use crate::tdma::{Carries, Next, Planned, SlotScheduler, TransmitWindow, WindowKind, WindowVerdict};
use crate::time::{Allowed, SentId, Step, TIME_BYTES};
use rohrpost_network::Network;
use std::sync::Arc;

/// Sends in the windows of its node. Nothing but this sends, and this only with a [`TransmitWindow`].
pub struct SlotDriver {
    network: Network,
    /// Nodes of the network.
    nodes: usize,
    answers: AnswerQueue,
    scheduler: SlotScheduler,
    intake: Intake,
    /// Room for the largest datagram, and its seal.
    datagram: Box<[u8]>,
    /// A datagram that lies there since the last slot.
    held: Option<HeldDatagram>,
    parts: NextPart,
    phase: Phase,
    /// When the socket of time was read last, local ns.
    looked_ns: u64,
    /// When it saw last to what waits.
    tidied_ns: u64,
    /// Slots that were left out so far, as it has told.
    left_out: u64,
    /// The first datagram of the last window, if the kernel stamps it.
    first: Option<First>,
    log: WindowLog,
}

/// What the driver waits for.
#[derive(Clone, Copy)]
enum Phase {
    /// Nothing has been planned.
    Plans,
    /// To see to what waits, between windows.
    Naps { is_silent: bool, wake_ns: u64 },
    /// To wake up for a window, or where there is none to look at what came.
    Sleeps(Option<Planned>),
    /// The call of a window. `looks`: what came is to be looked at once more.
    Spins { planned: Planned, looks: bool },
}

/// A datagram that begins a window.
#[derive(Clone, Copy)]
struct First {
    id: SentId,
    /// When its window was asked for, local ns.
    called_ns: u64,
    /// When the window begins, local ns.
    begin_ns: u64,
}

impl SlotDriver {
    /// Makes the driver of a router that starts at `now_ns`, with its sessions where datagrams are sealed.
    pub fn new(
        settings: &Arc<Settings>,
        peer_sessions: Option<&Arc<PeerSessions>>,
        scheduler: SlotScheduler,
        now_ns: u64,
    ) -> Self {
        let network = settings.network;
        Self {
            network,
            nodes: settings.nodes.len(),
            answers: AnswerQueue::new(settings, peer_sessions),
            scheduler,
            intake: Intake::new(now_ns),
            datagram: vec![0; network.datagram_bytes_max + network.security.tag_bytes()].into(),
            held: None,
            parts: NextPart::new(settings),
            phase: Phase::Plans,
            looked_ns: 0,
            tidied_ns: 0,
            left_out: 0,
            first: None,
            log: WindowLog::default(),
        }
    }

    /// When it sends, and why not.
    pub fn scheduler(&self) -> &SlotScheduler {
        &self.scheduler
    }

    /// Does what is due. To be called again when it has slept, or at once if it spins.
    pub fn poll(&mut self, on: &mut impl Platform) -> SlotStep {
        match self.phase {
            Phase::Plans => {}
            Phase::Naps { is_silent, wake_ns } => self.between(on, is_silent, wake_ns),
            Phase::Sleeps(None) => {
                self.look(on);
                self.between(on, true, u64::MAX);
            }
            Phase::Sleeps(Some(planned)) => {
                self.look(on);
                self.open(on, &planned);
                // A node that sends only if a Sync is missing looks for that Sync once more.
                let is_slot = matches!(planned.window.kind, WindowKind::Slot { .. });
                let looks = !is_slot && planned.call_ns.saturating_sub(on.local_ns()) > 2 * LAST_LOOK_NS;
                self.phase = Phase::Spins { planned, looks };
            }
            Phase::Spins { .. } => {}
        }
        if let Phase::Spins { planned, looks } = self.phase {
            if let Some(until_ns) = self.spin(on, &planned, looks) {
                return SlotStep::Spin { until_ns };
            }
            self.window(on, &planned);
        }
        SlotStep::Sleep { for_ns: self.plan(on) }
    }

    /// What comes next; for how long to sleep before that.
    fn plan(&mut self, on: &mut impl Platform) -> u64 {
        loop {
            let now_ns = on.local_ns();
            let next = self.scheduler.next(now_ns, on.clock());
            self.tell_left_out(on);
            let (planned, wake_ns) = match next {
                Next::Window(planned) => (Some(planned), planned.wake_ns),
                Next::Silent { until_ns, .. } => (None, until_ns),
            };
            let left_ns = wake_ns.saturating_sub(now_ns);
            if left_ns > SLEEP_NS_MAX {
                self.phase = Phase::Naps { is_silent: planned.is_none(), wake_ns };
                // Not so that the rest is a short one.
                return NAP_NS.min(left_ns / 2);
            }
            // Windows follow each other quickly.
            if left_ns > TIDY_NS && on.monotonic_ns().saturating_sub(self.tidied_ns) > SLEEP_NS_MAX {
                self.between(on, planned.is_none(), wake_ns);
                continue;
            }
            self.phase = Phase::Sleeps(planned);
            return left_ns;
        }
    }

    /// Between windows: drops what waits in vain, and keeps room in the mailbox. A silent node waits for datagrams of
    /// time; others read them once a cycle at least.
    fn between(&mut self, on: &mut impl Platform, is_silent: bool, wake_ns: u64) {
        let now_ns = on.monotonic_ns();
        self.tidied_ns = now_ns;
        self.drop_if_old(on);
        let (outbound, mut report) = on.queue();
        outbound.tidy(now_ns, &mut report);
        drop(report);
        self.intake.relieve(now_ns, &mut on.transit(), wake_ns);
        on.queue_changed();
        self.answers.look(on, now_ns);
        on.tidy(now_ns);
        if is_silent || on.local_ns().saturating_sub(self.looked_ns) > self.scheduler.table().cycle_ns() {
            self.look(on);
        }
    }

    /// Hands all datagrams of time and stamps that came to the clock, and shows how it stands.
    fn look(&mut self, on: &mut impl Platform) {
        let Self { scheduler, first, log, answers, .. } = self;
        // What comes with a node's address, and is none of its, must not take the time before a slot.
        let most = LOOK_BURST + self.nodes;
        on.take_time(most, |id, stamp| {
            let Some(First { called_ns, begin_ns, .. }) = first.take_if(|first| first.id == id) else { return };
            scheduler.left(called_ns, stamp);
            log.left(begin_ns, stamp);
        });
        let (now_ns, monotonic_ns) = (on.local_ns(), on.monotonic_ns());
        if let Some(stranger) = on.take_stranger() {
            answers.refuse(monotonic_ns, stranger);
        }
        let (clock, stats) = on.time();
        clock.hears_by(stats, monotonic_ns, now_ns);
        // Roles and bounds go on with time; there is nothing to be sent.
        let step = clock.poll_in(now_ns, Allowed::Nothing, &mut [0; TIME_BYTES]);
        on.happened(SlotEvent::Idle(&step));
        self.looked_ns = now_ns;
        on.publish(&self.scheduler, &self.log);
    }

    /// Awake for a slot, it takes from the mailbox what that has room for.
    fn open(&mut self, on: &mut impl Platform, planned: &Planned) {
        on.happened(SlotEvent::Awake(planned));
        if let (WindowKind::Slot { .. }, None) = (planned.window.kind, self.scheduler.silent()) {
            let sends_ns = planned.end_ns.saturating_sub(planned.begin_ns);
            self.intake.open(on.monotonic_ns(), self.scheduler.table().wire().bytes_in(sends_ns));
        }
    }

    /// Takes what the slot has room for, and what still comes, until shortly before the call. When there is something
    /// to do again, unless packages come; none: it is time for the call.
    fn spin(&mut self, on: &mut impl Platform, planned: &Planned, mut looks: bool) -> Option<u64> {
        loop {
            let left_ns = planned.call_ns.saturating_sub(on.local_ns());
            if left_ns == 0 {
                return None;
            }
            if looks && left_ns < LAST_LOOK_NS {
                looks = false;
                self.look(on);
            }
            if left_ns > QUIET_NS && self.intake.take_one(&mut on.transit()) {
                continue;
            }
            self.phase = Phase::Spins { planned: *planned, looks };
            return Some(if looks { planned.call_ns - LAST_LOOK_NS + 1 } else { planned.call_ns });
        }
    }

    /// It is time for a window.
    fn window(&mut self, on: &mut impl Platform, planned: &Planned) {
        let called_ns = on.local_ns();
        let verdict = self.scheduler.validate(planned, called_ns, on.clock());
        on.happened(SlotEvent::Decided(planned, &verdict));
        if let WindowVerdict::Send(tx_window) = verdict {
            self.use_window(on, tx_window, called_ns);
        }
        self.intake.close();
    }

    /// `called_ns`: when the window was asked for.
    fn use_window(&mut self, on: &mut impl Platform, mut tx_window: TransmitWindow, called_ns: u64) {
        self.first = None;
        self.send_time(on, &mut tx_window, called_ns);
        if tx_window.carries_hello() {
            self.answers.answer(on, &mut tx_window);
        }
        if tx_window.carries == Carries::All {
            self.send_all(on, &mut tx_window);
            on.queue_changed();
        }
        self.scheduler.close(&tx_window);
        let (_, lead_ns) = self.scheduler.lead_ns();
        self.log.closed(&tx_window, called_ns + lead_ns);
        on.happened(SlotEvent::Closed(&tx_window));
        self.look(on);
    }

    /// `called_ns`: when the window was asked for. From there on it counts how long the first frame takes to the wire.
    fn send_time(&mut self, on: &mut impl Platform, tx_window: &mut TransmitWindow, called_ns: u64) {
        let mut datagram = [0; TIME_BYTES];
        let mut now_ns = on.local_ns();
        while tx_window.fits(now_ns, TIME_BYTES) {
            let Step::Send { to, .. } = on.time().0.poll_in(now_ns, tx_window.allowed(), &mut datagram) else { return };
            now_ns = on.local_ns();
            if !tx_window.fits(now_ns, TIME_BYTES) {
                // The thread stood still: better lost than in another's slot.
                return;
            }
            tx_window.takes(now_ns, TIME_BYTES);
            on.send_time(to, &datagram);
            now_ns = on.local_ns();
            tx_window.returns(now_ns);
            if tx_window.datagrams() == 1 {
                let id = FrameHead::parse(&datagram).ok().map(|(head, _)| SentId { to, sequence: head.sequence });
                self.first = id.map(|id| First { id, called_ns, begin_ns: tx_window.begin_ns });
            }
        }
    }

    fn send_all(&mut self, on: &mut impl Platform, tx_window: &mut TransmitWindow) {
        self.drop_if_old(on);
        let goes_on = self.send_packages(on, tx_window);
        if tx_window.is_behind(on.local_ns()) {
            tx_window.fell_behind = true;
            left_out(on, on.monotonic_ns());
        }
        // Between any two parts packages that came meanwhile have their turn.
        while goes_on && self.parts.send_next(on, tx_window) && self.send_packages(on, tx_window) {}
    }

    /// Until none may leave; false: the thread stood still with one.
    fn send_packages(&mut self, on: &mut impl Platform, tx_window: &mut TransmitWindow) -> bool {
        while let Some(made) = self.next_datagram(on, tx_window) {
            let (HeldDatagram { to, bytes, .. }, now_ns) = (made, on.local_ns());
            if !tx_window.fits(now_ns, bytes) {
                self.missed(on, made);
                return false;
            }
            self.hand_over(on, tx_window, now_ns, to, bytes);
        }
        true
    }

    /// What leaves next. Room is reckoned for when it will be made, so that it misses the slot only if the thread
    /// stands still meanwhile.
    fn next_datagram(&mut self, on: &mut impl Platform, tx_window: &TransmitWindow) -> Option<HeldDatagram> {
        if let Some(held) = self.held.take() {
            return Some(held);
        }
        let now_ns = on.monotonic_ns();
        let (outbound, mut report) = on.queue();
        outbound.drop_first(now_ns, &mut report);
        drop(report);
        self.intake.take_on(&mut on.transit(), |now_ns| tx_window.busy_ns(now_ns));
        let room_bytes = tx_window.room_bytes(on.local_ns() + MAKING_NS)?;
        let (made_ns, (_, behind)) = (on.monotonic_ns(), on.transit().waits());
        let (outbound, mut report) = on.queue();
        let (to, bytes) = outbound.poll_slot(made_ns, (room_bytes, &mut self.datagram[..]), behind, &mut report)?;
        drop(report);
        on.happened(SlotEvent::Made);
        Some(HeldDatagram { to, bytes, made_ns })
    }

    /// The thread stood still with a datagram in its hand. It goes first in the next slot, unless it is not real time:
    /// then it would keep up what is, and is lost.
    fn missed(&mut self, on: &mut impl Platform, made: HeldDatagram) {
        let datagram = &self.datagram[..made.bytes];
        let held = held::is_real_time(datagram, &self.network);
        on.happened(SlotEvent::Missed { datagram, held });
        if held {
            self.held = Some(made);
            self.log.held += 1;
        } else {
            lose(on, datagram);
        }
    }

    /// A datagram that was made and found no slot for long is lost: its sender relies on a limit of age.
    fn drop_if_old(&mut self, on: &mut impl Platform) {
        let now_ns = on.monotonic_ns();
        if let Some(held) = self.held.take_if(|held| held.is_old(now_ns)) {
            let datagram = &self.datagram[..held.bytes];
            on.happened(SlotEvent::DroppedOld(datagram));
            lose(on, datagram);
        }
    }

    /// `now_ns`: local; when it was found to fit.
    fn hand_over(
        &mut self,
        on: &mut impl Platform,
        tx_window: &mut TransmitWindow,
        now_ns: u64,
        to: NodeIndex,
        bytes: usize,
    ) {
        let handed_ns = on.monotonic_ns();
        let sent = on.send(handed_ns, to, &mut self.datagram, bytes);
        tx_window.returns(on.local_ns());
        if let Err(NotSent) = sent {
            lose(on, &self.datagram[..bytes]);
        } else if on.queue().0.is_measured() {
            // The usual way to the wire; where the call took longer it was perhaps kept up before that.
            let (usual_ns, _) = self.scheduler.lead_ns();
            let to_wire_ns = usual_ns.max(on.monotonic_ns().saturating_sub(handed_ns));
            if tx_window.is_late(now_ns + (to_wire_ns - usual_ns), bytes) {
                tx_window.fell_behind = true;
                left_out(on, handed_ns);
            }
            on.queue().0.sent(handed_ns + tx_window.arrives_after_ns(now_ns, bytes, to_wire_ns));
        }
        tx_window.takes(now_ns, bytes);
    }

    /// Which packages cannot have kept their bounds.
    fn tell_left_out(&mut self, on: &mut impl Platform) {
        let count = self.scheduler.left_out();
        if count != self.left_out || self.scheduler.silent().is_some() {
            self.left_out = count;
            left_out(on, on.monotonic_ns());
        }
    }
}

fn lose(on: &mut impl Platform, datagram: &[u8]) {
    let (outbound, mut report) = on.queue();
    outbound.unsent(datagram, &[], &mut report);
}

fn left_out(on: &mut impl Platform, now_ns: u64) {
    let (outbound, _) = on.queue();
    Outbound::slot_left_out(outbound, now_ns);
    on.happened(SlotEvent::LeftOut);
}
