//! Keeps time: what a node does with datagrams and stamps of time, and when it sends.
//!
//! ```text
//!  stamps of what left ─▶ ┌───────┐ ─ record ─▶ the node's page of time
//!  datagrams, stamps ───▶ │ Clock │ ─ counts ─▶ tools
//!  ◀────── datagrams ──── └───────┘
//! ```
//!
//! Without time slots [`ClockDriver::poll`] is the whole work of a thread; with them the thread of the slots takes and
//! sends in windows.

use super::cpu_budget::CpuBudget;
use super::time_platform::{TIME_DATAGRAM_BYTES, TimeArrival, TimeEvent, TimeInput, TimePlatform, TimeSource};
use crate::frame::{BadFrame, FrameHead, NodeIndex};
use crate::security::{NotOpened, Opened, Opening, PeerSessions, Port, Rejection, Sealing, Tally};
use crate::time::{Clock, InSlots, Looked, SentId, Stamp, Step, TIME_BYTES, TimeSettings, Unsteady};
use rohrpost_mailbox::{TimeRecord, Watched};
use std::net::IpAddr;
use std::sync::Arc;

/// A record that came too late is made anew, so often.
const WRITE_TRIES: usize = 8;
/// However long nothing comes: so often it looks whether the computer has slept, or its clock is slewed, ns.
const LOOKS_EVERY_NS: u64 = 100_000_000;
/// Datagrams taken before what is due is sent.
const BURST: usize = 64;

/// What a clock begins with.
#[derive(Clone, Copy, Debug)]
pub struct TimeStart {
    /// All clocks of this computer.
    pub looked: Looked,
    /// The clock by which work is counted, ns.
    pub monotonic_ns: u64,
    /// CLOCK_REALTIME, ns.
    pub realtime_ns: u64,
    /// What an earlier incarnation left in the node's page.
    pub page: Option<TimeRecord>,
    /// What it saw last of the clocks.
    pub watched: Option<Watched>,
}

/// What to do until it is polled again.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ClockStep {
    /// Sleep for so long, ns.
    pub for_ns: u64,
    /// Unless something comes before; else its share of the processor is used up, and what comes waits.
    pub reads: bool,
}

/// All of a clock but its socket, its page and its thread.
pub struct ClockDriver {
    clock: Clock,
    system: u8,
    /// By node.
    addresses: Box<[IpAddr]>,
    seals: Option<Seals>,
    written: Option<TimeRecord>,
    /// Datagrams that were not taken.
    ignored: u64,
    share: CpuBudget,
    /// An address that no node has, which tells the time of another configuration.
    stranger: Option<IpAddr>,
}

/// A frame, what is behind its head, and whether it is of an incarnation that is known to live.
type OpenedFrame<'a> = (FrameHead, &'a [u8], bool);
/// Why a datagram was not opened, and how many were not, if that is to be told.
type Told = Option<(Rejection, u64)>;

/// What seals and opens datagrams of time.
struct Seals {
    sealing: Sealing,
    opening: Opening,
    tally: Tally,
}

impl ClockDriver {
    /// Makes the driver of a starting router. Also returns why its clock is not steady, if the page did not say so
    /// already. Continues the page of the earlier incarnation.
    pub fn new(settings: TimeSettings, addresses: Box<[IpAddr]>, start: TimeStart) -> (Self, Option<Unsteady>) {
        let TimeStart { looked, monotonic_ns, realtime_ns, page, watched } = start;
        let (system, now_ns) = (settings.system, looked.local_ns);
        let mut clock = Clock::new(settings, now_ns, realtime_ns, page).watching(now_ns, watched);
        let was_steady = clock.unsteady(now_ns).is_none();
        let unsteady = clock.look_at_clocks(looked).filter(|_| was_steady);
        let share = CpuBudget::new(monotonic_ns);
        let driver = Self { clock, system, addresses, seals: None, written: page, ignored: 0, share, stranger: None };
        (driver, unsteady)
    }

