//! The layer that keeps time: `Clock`, called as the thread of the shell calls it, and watched.

use super::clock::Now;
use super::plan::{Plan, SYSTEM};
use super::promise::Promise;
use super::seals::TimeSeals;
use super::spans::S;
use super::station::{Arrived, Io, Layer, Port, Sent};
use super::times::Left;
use rohrpost_routers::frame::{FrameHead, NodeIndex};
use rohrpost_routers::security::PeerSessions;
use rohrpost_routers::tdma::SlotTable;
use rohrpost_routers::time::message::TimeMessage;
use rohrpost_routers::time::{
    Clock, JOINING_SYNCS, Looked, RATE_MAX_PPB, Role, SentId, Stamp, Step, TIME_BYTES, Term, TimeEstimate, TimeSettings,
};
use std::collections::{BTreeMap, VecDeque};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

/// The socket of time.
pub const PORT: Port = 1;
/// How far off a kernel's stamp is at most, ns; the kernel stamps CLOCK_REALTIME, and the other clock is read around
/// it.
const DOUBT_NS: u32 = 100;
/// Two clocks are read one after the other.
const APART_NS: u64 = 300;
/// However long nothing comes, its thread looks at its clocks so often, where there are no slots.
const LOOKS_EVERY_NS: u64 = S / 10;
/// All routers have begun, and one of them is master.
const STARTED_NS: u64 = S;
/// Stamps that are waited for at a time.
const AWAITED_MAX: usize = 16;

