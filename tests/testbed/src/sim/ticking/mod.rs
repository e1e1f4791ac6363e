//! The layer that keeps time: the driver of the shell on a simulated platform, and watched.

mod rejected;
mod watch;

use super::clock::Now;
use super::packages::address;
use super::plan::{Plan, SYSTEM};
use super::promise::Promise;
use super::station::{Arrived, Io, Layer, Port, STRANGER, Sent};
use super::times::Left;
use rohrpost_mailbox::{ERROR_UNKNOWN_NS, TimeRecord, Watched};
use rohrpost_routers::driver::{
    ClockDriver, ClockStep, TIME_DATAGRAM_BYTES, TimeArrival, TimeEvent, TimeInput, TimePlatform, TimeStart,
};
use rohrpost_routers::frame::{FrameHead, NodeIndex};
use rohrpost_routers::security::PeerSessions;
use rohrpost_routers::tdma::SlotTable;
use rohrpost_routers::time::{Clock, Looked, Role, SentId, Stamp, TIME_BYTES, Term, TimeSettings};
use std::collections::VecDeque;
use std::net::IpAddr;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;
use watch::{TimeWatch, UnverifiedPeer};

/// The socket of time.
pub(crate) const PORT: Port = 1;
/// How far off a kernel's stamp is at most, ns; the kernel stamps CLOCK_REALTIME, and the other clock is read around
/// it.
const DOUBT_NS: u32 = 100;
/// Two clocks are read one after the other.
const APART_NS: u64 = 300;
/// Stamps that are waited for at a time: a kernel's queue of errors takes as much memory as the socket's receive
/// buffer, 212 992 bytes by default, and some 770 for each. A master in time slots sends to all nodes in one window.
const AWAITED_MAX: usize = 256;

/// What one incarnation of a router's time is configured with.
pub(crate) fn settings(plan: &Plan, node: usize, incarnation: u64, edition: usize) -> TimeSettings {
    let slots = plan.slots_of(edition);
    TimeSettings {
        system: SYSTEM,
        own: node as u8,
        nodes: plan.nodes.len() as u8,
        masters: slots.map_or(&plan.masters, |slots| &slots.masters).clone(),
        interval: slots.map_or(Duration::from_nanos(plan.shape.interval_ns), |slots| slots.table.cycle),
        digest: super::packages::digest(edition),
        incarnation,
    }
}

/// One incarnation of a router's time.
pub(crate) struct Ticking {
    driver: ClockDriver,
    socket: TimeSocket,
    watch: TimeWatch,
}

struct TimeSocket {
    has_stamps: bool,
    /// Which datagrams are to be stamped, by how many went before.
    awaited: VecDeque<(u64, SentId)>,
    sent: u64,
    /// Stamps and datagrams that the thread has not read yet.
    stamps: VecDeque<(SentId, Stamp)>,
    came: VecDeque<Arrived>,
}

/// What the driver has of the simulated computer.
struct TimeSystem<'a, 'b> {
    socket: &'a mut TimeSocket,
    watch: &'a mut TimeWatch,
    io: &'a mut Io<'b>,
}

impl TimeSocket {
    fn stamp(&self, io: &mut Io<'_>, at: Now) -> Stamp {
        if !self.has_stamps {
            return Stamp::by_us(io.now.monotonic_ns);
        }
        let wrong_ns = io.chance.around(DOUBT_NS.into());
        Stamp { ns: at.monotonic_ns.saturating_add_signed(wrong_ns), doubt_ns: DOUBT_NS, by_kernel: true }
    }
}

impl TimePlatform for TimeSystem<'_, '_> {
    fn local_ns(&self) -> u64 {
        self.io.now.monotonic_ns
    }

    fn monotonic_ns(&self) -> u64 {
        self.io.now.monotonic_ns
    }

    fn looked(&self) -> Looked {
        seen(self.io.now)
    }

    fn next_left(&mut self) -> Option<(SentId, Stamp)> {
        self.socket.stamps.pop_front()
    }

