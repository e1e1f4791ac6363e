//! The thread that sends in time slots: it has the router's mailbox, its queue, all sockets that send, and the clock.
//!
//! ```text
//!        sleep, about a millisecond at a time                  wake    call begin              guard
//!  ──┬──────────────┬──────────────┬─────────────────────────┬───────┬────┬───────────────────┬─────▶ local time
//!    is the mailbox full?   the same      the same           │ spin  │lead│ time, refusal,    │
//!                                         mailbox ─▶ queue ──┼──────▶│    │ packages by level │ stamps … ─▶ Clock ─▶ page, tools
//!                                       stamps, datagrams of time ─▶ Clock
//! ```
//!
//! Nothing but this thread sends, and this thread only with a [`TransmitWindow`]. It is never rung: who publishes a package makes no system call, and
//! waits for a slot anyway. It takes nothing from the heap.

mod alarm;
mod answer_queue;
mod granted;
mod held;
mod intake;
mod speech;
mod state;

pub use granted::{Granted, spin_ns};
pub use state::{Snapshot, State, Used, WINDOWS};

use super::answers::Answers;
use super::clock::{ClockState, Works};
use super::sending::Sending;
use super::threads::Shared;
use super::tx_thread::TxThread;
use super::wire::Wire;
use crate::frame::{FrameHead, NodeIndex};
use crate::intake::{MAKING_NS, QUIET_NS};
use crate::outbound::Outbound;
use crate::stats::Stats;
use crate::tdma::{Carries, Counts, Kind, Next, Planned, SlotScheduler, TransmitWindow, Verdict};
use crate::time::{Allowed, SentId, Step, TIME_BYTES};
pub(super) use answer_queue::{ANSWERS, Answer, AnswerQueue, REFUSAL_BYTES};
use granted::SPIN_NS_MAX;
use held::Held;
use intake::Intake;
use rohrpost_mailbox::{Name, monotonic_ns};
use rohrpost_network::{Network, TRANSIT_LOOK};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Syncs that came since it woke up are looked for so long before the call: to read one takes some microseconds.
const LAST_LOOK_NS: u64 = 50_000;
/// Whether the mailbox is full is looked at this often: half of it has room for a burst of 32 packages.
const NAP_NS: u64 = 1_000_000;
/// With less than this until it has to wake up it sleeps on: each look at the mailbox keeps a processor from another thread, perhaps one that
/// is about to send.
const SLEEP_NS_MAX: u64 = NAP_NS + NAP_NS / 4;
const _: () = assert!(
    (SLEEP_NS_MAX + SPIN_NS_MAX) as u128 <= TRANSIT_LOOK.as_nanos(),
    "who declares flows counts on it, that what waits does not overflow meanwhile"
);
/// So many datagrams of time, and one for each node, are read at a look: to read one takes some microseconds.
const LOOK_BURST: usize = 16;
/// To see to what waits takes less than this, unless much does.
const TIDY_NS: u64 = 250_000;
/// Whose thread it is.
#[derive(Clone, Copy)]
pub(super) struct Own {
    pub(super) router: Name,
    /// Nodes of the network.
    pub(super) nodes: usize,
    pub(super) network: Network,
}

/// What the thread has.
pub(super) struct Slots {
    shared: Arc<Shared>,
    /// In which the thread that receives counts.
    stats: Arc<Stats>,
    works: Works,
    scheduler: SlotScheduler,
    intake: Intake,
    outbound: Outbound,
    answers: Answers,
    wire: Wire,
    line: AnswerQueue,
    /// Room for the largest datagram.
    datagram: Box<[u8]>,
    /// A datagram that lies there since the last slot.
    held: Option<Held>,
    own: Own,
    /// When the socket of time was read last, local ns.
    looked_ns: u64,
    /// When it saw last to what waits.
    tidied_ns: u64,
    /// Slots that were left out so far, as it has told.
    left_out: u64,
    /// The first datagram of the last window, if the kernel stamps it.
    first: Option<First>,
    snapshot: Snapshot,
    state: Arc<State>,
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

impl Slots {
    /// From what would send as packages come.
    pub(super) fn new(
        own: Own,
        tx_thread: TxThread,
        works: Works,
        scheduler: SlotScheduler,
        line: AnswerQueue,
    ) -> Self {
        let TxThread { shared, transit, sending, .. } = tx_thread;
        let Sending { outbound, answers, wire, datagram, stats } = sending;
        let snapshot = Snapshot {
            counts: Counts::default(),
            silent: scheduler.silent(),
            lead_ns: (0, 0),
            granted: Granted::Ordinary,
            held: 0,
            windows: [None; WINDOWS],
        };
        let state = Arc::new(State::new(snapshot));
        Self {
            shared,
            stats,
            works,
            scheduler,
            intake: Intake::new(transit),
            outbound,
            answers,
            wire,
            line,
            datagram,
            held: None,
            own,
            looked_ns: 0,
            tidied_ns: 0,
            left_out: 0,
            first: None,
            snapshot,
            state,
        }
    }