    /// From now on it seals what it sends, and takes only what is sealed to it.
    #[must_use]
    pub fn sealed(self, all: &Arc<PeerSessions>, in_slots: bool) -> Self {
        let sealing = if in_slots { Sealing::of_slots(all) } else { Sealing::new(all, Port::Time) };
        let (opening, tally) = (Opening::new(all, Port::Time), Tally::new(all.rejections(Port::Time)));
        Self { seals: Some(Seals { sealing, opening, tally }), ..self }
    }

    /// From now on its clock goes by the rules of time slots.
    #[must_use]
    pub fn in_slots(self, settings: InSlots) -> Self {
        Self { clock: self.clock.in_slots(settings), ..self }
    }

    /// What is known of system time.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// The same, to be changed.
    pub fn clock_mut(&mut self) -> &mut Clock {
        &mut self.clock
    }

    /// Takes what came, sends what is due, and lets others see how it stands.
    pub fn poll(&mut self, on: &mut impl TimePlatform) -> ClockStep {
        let began_ns = on.monotonic_ns();
        // Used up, what comes waits; what is due is sent all the same.
        let rests_ns = self.share.rests_until_ns(began_ns);
        if rests_ns.is_none() {
            self.take(on, BURST, |_, _| {});
        }
        let until_ns = self.send_due(on).min(if rests_ns.is_none() { on.held_ns() } else { u64::MAX });
        self.publish(on);
        let now_ns = on.monotonic_ns();
        self.share.uses(began_ns, now_ns);
        let rest_ns = rests_ns.map_or(u64::MAX, |rests_ns| rests_ns.saturating_sub(now_ns));
        let for_ns = until_ns.saturating_sub(on.local_ns()).min(LOOKS_EVERY_NS).min(rest_ns);
        ClockStep { for_ns, reads: rests_ns.is_none() }
    }

    /// Sends all that is due; when there is more, local ns.
    fn send_due(&mut self, on: &mut impl TimePlatform) -> u64 {
        let mut datagram = [0; TIME_BYTES];
        loop {
            let step = self.clock.poll(on.local_ns(), &mut datagram);
            on.happened(&self.clock, TimeEvent::Polled);
            match step {
                Step::Send { to, .. } => self.send(on, to, &datagram),
                Step::Wait { until_ns } => return until_ns,
            }
        }
    }

    /// Sends a datagram of time.
    pub fn send(&mut self, on: &mut impl TimePlatform, to: NodeIndex, datagram: &[u8; TIME_BYTES]) {
        on.happened(&self.clock, TimeEvent::Sends(datagram));
        let Some(seals) = &mut self.seals else { return on.send(to, datagram) };
        let mut sealed = [0; TIME_DATAGRAM_BYTES];
        sealed[..TIME_BYTES].copy_from_slice(datagram);
        if seals.sealing.close(&mut sealed).is_ok() {
            on.send(to, &sealed);
        } else {
            on.happened(&self.clock, TimeEvent::NoSession);
        }
    }

    /// Takes what came, without waiting: stamps of what `left`, then at most so many datagrams. When each left is known
    /// before an answer to it is read.
    pub fn take(&mut self, on: &mut impl TimePlatform, most: usize, mut left: impl FnMut(SentId, Stamp)) {
        self.look_at_clocks(on);
        while let Some((id, stamp)) = on.next_left() {
            self.clock.sent(id, stamp);
            left(id, stamp);
        }
        let mut datagram = [0; TIME_DATAGRAM_BYTES];
        for _ in 0..most {
            match on.receive(&mut datagram) {
                TimeInput::Datagram(came) => self.hear(on, &came, &mut datagram[..came.bytes]),
                TimeInput::Kept => {}
                TimeInput::Nothing => break,
            }
        }
    }

    /// An address that no node has, and that the time of another configuration came from, once: where nothing is
    /// sealed, it is told that there is another configuration.
    pub fn take_stranger(&mut self) -> Option<IpAddr> {
        self.stranger.take()
    }

    /// Lets others see how it stands.
    pub fn publish(&mut self, on: &mut impl TimePlatform) {
        if let Some(wall_ns) = on.take_new_epoch() {
            self.clock.begin_time(on.local_ns(), wall_ns);
        }
        self.write_page(on);
        on.publish(&self.clock, self.ignored);
    }

