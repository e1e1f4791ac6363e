//! A clock's core and what it has of the system: its socket, the kernel's stamps, the node's page, and what others may
//! look at. Its owner runs the thread, and decides when that sends.

use super::local::LocalClock;
use super::socket::{ReceivedDatagram, TimeSocket};
use super::state::{ClockSnapshot, ClockState};
use super::{ClockError, ClockParts};
use crate::frame::{BadFrame, FrameHead, NodeIndex};
use crate::impair::{Impairment, ImpairmentStep};
use crate::security::{NotOpened, Opened, Opening, PeerSessions, Port, Rejection, Sealing, TAG_BYTES, Tally};
use crate::time::{Clock, Exchange, InSlots, SentId, Stamp, TIME_BYTES};
use rohrpost_mailbox::{TimeKeeper, TimeRecord, realtime_ns};
use std::net::{IpAddr, SocketAddr};
use std::os::fd::{AsFd, BorrowedFd};
use std::sync::Arc;
use std::sync::mpsc::SyncSender;

/// A record that came too late is made anew, so often.
const WRITE_TRIES: usize = 8;

/// Room for a datagram of time, and what seals it.
const SEALED_BYTES: usize = TIME_BYTES + TAG_BYTES;

/// What the impairment keeps of a datagram besides its bytes.
#[derive(Clone, Copy)]
struct DelayedArrival {
    source: IpAddr,
    stamp: Stamp,
    since_ns: u64,
}

/// All of a clock but its thread.
pub(in crate::shell) struct Works {
    pub(in crate::shell) clock: Clock,
    local: LocalClock,
    socket: TimeSocket,
    keeper: Option<TimeKeeper>,
    written: Option<TimeRecord>,
    impairment: Option<Impairment<DelayedArrival>>,
    observer: Option<SyncSender<Exchange>>,
    seals: Option<Seals>,
    state: Arc<ClockState>,
    snapshot: ClockSnapshot,
    system: u8,
    /// Sends time of another configuration, from an address that no node has; it is to be refused.
    refuse: Option<IpAddr>,
}

/// What seals and opens datagrams of time.
struct Seals {
    sealing: Sealing,
    opening: Opening,
    tally: Tally,
}

/// A datagram of time that was opened.
enum TimeDatagram<'a> {
    /// Of an incarnation that is known to live.
    Proven(FrameHead, &'a [u8]),
    /// Of one that may be over.
    Overheard(FrameHead, &'a [u8]),
}

impl Seals {
    /// What was sealed to this node; all else is counted, and told of once a second at most. `overhears`: whether it
    /// helps if its sender may not live any more.
    fn open<'a>(
        &mut self,
        now_ns: u64,
        source: IpAddr,
        node: Option<NodeIndex>,
        overhears: bool,
        datagram: &'a mut [u8],
    ) -> Option<TimeDatagram<'a>> {
        let is_there = |from| node == Some(from);
        let opened = if overhears && self.opening.is_strange(datagram) {
            self.opening.overhear_from(datagram, is_there).map(|(head, text)| TimeDatagram::Overheard(head, text))
        } else {
            match self.opening.open_from(datagram, is_there) {
                Ok(Opened::Frame(head, text)) => Ok(TimeDatagram::Proven(head, text)),
                // A hello is for the other port: the one that opens says so.
                Ok(Opened::Hello(..)) => Err(Rejection::NotOurs.into()),
                Err(why) => Err(why),
            }
        };
        let why = match opened {
            Ok(heard) => return Some(heard),
            Err(NotOpened::Rejected(why)) => why,
            Err(NotOpened::Bad(BadFrame::Version(_))) => Rejection::Version,
            Err(NotOpened::Bad(_)) => return None,
        };
        if let Some(datagrams) = self.tally.note(now_ns, node, why) {
            tracing::warn!("takes no time from {source}: {why} (datagrams: {datagrams})");
        }
        None
    }
}