    /// What others may look at.
    pub(super) fn state(&self) -> Arc<State> {
        self.state.clone()
    }

    /// And of the clock.
    pub(super) fn clock_state(&self) -> Arc<ClockState> {
        self.works.state().clone()
    }

    /// Until the router ends.
    pub(super) fn run(mut self) {
        alarm::be_punctual();
        self.snapshot.granted = Granted::ask(self.scheduler.table());
        self.works.runs_in_real_time(self.snapshot.granted != Granted::Ordinary);
        while !self.shared.ends() {
            let now_ns = self.works.now_ns();
            let next = self.scheduler.next(now_ns, &self.works.clock);
            self.tell_left_out();
            let (planned, wake_ns) = match next {
                Next::Window(planned) => (Some(planned), planned.wake_ns),
                Next::Silent { until_ns, .. } => (None, until_ns),
            };
            let left_ns = wake_ns.saturating_sub(now_ns);
            if left_ns > SLEEP_NS_MAX {
                // Not so that the rest is a short one.
                alarm::sleep(NAP_NS.min(left_ns / 2));
                self.between(planned.is_none(), wake_ns);
                continue;
            }
            // Windows follow each other quickly.
            if left_ns > TIDY_NS && monotonic_ns().saturating_sub(self.tidied_ns) > SLEEP_NS_MAX {
                self.between(planned.is_none(), wake_ns);
                continue;
            }
            alarm::sleep(left_ns);
            self.look();
            match planned {
                Some(planned) => self.window(&planned),
                None => self.between(true, u64::MAX),
            }
        }
    }

    /// Between windows: sees to it that nothing waits in vain, and that the mailbox has room. Whoever is `silent` waits for datagrams of
    /// time; others read them once a cycle at least.
    fn between(&mut self, silent: bool, wake_ns: u64) {
        let now_ns = monotonic_ns();
        self.tidied_ns = now_ns;
        self.drop_if_old();
        self.line.look(now_ns);
        self.outbound.tidy(now_ns, &mut self.answers);
        let left_ns = || wake_ns.saturating_sub(self.works.now_ns());
        self.intake.relieve(&mut self.outbound, &mut self.answers, left_ns);
        self.tell_tunnel();
        self.wire.deliver(now_ns);
        if silent || self.works.now_ns().saturating_sub(self.looked_ns) > self.scheduler.table().cycle_ns() {
            self.look();
        }
    }

    /// Hands all datagrams of time and stamps that came to the clock, and shows how it stands.
    fn look(&mut self) {
        let Self { stats, works, scheduler, first, snapshot, looked_ns, state, line, own, .. } = self;
        // What comes with a node's address, and is none of its, must not take the time before a slot.
        let most = LOOK_BURST + own.nodes;
        works.take(most, |id, stamp| {
            let Some(First { called_ns, begin_ns, .. }) = first.take_if(|first| first.id == id) else { return };
            scheduler.left(called_ns, stamp);
            if let Some(Some(used)) = snapshot.windows.last_mut() {
                used.off_ns = stamp.ns.wrapping_sub(begin_ns).cast_signed();
                used.by_kernel = stamp.by_kernel;
            }
        });
        let now_ns = works.now_ns();
        works.clock.hears_by(stats, monotonic_ns(), now_ns);
        if let Some(stranger) = works.refuses() {
            line.refuse(monotonic_ns(), stranger);
        }
        // Roles and bounds go on with time; there is nothing to be sent.
        let _ = works.clock.poll_in(now_ns, Allowed::Nothing, &mut [0; TIME_BYTES]);
        works.publish();
        *looked_ns = now_ns;
        let counts = scheduler.counts(&works.clock);
        let (silent, lead_ns) = (scheduler.silent(), scheduler.lead_ns());
        speech::tell_change(snapshot.silent, silent, || line.parted_by(works.clock.parted_by(now_ns)));
        *snapshot = Snapshot { counts, silent, lead_ns, ..*snapshot };
        state.show(snapshot);
    }