    fn receive(&mut self, datagram: &mut [u8; TIME_DATAGRAM_BYTES]) -> TimeInput {
        let Some(arrived) = self.socket.came.pop_front() else { return TimeInput::Nothing };
        // What is longer is none of time, and is cut off by the kernel.
        let bytes = if arrived.bytes.len() > datagram.len() { 0 } else { arrived.bytes.len() };
        datagram[..bytes].copy_from_slice(&arrived.bytes[..bytes]);
        let (source, stamp) = (arrived.source.map_or(STRANGER, address), self.socket.stamp(self.io, arrived.stamp));
        self.watch.reads(arrived);
        TimeInput::Datagram(TimeArrival { bytes, source, stamp })
    }

    fn send(&mut self, to: NodeIndex, datagram: &[u8]) {
        let TimeSocket { awaited, sent, .. } = &mut *self.socket;
        if let Ok((head, _)) = FrameHead::read(datagram) {
            awaited.push_back((*sent, SentId { to, sequence: head.sequence }));
            if awaited.len() > AWAITED_MAX {
                awaited.pop_front();
            }
        }
        *sent += 1;
        self.io.sent.push(Sent {
            port: PORT,
            to: to.into(),
            bytes: Rc::from(datagram),
            handed: self.io.now,
            sealed_to: None,
        });
    }

    fn write(&mut self, record: &TimeRecord) -> bool {
        self.watch.writes(record);
        true
    }

    fn page(&self) -> Option<TimeRecord> {
        None
    }

    fn note_watched(&mut self, _: &Watched) {}

    fn publish(&mut self, clock: &Clock, _: u64) {
        self.watch.publishes(self.io, clock);
    }

    fn happened(&mut self, clock: &Clock, event: TimeEvent<'_>) {
        self.watch.happened(self.io, clock, event);
    }
}

impl Ticking {
    /// An incarnation that begins now; `left` is what the node's page says. Without kernel stamps it makes do with its
    /// own.
    pub(crate) fn new(settings: TimeSettings, now: Now, left: Left, has_stamps: bool) -> Self {
        let addresses = (0..settings.nodes).map(|node| address(node.into())).collect();
        let start = TimeStart {
            looked: seen(now),
            monotonic_ns: now.monotonic_ns,
            realtime_ns: now.realtime_ns,
            page: left.record,
            watched: left.watched,
        };
        let (driver, _) = ClockDriver::new(settings, addresses, start);
        let (awaited, stamps, came) = (VecDeque::new(), VecDeque::new(), VecDeque::new());
        let socket = TimeSocket { has_stamps, awaited, sent: 0, stamps, came };
        Self { driver, socket, watch: TimeWatch::new(left.record) }
    }

    /// The same, sealing what it sends.
    pub(super) fn sealed(self, all: &Arc<PeerSessions>, in_slots: bool) -> Self {
        Self { driver: self.driver.sealed(all, in_slots), watch: self.watch.sealed(all), ..self }
    }

    /// The same with time slots; all of its datagrams leave in windows.
    pub(super) fn in_slots(self, table: &SlotTable) -> Self {
        Self { driver: self.driver.in_slots(table.for_clock()), ..self }
    }

    /// The core, so that mistakes can be switched on.
    pub(crate) fn clock(&mut self) -> &mut Clock {
        self.driver.clock_mut()
    }

    pub(super) fn core(&self) -> &Clock {
        self.driver.clock()
    }

    fn parts<'a, 'b>(&'a mut self, io: &'a mut Io<'b>) -> (&'a mut ClockDriver, TimeSystem<'a, 'b>) {
        let Self { driver, socket, watch } = self;
        (driver, TimeSystem { socket, watch, io })
    }

    /// With time slots: the thread reads stamps of what `left`, then at most so many datagrams.
    pub(super) fn take(&mut self, io: &mut Io<'_>, most: usize, left: impl FnMut(SentId, Stamp)) {
        let (driver, mut system) = self.parts(io);
        driver.take(&mut system, most, left);
    }