impl Works {
    /// Binds the socket. What an earlier incarnation of this router wrote in the node's page goes on.
    pub(in crate::shell) fn new(parts: ClockParts) -> Result<Self, ClockError> {
        let ClockParts { settings, nodes, node, impair, kernel_stamps, skew, observer } = parts;
        let (own, system) = (settings.own, settings.system);
        let at = nodes.get(usize::from(own)).copied().unwrap_or(SocketAddr::new(IpAddr::from([0; 16]), 0));
        let socket = TimeSocket::open(at, &nodes, settings.digest, kernel_stamps)
            .map_err(|error| ClockError::Socket(at, error))?;
        let keeper = node.as_ref().map(TimeKeeper::resume).transpose()?;
        let local = LocalClock::new(skew);
        let page = keeper.as_ref().and_then(TimeKeeper::record);
        let watched = keeper.as_ref().and_then(TimeKeeper::watched);
        let clock = Clock::new(settings, local.now_ns(), realtime_ns(), page).watching(local.now_ns(), watched);
        let snapshot = ClockSnapshot::of(&clock, local.now_ns());
        let mut works = Self {
            clock,
            local,
            socket,
            written: page,
            keeper,
            impairment: impair.map(|impair| Impairment::new(impair, u64::from(own) | 0x7469_6d65_0000)),
            observer,
            seals: None,
            state: Arc::new(ClockState::new(snapshot)),
            snapshot,
            system,
            refuse: None,
        };
        works.look_at_clocks();
        Ok(works)
    }

    /// From now on it seals what it sends, and takes only what is sealed to it, if there is something to seal with.
    pub(in crate::shell) fn sealed(self, all: Option<&Arc<PeerSessions>>) -> Self {
        self.sealing(all, |all| Sealing::new(all, Port::Time))
    }

    /// Seals in time slots.
    pub(in crate::shell) fn sealed_in_slots(self, all: Option<&Arc<PeerSessions>>) -> Self {
        self.sealing(all, Sealing::of_slots)
    }

    fn sealing(self, all: Option<&Arc<PeerSessions>>, sealing: impl Fn(&Arc<PeerSessions>) -> Sealing) -> Self {
        let Some(all) = all else { return self };
        let (opening, tally) = (Opening::new(all, Port::Time), Tally::new(all.rejections(Port::Time)));
        Self { socket: self.socket.sealed(), seals: Some(Seals { sealing: sealing(all), opening, tally }), ..self }
    }

    /// From now on its clock goes by the rules of time slots.
    pub(in crate::shell) fn in_slots(self, settings: InSlots) -> Self {
        Self { clock: self.clock.in_slots(settings), ..self }
    }

    /// What others may look at.
    pub(in crate::shell) fn state(&self) -> &Arc<ClockState> {
        &self.state
    }

    /// Local time.
    pub(in crate::shell) fn now_ns(&self) -> u64 {
        self.local.now_ns()
    }

    /// Whether its thread goes before others.
    pub(in crate::shell) fn runs_in_real_time(&mut self, does: bool) {
        self.snapshot.real_time = does;
    }

    /// Hands a datagram of time to the kernel.
    pub(in crate::shell) fn send(&mut self, to: NodeIndex, datagram: &[u8; TIME_BYTES]) -> bool {
        let Some(seals) = &mut self.seals else { return self.socket.send(to, datagram) };
        let mut sealed = [0; SEALED_BYTES];
        sealed[..TIME_BYTES].copy_from_slice(datagram);
        // A peer without a session yet is told the time later.
        seals.sealing.close(&mut sealed).is_ok() && self.socket.send(to, &sealed)
    }

    /// Takes what came, `most` datagrams of it, without waiting: stamps of what `left`, then datagrams; when the
    /// impairment has more. When each left is known before an answer to it is read.
    pub(in crate::shell) fn take(&mut self, most: usize, left: impl FnMut(SentId, Stamp)) -> u64 {
        self.look_at_clocks();
        self.take_stamps(left);
        self.take_datagrams(most)
    }

    /// Before anything is measured by it: whether the local clock is one to measure by.
    fn look_at_clocks(&mut self) {
        let looked = self.local.looked();
        let was_steady = self.clock.unsteady(looked.local_ns).is_none();
        if let Some(why) = self.clock.look_at_clocks(looked)
            && was_steady
        {
            tracing::warn!("nothing is known of the time until it has been measured anew: {why}");
        }
        if let Some((keeper, watched)) = self.keeper.as_mut().zip(self.clock.watched()) {
            keeper.note_watched(&watched);
        }
    }

    fn take_stamps(&mut self, mut left: impl FnMut(SentId, Stamp)) {
        while let Some((id, realtime_ns)) = self.socket.sent() {
            if let Some(stamp) = self.local.stamp(realtime_ns) {
                self.clock.sent(id, stamp);
                left(id, stamp);
            }
        }
    }

    /// Address that is to be told of another configuration, where nothing is sealed.
    pub(in crate::shell) fn refuses(&mut self) -> Option<IpAddr> {
        self.refuse.take()
    }