    /// Waits for the call, and uses the window.
    fn window(&mut self, planned: &Planned) {
        if let (Kind::Slot { .. }, None) = (planned.window.kind, self.scheduler.silent()) {
            let sends_ns = planned.end_ns.saturating_sub(planned.begin_ns);
            self.intake.open(self.scheduler.table().wire().bytes_in(sends_ns));
        }
        self.spin(planned);
        let called_ns = self.works.now_ns();
        if let Verdict::Send(tx_window) = self.scheduler.validate(planned, called_ns, &self.works.clock) {
            self.send(tx_window, called_ns);
        }
        self.intake.close();
    }

    /// `called_ns`: when the window was asked for.
    fn send(&mut self, mut tx_window: TransmitWindow, called_ns: u64) {
        self.first = None;
        self.send_time(&mut tx_window, called_ns);
        if tx_window.carries_hello() {
            self.answer(&mut tx_window);
        }
        if tx_window.carries == Carries::All {
            self.send_packages(&mut tx_window);
            self.tell_tunnel();
        }
        self.scheduler.close(&tx_window);
        if tx_window.datagrams() > 0 {
            let (_, lead_ns) = self.scheduler.lead_ns();
            self.snapshot.used(Used {
                window: tx_window.window,
                off_ns: (called_ns + lead_ns).wrapping_sub(tx_window.begin_ns).cast_signed(),
                by_kernel: false,
                datagrams: tx_window.datagrams(),
                wire_bytes: tx_window.wire_bytes(),
            });
        }
        self.look();
    }

    /// Takes what the slot has room for, and what still comes, until shortly before the call. Who is to send only if a Sync is missing looks
    /// for it once more.
    fn spin(&mut self, planned: &Planned) {
        let left_ns = |works: &Works| planned.call_ns.saturating_sub(works.now_ns());
        let is_slot = matches!(planned.window.kind, Kind::Slot { .. });
        let mut looks = !is_slot && left_ns(&self.works) > 2 * LAST_LOOK_NS;
        loop {
            let left_ns = left_ns(&self.works);
            if left_ns == 0 {
                return;
            }
            if looks && left_ns < LAST_LOOK_NS {
                looks = false;
                self.look();
            }
            if left_ns > QUIET_NS {
                self.intake.take_one(&mut self.outbound, &mut self.answers);
            }
            std::hint::spin_loop();
        }
    }

    /// `called_ns`: when the window was asked for. From there on it counts how long the first frame takes to the wire.
    fn send_time(&mut self, tx_window: &mut TransmitWindow, called_ns: u64) {
        let mut datagram = [0; TIME_BYTES];
        while tx_window.fits(self.works.now_ns(), TIME_BYTES)
            && let Step::Send { to, .. } =
                self.works.clock.poll_in(self.works.now_ns(), tx_window.allowed(), &mut datagram)
        {
            let now_ns = self.works.now_ns();
            if !tx_window.fits(now_ns, TIME_BYTES) {
                // The thread stood still: better lost than in another's slot.
                return;
            }
            tx_window.takes(now_ns, TIME_BYTES);
            self.works.send(to, &datagram);
            if tx_window.datagrams() == 1 {
                let id = FrameHead::parse(&datagram).ok().map(|(head, _)| SentId { to, sequence: head.sequence });
                self.first = id.map(|id| First { id, called_ns, begin_ns: tx_window.begin_ns });
            }
        }
    }

    /// One in a slot: whoever brings refusals or hellos about must not take the slots of packages.
    fn answer(&mut self, tx_window: &mut TransmitWindow) {
        let (now_ns, asks) = (self.works.now_ns(), tx_window.carries == Carries::Hello);
        let overheard = if asks { self.works.clock.overheard(now_ns) } else { None };
        let first = overheard.map(|(from, _)| from);
        // What was looked through before takes its time.
        let works = &self.works;
        let fits = |bytes| tx_window.fits(works.now_ns(), bytes);
        if let Some(bytes) = self.line.answer(monotonic_ns(), first, fits) {
            tx_window.takes(self.works.now_ns(), bytes);
            if asks {
                self.works.clock.asked_overheard(now_ns);
            }
        }
    }