    /// With time slots: sends a datagram in a window.
    pub(super) fn send_in(&mut self, io: &mut Io<'_>, to: NodeIndex, datagram: &[u8; TIME_BYTES]) {
        let (driver, mut system) = self.parts(io);
        driver.send(&mut system, to, datagram);
    }

    /// With time slots: lets others see how it stands.
    pub(super) fn publish(&mut self, io: &mut Io<'_>) {
        let (driver, mut system) = self.parts(io);
        driver.publish(&mut system);
    }

    /// An address that no node has, and that the time of another configuration came from.
    pub(super) fn take_stranger(&mut self) -> Option<IpAddr> {
        self.driver.take_stranger()
    }

    /// The term of which this node heard the time last.
    pub(super) fn told_term(&self) -> Term {
        self.watch.told_term()
    }

    /// See [`TimeWatch::is_misled`].
    pub(super) fn is_misled(&self, now: Now, way_ns: u64) -> bool {
        self.watch.is_misled(now, way_ns)
    }

    /// See [`TimeWatch::overheard`].
    pub(super) fn overheard(&self, now: Now, way_ns: u64) -> Option<UnverifiedPeer> {
        self.watch.overheard(self.driver.clock(), now, way_ns)
    }
}

/// The clocks as a node sees them.
fn seen(Now { monotonic_ns: local_ns, unslewed_ns, slept_ns, .. }: Now) -> Looked {
    Looked { local_ns, unslewed_ns, apart_ns: APART_NS, slept_ns }
}

impl Layer for Ticking {
    fn handle(&mut self, _: &mut Io<'_>, arrived: &Arrived) {
        self.socket.came.push_back(arrived.clone());
    }

    fn left(&mut self, io: &mut Io<'_>, _: Port, index: u64, at: Now) {
        let socket = &mut self.socket;
        socket.awaited.retain(|(other, _)| *other >= index);
        let awaited = socket.awaited.pop_front_if(|(other, _)| *other == index);
        // Now and then the kernel has none.
        if let Some((_, id)) = awaited
            && socket.has_stamps
            && !io.chance.percent(2)
        {
            let stamp = socket.stamp(io, at);
            socket.stamps.push_back((id, stamp));
        }
    }

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        loop {
            let (driver, mut system) = self.parts(io);
            let ClockStep { for_ns, reads } = driver.poll(&mut system);
            if !reads || self.socket.came.is_empty() {
                return io.now.monotonic_ns + for_ns;
            }
        }
    }

    fn dies(&mut self, _: &mut Io<'_>) {}

    fn check(&mut self, io: &mut Io<'_>, _: bool) {
        io.oracle.times.read(io.now, io.node, &mut io.oracle.problems);
        if io.now.true_ns < io.plan.timed_ns {
            return;
        }
        let reading = self.core().reading(io.now.monotonic_ns);
        let own = (self.core().master(), self.core().term());
        io.line(|| format!("time: {:?} of {own:?}, {reading:?}", self.core().role()));
        let page = io.oracle.times.page(io.now, io.node);
        if reading.synchronised && page.is_none_or(|page| page.error_ns >= ERROR_UNKNOWN_NS) {
            let text = format!("node {} knows the time, {reading:?}, and its page says {page:?}", io.node);
            io.oracle.broken(io.now, Promise::TimeBound, text);
        }
        let agreed = *io.oracle.master.get_or_insert(own);
        let role = if own.0.map(usize::from) == Some(io.node) { Role::Master } else { Role::Slave };
        let has_time = (reading.synchronised && reading.term == own.1) || io.now.true_ns < io.plan.stepped_ns;
        if agreed != own || self.core().role() != role || !has_time {
            let text = format!(
                "node {} is {:?} of {own:?}, others of {agreed:?}; it says {reading:?}",
                io.node,
                self.core().role()
            );
            io.oracle.broken(io.now, Promise::OneMaster, text);
        }
    }

    fn close(&mut self, _: &mut Io<'_>) {}
}