    /// Before anything is measured by it: whether the local clock is one to measure by.
    fn look_at_clocks(&mut self, on: &mut impl TimePlatform) {
        let looked = on.looked();
        let was_steady = self.clock.unsteady(looked.local_ns).is_none();
        if let Some(why) = self.clock.look_at_clocks(looked) {
            on.happened(&self.clock, TimeEvent::Unsteady { why, is_new: was_steady });
        }
        if let Some(watched) = self.clock.watched() {
            on.note_watched(&watched);
        }
    }

    fn hear(&mut self, on: &mut impl TimePlatform, came: &TimeArrival, datagram: &mut [u8]) {
        let Self { clock, addresses, seals, .. } = self;
        let now_ns = on.local_ns();
        let node = addresses.iter().position(|address| *address == came.source).map(|node| node as NodeIndex);
        let (head, rest, is_proven) = match seals {
            None => match FrameHead::parse(datagram) {
                Ok((head, rest)) => (head, rest, true),
                Err(_) => return self.ignore(on, TimeEvent::NoFrame),
            },
            Some(seals) => match seals.open(now_ns, node, clock.overhears(now_ns), datagram) {
                Ok(opened) => opened,
                Err(why) => return self.ignore(on, TimeEvent::NotOpened { source: came.source, why }),
            },
        };
        on.happened(clock, TimeEvent::Hears);
        let is_from_its_node = addresses.get(usize::from(head.from)) == Some(&came.source);
        let (source, taken) = if is_proven && head.digest != clock.digest() {
            // An address that no node has here is told so by nobody else.
            let is_stranger = node.is_none() && head.system == self.system;
            self.stranger = self.stranger.or(is_stranger.then_some(came.source));
            (TimeSource::OtherTable, Some(clock.handle_other(now_ns, came.stamp, node, &head, rest)))
        } else if !is_from_its_node {
            (TimeSource::WrongAddress, None)
        } else if is_proven {
            (TimeSource::Proven, Some(clock.handle(now_ns, came.stamp, &head, rest)))
        } else {
            (TimeSource::Unproven, Some(clock.overhear(now_ns, came.stamp, &head, rest)))
        };
        self.ignored += u64::from(taken != Some(Ok(())));
        on.happened(clock, TimeEvent::Heard { source, head: &head, rest, taken });
    }

    fn ignore(&mut self, on: &mut impl TimePlatform, event: TimeEvent<'_>) {
        self.ignored += 1;
        on.happened(&self.clock, event);
    }

    fn write_page(&mut self, on: &mut impl TimePlatform) {
        for _ in 0..WRITE_TRIES {
            let record = *self.clock.record();
            if self.written == Some(record) {
                return;
            }
            if on.write(&record) {
                self.written = Some(record);
            } else if let Some(page) = on.page() {
                self.clock.page_says(on.local_ns(), &page);
            }
        }
    }
}

impl Seals {
    /// What was sealed to this node, and whether by an incarnation that is known to live; else why not, if that is to
    /// be told: once a second at most. `overhears`: whether it helps if its sender may not live any more.
    fn open<'a>(
        &mut self,
        now_ns: u64,
        node: Option<NodeIndex>,
        overhears: bool,
        datagram: &'a mut [u8],
    ) -> Result<OpenedFrame<'a>, Told> {
        let is_there = |from| node == Some(from);
        let opened = if overhears && self.opening.is_strange(datagram) {
            self.opening.overhear(datagram, is_there).map(|(head, text)| (head, text, false))
        } else {
            match self.opening.open_from(datagram, is_there) {
                Ok(Opened::Frame(head, text)) => Ok((head, text, true)),
                // A hello is for the other port, which opens and reports it.
                Ok(Opened::Hello(..)) => Err(Rejection::NotOurs.into()),
                Err(why) => Err(why),
            }
        };
        let why = match opened {
            Ok(heard) => return Ok(heard),
            Err(NotOpened::Rejected(why)) => why,
            Err(NotOpened::Bad(BadFrame::Version(_))) => Rejection::Version,
            Err(NotOpened::Bad(_)) => return Err(None),
        };
        Err(self.tally.note(now_ns, node, why).map(|datagrams| (why, datagrams)))
    }
}