    /// What was made and found no slot for long is lost: whoever sent it counts on that nothing arrives that is much older than it may be.
    fn drop_if_old(&mut self) {
        let now_ns = monotonic_ns();
        if let Some(held) = self.held.take_if(|held| held.is_old(now_ns)) {
            self.outbound.unsent(&self.datagram[..held.bytes], &[], &mut self.answers);
        }
    }

    /// How much of its packets waits.
    fn tell_tunnel(&self) {
        let bytes = self.outbound.waiting_bytes_of(self.own.router);
        self.shared.tunnel_bytes.store(bytes, Ordering::Relaxed);
    }

    /// Which packages cannot have kept their bounds.
    fn tell_left_out(&mut self) {
        let left_out = self.scheduler.left_out();
        if left_out != self.left_out || self.scheduler.silent().is_some() {
            self.left_out = left_out;
            self.outbound.slot_left_out(monotonic_ns());
        }
    }

    fn send_packages(&mut self, tx_window: &mut TransmitWindow) {
        self.drop_if_old();
        while let Some(made) = self.next_datagram(tx_window) {
            let (Held { to, bytes, .. }, now_ns) = (made, self.works.now_ns());
            if !tx_window.fits(now_ns, bytes) {
                self.missed(made);
                break;
            }
            self.hand_over(tx_window, now_ns, to, bytes);
        }
        if tx_window.is_behind(self.works.now_ns()) {
            self.outbound.slot_left_out(monotonic_ns());
        }
    }

    /// What leaves next. Room is reckoned for when it will be made, so that it misses the slot only if the thread stands still meanwhile.
    fn next_datagram(&mut self, tx_window: &TransmitWindow) -> Option<Held> {
        if let Some(held) = self.held.take() {
            return Some(held);
        }
        self.outbound.drop_first(monotonic_ns(), &mut self.answers);
        let busy_ns = || tx_window.busy_ns(self.works.now_ns());
        self.intake.take_on(&mut self.outbound, &mut self.answers, busy_ns);
        let room_bytes = tx_window.room_bytes(self.works.now_ns() + MAKING_NS)?;
        let (made_ns, behind) = (monotonic_ns(), self.intake.first());
        let datagram = (room_bytes, &mut self.datagram[..]);
        let made = self.outbound.poll_slot(made_ns, datagram, behind, &mut self.answers);
        made.map(|(to, bytes): (NodeIndex, usize)| Held { to, bytes, made_ns })
    }

    /// The thread stood still with a datagram in its hand. It goes first in the next slot, unless it is not real time: then it would keep
    /// up what is, and is lost.
    fn missed(&mut self, made: Held) {
        let datagram = &self.datagram[..made.bytes];
        if held::is_real_time(datagram, &self.own.network) {
            self.held = Some(made);
            self.snapshot.held += 1;
        } else {
            self.outbound.unsent(datagram, &[], &mut self.answers);
        }
    }

    /// `now_ns`: local; when it was found to fit.
    fn hand_over(&mut self, tx_window: &mut TransmitWindow, now_ns: u64, to: NodeIndex, bytes: usize) {
        let handed_ns = monotonic_ns();
        let sent = self.wire.send_made(handed_ns, to, &mut self.datagram, bytes);
        if sent.is_err_and(super::Failure::is_loss) {
            self.outbound.unsent(&self.datagram[..bytes], &[], &mut self.answers);
        } else if self.outbound.is_measured() {
            // The usual way to the wire; where the call took longer it was perhaps kept up before that.
            let (usual_ns, _) = self.scheduler.lead_ns();
            let to_wire_ns = usual_ns.max(monotonic_ns().saturating_sub(handed_ns));
            if tx_window.is_late(now_ns + (to_wire_ns - usual_ns), bytes) {
                self.outbound.slot_left_out(handed_ns);
            }
            self.outbound.sent(handed_ns + tx_window.arrives_after_ns(now_ns, bytes, to_wire_ns));
        }
        tx_window.takes(now_ns, bytes);
    }
}