/// What one incarnation of a router's time is configured with.
pub fn settings(plan: &Plan, node: usize, incarnation: u64, edition: usize) -> TimeSettings {
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

/// A frame that told the time.
#[derive(Clone, Copy, Debug)]
struct TimeFrame {
    term: Term,
    /// It is of another configuration, and so of another table.
    is_other: bool,
    /// How long it was on its way, from where it was handed over, ns; none where nobody knows what time it is by its
    /// term.
    way_ns: Option<u64>,
    /// When it came, true ns.
    came_ns: u64,
}

/// Whom a node hears of which it does not know whether it lives.
pub(super) struct UnverifiedPeer {
    pub(super) estimate: TimeEstimate,
    pub(super) term: Term,
    pub(super) is_misled: bool,
}

/// What a frame told of the time, if it did.
fn told(io: &Io<'_>, arrived: &Arrived, head: &FrameHead, own: u64, message: &TimeMessage) -> Option<TimeFrame> {
    let (term, sent_ns) = match message {
        TimeMessage::Sync(sync) if !sync.replacement => (sync.term, sync.sent_ns),
        TimeMessage::Request(hello) if hello.id == 0 && hello.timed => (hello.term, hello.sent_ns),
        _ => return None,
    };
    let came_ns = arrived.stamp.true_ns;
    let now_ns = io.oracle.times.of_term_ns(io.now, (head.digest, term));
    let way_ns = now_ns.map(|now_ns| now_ns.saturating_sub(sent_ns).saturating_sub(io.now.true_ns - came_ns));
    Some(TimeFrame { term, is_other: head.digest != own, way_ns, came_ns })
}

/// Of as many as count for what a node goes by.
fn note(all: &mut VecDeque<TimeFrame>, told: TimeFrame) {
    all.push_back(told);
    if all.len() > usize::from(JOINING_SYNCS) {
        all.pop_front();
    }
}

/// Whether all of them were on their way for longer, or may have been.
fn are_late(told: &VecDeque<TimeFrame>, now: Now, most_ns: u64) -> bool {
    let drifted_ns = |told: &TimeFrame| (now.true_ns - told.came_ns) * 2 * RATE_MAX_PPB.unsigned_abs() / S;
    told.iter().all(|told| told.way_ns.is_none_or(|way_ns| way_ns + drifted_ns(told) > most_ns))
}

/// One incarnation of a router's time.
pub struct Ticking {
    clock: Clock,
    has_stamps: bool,
    /// Term and cycle of the Sync that was heard last.
    heard: (Term, u64),
    was_master: bool,
    /// The last frames that told the time, newest last.
    told: VecDeque<TimeFrame>,
    /// Those of incarnations that had not shown that they live.
    overheard: BTreeMap<(NodeIndex, u64), VecDeque<TimeFrame>>,
    /// Which datagrams of this layer are to be stamped, by how many went before.
    awaited: VecDeque<(u64, SentId)>,
    sent: u64,
    seals: Option<TimeSeals>,
    /// With time slots: stamps and datagrams that the thread has not read yet.
    stamps: VecDeque<(SentId, Stamp)>,
    came: VecDeque<Arrived>,
}

impl Ticking {
    /// An incarnation that begins now; `page` is what the node's page says. Without kernel stamps it makes do with its
    /// own.
    pub fn new(settings: TimeSettings, now: Now, left: Left, has_stamps: bool) -> Self {
        let mut clock = Clock::new(settings, now.monotonic_ns, now.realtime_ns, left.record)
            .watching(now.monotonic_ns, left.watched);
        clock.look_at_clocks(seen(now));
        Self {
            clock,
            has_stamps,
            heard: (Term::NONE, 0),
            was_master: false,
            told: VecDeque::new(),
            overheard: BTreeMap::new(),
            awaited: VecDeque::new(),
            sent: 0,
            seals: None,
            stamps: VecDeque::new(),
            came: VecDeque::new(),
        }
    }

    /// The same, sealing what it sends.
    pub(super) fn sealed(self, all: &Arc<PeerSessions>, in_slots: bool) -> Self {
        Self { seals: Some(TimeSeals::new(all, in_slots)), ..self }
    }

    /// The same with time slots; all of its datagrams leave in windows.
    pub(super) fn in_slots(self, table: &SlotTable) -> Self {
        Self { clock: self.clock.in_slots(table.for_clock()), ..self }
    }

    /// The core.
    pub fn clock(&mut self) -> &mut Clock {
        &mut self.clock
    }

    /// The same, to be read.
    pub(super) fn core(&self) -> &Clock {
        &self.clock
    }

    /// With time slots: what came waits until the thread reads its socket.
    pub(super) fn keep(&mut self, arrived: &Arrived) {
        self.came.push_back(arrived.clone());
    }

    /// The thread reads stamps of what `left`, then at most so many datagrams.
    pub(super) fn take(&mut self, io: &mut Io<'_>, most: usize, mut left: impl FnMut(SentId, Stamp)) {
        self.look_at_clocks(io);
        for (id, stamp) in std::mem::take(&mut self.stamps) {
            self.clock.sent(id, stamp);
            left(id, stamp);
        }
        for _ in 0..most {
            let Some(arrived) = self.came.pop_front() else { break };
            self.handle(io, &arrived);
        }
    }

    /// With time slots: sends a datagram in a window.
    pub(super) fn send_in(&mut self, io: &mut Io<'_>, to: NodeIndex, datagram: &[u8; TIME_BYTES]) {
        self.look(io);
        let id = FrameHead::parse(datagram).ok().map(|(head, _)| SentId { to, sequence: head.sequence });
        self.send(io, to, id, datagram);
    }

    /// Whether a datagram is a Sync in the place of a master whose own of this cycle has come.
    fn replaces_in_vain(&self, datagram: &[u8]) -> bool {
        let Ok((head, rest)) = FrameHead::parse(datagram) else { return false };
        match TimeMessage::parse(head.kind, rest) {
            Ok(TimeMessage::Sync(sync)) => sync.replacement && self.heard == (sync.term, sync.cycle),
            _ => false,
        }
    }

    /// The term of which this node heard the time last.
    pub(super) fn told_term(&self) -> Term {
        self.told.back().map_or(Term::NONE, |told| told.term)
    }

    /// Whether all of the last frames that told the time were on their way for longer than `way_ns`, with what clocks
    /// may have drifted since: who asks relies on one that was not.
    pub(super) fn is_misled(&self, now: Now, way_ns: u64) -> bool {
        are_late(&self.told, now, way_ns)
    }

    /// By what this node would say a hello that knows no time: whom it hears, by which term, and whether it [is
    /// misled](Self::is_misled).
    pub(super) fn overheard(&self, now: Now, way_ns: u64) -> Option<UnverifiedPeer> {
        let (from, estimate) = self.clock.overheard(now.monotonic_ns)?;
        // Of several incarnations of a node it does not say by which: then any of them may mislead it.
        let lives = self.overheard.iter().filter(|((node, _), _)| *node == from).map(|(_, told)| told);
        let is_other = |told: &VecDeque<TimeFrame>| told.iter().any(|told| told.is_other);
        let is_misled = lives.clone().any(|told| are_late(told, now, way_ns) || is_other(told));
        let latest = lives.filter_map(|told| told.back()).max_by_key(|told| told.came_ns);
        Some(UnverifiedPeer { estimate, term: latest.map_or(Term::NONE, |told| told.term), is_misled })
    }

    fn is_told(&mut self, io: &Io<'_>, arrived: &Arrived, head: &FrameHead, message: &TimeMessage) {
        // Who hears a master does not go by others.
        let goes_by = matches!(message, TimeMessage::Sync(_)) || self.clock.role() == Role::Listening;
        if let Some(told) = told(io, arrived, head, self.clock.digest(), message).filter(|_| goes_by) {
            note(&mut self.told, told);
        }
    }

    /// What some incarnation of a node said at some time.
    fn overhear(&mut self, io: &mut Io<'_>, arrived: &Arrived, stamp: Stamp, head: &FrameHead, rest: &[u8]) {
        let (now_ns, was_master) = (io.now.monotonic_ns, self.clock.role() == Role::Master);
        let taken = self.clock.overhear(now_ns, stamp, head, rest);
        io.line(|| format!("time: overhears {:?} from {}: {taken:?}", head.kind, head.from));
        io.oracle.saw("time: overheard");
        if was_master && self.clock.role() == Role::Listening {
            io.oracle.saw("time: stepped back");
        }
        if let (Ok(()), Ok(message)) = (taken, TimeMessage::parse(head.kind, rest))
            && let Some(told) = told(io, arrived, head, self.clock.digest(), &message)
        {
            note(self.overheard.entry((head.from, head.incarnation)).or_default(), told);
        }
        self.look(io);
    }

    fn send(&mut self, io: &mut Io<'_>, to: NodeIndex, stamp: Option<SentId>, datagram: &[u8; TIME_BYTES]) {
        if self.replaces_in_vain(datagram) {
            let text = format!("node {} sends in the place of a master that it has heard", io.node);
            io.oracle.broken(io.now, Promise::OneMaster, text);
        }
        let bytes = match &mut self.seals {
            None => Some(Rc::from(&datagram[..])),
            Some(seals) => seals.close(datagram),
        };
        let Some(bytes) = bytes else { return io.oracle.saw("time: nobody known") };
        if let Some(id) = stamp {
            self.awaited.push_back((self.sent, id));
            if self.awaited.len() > AWAITED_MAX {
                self.awaited.pop_front();
            }
        }
        self.sent += 1;
        io.sent.push(Sent { port: PORT, to: to.into(), bytes, handed: io.now });
    }

    fn stamp(&self, io: &mut Io<'_>, at: Now) -> Stamp {
        if !self.has_stamps {
            return Stamp::by_us(io.now.monotonic_ns);
        }
        let wrong_ns = io.chance.around(DOUBT_NS.into());
        Stamp { ns: at.monotonic_ns.saturating_add_signed(wrong_ns), doubt_ns: DOUBT_NS, by_kernel: true }
    }

    fn look_at_clocks(&mut self, io: &mut Io<'_>) {
        if let Some(why) = self.clock.look_at_clocks(seen(io.now)) {
            io.line(|| format!("time: {why}"));
            io.oracle.saw("time: unsteady");
        }
    }

    pub(super) fn look(&mut self, io: &mut Io<'_>) {
        if io.stood_still() {
            return;
        }
        let is_master = self.clock.role() == Role::Master;
        if is_master && !std::mem::replace(&mut self.was_master, is_master) && io.now.true_ns > STARTED_NS {
            io.oracle.saw("took over");
        }
        self.was_master = is_master;
        io.oracle.times.look(io.now, io.node, &self.clock, &mut io.oracle.problems);
    }
}

/// The clocks as a node sees them.
fn seen(Now { monotonic_ns: local_ns, unslewed_ns, slept_ns, .. }: Now) -> Looked {
    Looked { local_ns, unslewed_ns, apart_ns: APART_NS, slept_ns }
}

impl Layer for Ticking {
    fn handle(&mut self, io: &mut Io<'_>, arrived: &Arrived) {
        self.look_at_clocks(io);
        let stamp = self.stamp(io, arrived.stamp);
        let now_ns = io.now.monotonic_ns;
        let overhears = self.clock.overhears(now_ns);
        let opened = match &mut self.seals {
            None => Some((arrived.bytes.clone(), true)),
            Some(seals) => seals.open(&arrived.bytes, overhears),
        };
        let Some((bytes, is_proven)) = opened else { return io.oracle.saw("time: rejected") };
        let Ok((head, rest)) = FrameHead::parse(&bytes) else { return io.oracle.saw("time: no frame") };
        if !is_proven {
            return self.overhear(io, arrived, stamp, &head, rest);
        }
        if head.digest != self.clock.digest() {
            let node = arrived.source.map(|source| source as NodeIndex);
            let taken = self.clock.handle_other(now_ns, stamp, node, &head, rest);
            io.line(|| format!("time: {:?} of another configuration: {taken:?}", head.kind));
            io.oracle.saw(if taken.is_ok() { "time: of another configuration" } else { "time: ignored" });
            return self.look(io);
        }
        let heard_before = self.clock.coarse(now_ns);
        let taken = self.clock.handle(now_ns, stamp, &head, rest);
        io.line(|| format!("time: {:?} from {}: {taken:?}", head.kind, head.from));
        io.oracle.saw(if taken.is_ok() { "time: taken" } else { "time: ignored" });
        let message = TimeMessage::parse(head.kind, rest);
        if let (Ok(()), Ok(message)) = (taken, &message) {
            self.is_told(io, arrived, &head, message);
        }
        if let (Ok(()), Ok(TimeMessage::Sync(sync))) = (taken, message) {
            self.heard = if sync.replacement { self.heard } else { (sync.term, sync.cycle) };
            if sync.replacement && self.clock.coarse(now_ns) != heard_before {
                let text = format!("node {} goes by what {} says in the place of the master", io.node, head.from);
                io.oracle.broken(io.now, Promise::OneMaster, text);
            }
        }
        self.look(io);
    }

    fn left(&mut self, io: &mut Io<'_>, _: Port, index: u64, at: Now) {
        self.awaited.retain(|(other, _)| *other >= index);
        let awaited = self.awaited.pop_front_if(|(other, _)| *other == index);
        // Now and then the kernel has none.
        if let Some((_, id)) = awaited
            && self.has_stamps
            && !io.chance.percent(2)
        {
            let stamp = self.stamp(io, at);
            if io.plan.slots.is_some() {
                return self.stamps.push_back((id, stamp));
            }
            self.clock.sent(id, stamp);
            self.look(io);
        }
    }

    fn poll(&mut self, io: &mut Io<'_>) -> u64 {
        self.look_at_clocks(io);
        let mut datagram = [0; TIME_BYTES];
        loop {
            let step = self.clock.poll(io.now.monotonic_ns, &mut datagram);
            self.look(io);
            match step {
                Step::Send { to, stamp } => self.send(io, to, stamp, &datagram),
                Step::Wait { until_ns } => return until_ns.min(io.now.monotonic_ns + LOOKS_EVERY_NS),
            }
        }
    }

    fn dies(&mut self, _: &mut Io<'_>) {}

    fn check(&mut self, io: &mut Io<'_>, _: bool) {
        io.oracle.times.read(io.now, io.node, &mut io.oracle.problems);
        if io.now.true_ns < io.plan.timed_ns {
            return;
        }
        let reading = self.clock.reading(io.now.monotonic_ns);
        let own = (self.clock.master(), self.clock.term());
        io.line(|| format!("time: {:?} of {own:?}, {reading:?}", self.clock.role()));
        let agreed = *io.oracle.master.get_or_insert(own);
        let role = if own.0.map(usize::from) == Some(io.node) { Role::Master } else { Role::Slave };
        let has_time = (reading.synchronised && reading.term == own.1) || io.now.true_ns < io.plan.stepped_ns;
        if agreed != own || self.clock.role() != role || !has_time {
            let text = format!(
                "node {} is {:?} of {own:?}, others of {agreed:?}; it says {reading:?}",
                io.node,
                self.clock.role()
            );
            io.oracle.broken(io.now, Promise::OneMaster, text);
        }
    }

    fn close(&mut self, _: &mut Io<'_>) {}
}