    /// Lets others see how it stands: writes the node's page, and shows it to tools.
    pub(in crate::shell) fn publish(&mut self) {
        self.write_page();
        self.show();
    }

    /// Takes what came; when the impairment has more.
    fn take_datagrams(&mut self, most: usize) -> u64 {
        let mut datagram = [0; SEALED_BYTES];
        for _ in 0..most {
            let Some(ReceivedDatagram { bytes, source, realtime_ns }) = self.socket.receive(&mut datagram) else {
                break;
            };
            let now_ns = self.local.now_ns();
            let stamp = realtime_ns.and_then(|ns| self.local.stamp(ns)).unwrap_or(Stamp::by_us(now_ns));
            match &mut self.impairment {
                Some(impairment) => {
                    impairment.push(now_ns, DelayedArrival { source, stamp, since_ns: now_ns }, &datagram[..bytes])
                }
                None => self.hand(now_ns, source, stamp, &mut datagram[..bytes]),
            }
        }
        self.take_held(&mut datagram)
    }

    /// What the impairment has kept for long enough came so much later.
    fn take_held(&mut self, datagram: &mut [u8; SEALED_BYTES]) -> u64 {
        loop {
            let now_ns = self.local.now_ns();
            let Some(impairment) = &mut self.impairment else { return u64::MAX };
            let (DelayedArrival { source, stamp, since_ns }, held) = match impairment.poll(now_ns) {
                ImpairmentStep::Send { to, datagram } => (to, datagram),
                ImpairmentStep::Wait { until_ns } => return until_ns,
            };
            let bytes = held.len().min(SEALED_BYTES);
            datagram[..bytes].copy_from_slice(&held[..bytes]);
            let stamp = Stamp { ns: stamp.ns + (now_ns - since_ns), ..stamp };
            self.hand(now_ns, source, stamp, &mut datagram[..bytes]);
        }
    }

    fn hand(&mut self, now_ns: u64, source: IpAddr, stamp: Stamp, datagram: &mut [u8]) {
        let overhears = self.clock.overhears(now_ns);
        let opened = match &mut self.seals {
            None => FrameHead::parse(datagram).ok().map(|(head, rest)| TimeDatagram::Proven(head, rest)),
            Some(seals) => seals.open(now_ns, source, self.socket.node_at(source), overhears, datagram),
        };
        let taken = match opened {
            Some(TimeDatagram::Proven(head, rest)) if head.digest != self.clock.digest() => {
                let node = self.socket.node_at(source);
                // No other part refuses a sender with an address of no node here.
                self.refuse = self.refuse.or((node.is_none() && head.system == self.system).then_some(source));
                self.clock.handle_other(now_ns, stamp, node, &head, rest).is_ok()
            }
            Some(TimeDatagram::Proven(head, rest)) if self.socket.is_from(head.from, source) => {
                self.clock.handle(now_ns, stamp, &head, rest).is_ok()
            }
            Some(TimeDatagram::Overheard(head, rest)) if self.socket.is_from(head.from, source) => {
                self.clock.overhear(now_ns, stamp, &head, rest).is_ok()
            }
            _ => false,
        };
        self.snapshot.ignored += u64::from(!taken);
        if let Some(exchange) = self.clock.take_exchange() {
            (self.snapshot.exchanges, self.snapshot.by_kernel) = (self.snapshot.exchanges + 1, exchange.by_kernel);
            if let Some(observer) = &self.observer {
                // An observer that does not keep up misses some.
                let _ = observer.try_send(exchange);
            }
        }
    }

    fn write_page(&mut self) {
        let Some(keeper) = &mut self.keeper else { return };
        for _ in 0..WRITE_TRIES {
            let record = *self.clock.record();
            if self.written == Some(record) {
                return;
            }
            if keeper.write(&record) {
                self.written = Some(record);
            } else if let Some(page) = keeper.record() {
                self.clock.page_says(self.local.now_ns(), &page);
            }
        }
    }

    fn show(&mut self) {
        let ClockSnapshot { exchanges, by_kernel, ignored, real_time, .. } = self.snapshot;
        let seen = ClockSnapshot::of(&self.clock, self.local.now_ns());
        self.snapshot = ClockSnapshot { exchanges, by_kernel, ignored, real_time, ..seen };
        self.state.show(&self.snapshot);
    }
}

impl AsFd for Works {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}
