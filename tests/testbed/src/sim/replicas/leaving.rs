//! What leaves by the port of replicas: sealed if it is to be, and checked: each part is of a record as it was written,
//! and requests and repeated parts are bounded as `routers/src/replication` promises.

use super::accounts::RecordSums;
use crate::sim::promise::Promise;
use crate::sim::seals::{checked, sealed};
use crate::sim::spans::S;
use crate::sim::station::{Io, Port, Sent};
use rohrpost_mailbox::{Head, OriginRecord, Stamp};
use rohrpost_routers::counts::Cause;
use rohrpost_routers::driver::NotSent;
use rohrpost_routers::frame::{Frame, NodeIndex, PartRequest, RecordPart, ReplicaFrame};
use rohrpost_routers::outbound::Outbound;
use rohrpost_routers::replication::{ReplicaLoss, SentReplica};
use rohrpost_routers::report::Report;
use rohrpost_routers::security::{PeerSessions, Sealing};
use rohrpost_routers::settings::Settings;
use rohrpost_routers::stats::Stats;
use std::collections::{HashMap, VecDeque};
use std::rc::Rc;
use std::sync::Arc;

/// The socket of replicas.
pub(crate) const PORT: Port = 2;
/// Parts of a record leave again as often as it has parts, and so many times more.
const MORE_AGAIN: u64 = 8;
/// A record is asked for so often at most since the last part came by itself.
const ASKED_MAX: u64 = 32;
/// A replica asks so often a second at most, and so many requests more may wait to leave, or come after a pause.
const ASKED_A_SECOND_MAX: usize = 500 + 32 + 32;

/// Packages do not leave here.
pub(super) struct NoPackages;

impl Report for NoPackages {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], _: Cause) {}
}

/// Where records leave to one after the other: receiver and its incarnation, place, generation and description of the
/// stream.
type Course = (NodeIndex, u64, u16, u16, u32);
/// Requests for one record: place, router and generation of its stream, sequence, first part.
type Requested = (u16, u64, u16, u64, u32);

/// What one incarnation of a router sends by this port.
pub(super) struct Leaving {
    queue: Outbound,
    seals: Option<(Sealing, Arc<PeerSessions>)>,
    /// Of its packages, and of this port.
    all: Arc<Stats>,
    pub(super) stats: Arc<Stats>,
    counts: Vec<Arc<SentReplica>>,
    /// Of each of these, the parts that had left again before the datagram that leaves.
    again: Vec<u64>,
    part_bytes: u64,
    overhead_bytes: usize,
    /// With which sequence each began, as far as is counted, the last that left, and how many passed an absent node.
    firsts: HashMap<Course, (u64, u64, u64)>,
    /// Parts that left again, of each record.
    repeated: HashMap<(Course, u64), u64>,
    requested: HashMap<Requested, u64>,
    /// When requests for each replica left, ns.
    asked_ns: HashMap<u16, VecDeque<u64>>,
}

impl Leaving {
    pub(super) fn new(
        settings: &Settings,
        (all, stats): (Arc<Stats>, Arc<Stats>),
        (queue, seals): (Outbound, Option<(Sealing, Arc<PeerSessions>)>),
        counts: Vec<Arc<SentReplica>>,
    ) -> Self {
        let head_bytes = rohrpost_routers::frame::HEAD_BYTES + rohrpost_network::RECORD_PART_HEAD_BYTES;
        Self {
            queue,
            seals,
            all,
            stats,
            again: vec![0; counts.len()],
            counts,
            part_bytes: (settings.network.datagram_bytes_max - head_bytes) as u64,
            overhead_bytes: settings.overhead_bytes(),
            firsts: HashMap::new(),
            repeated: HashMap::new(),
            requested: HashMap::new(),
            asked_ns: HashMap::new(),
        }
    }

    pub(super) fn queue(&mut self) -> &mut Outbound {
        &mut self.queue
    }

    /// The sessions, where datagrams are sealed.
    pub(super) fn peer_sessions(&self) -> Option<&Arc<PeerSessions>> {
        self.seals.as_ref().map(|(_, all)| all)
    }

    /// Hands a datagram to the kernel, sealed if it is to be.
    pub(super) fn hand_over(&mut self, io: &mut Io<'_>, to: NodeIndex, bytes: &[u8]) -> Result<(), NotSent> {
        let clear = checked(bytes);
        self.watch(io, to, &clear);
        if io.host.unsendable > 0 && io.chance.percent(50) {
            return Err(NotSent);
        }
        let (sealed, sealed_to) = match &mut self.seals {
            None => (Rc::from(bytes), None),
            Some((sealing, all)) => (sealed(sealing, bytes).ok_or(NotSent)?, all.incarnation(to)),
        };
        io.line(|| format!("sends {} bytes to {to} by the port of replicas", bytes.len()));
        io.sent.push(Sent { port: PORT, to: to.into(), bytes: sealed, handed: io.now, sealed_to });
        Ok(())
    }

    fn watch(&mut self, io: &mut Io<'_>, to: NodeIndex, clear: &[u8]) {
        let frame = Frame::parse(clear);
        if io.plan.slots.is_none() {
            let is_alive = matches!(frame, Ok((_, Frame::Alive(_))));
            let bytes = clear.len() + self.overhead_bytes;
            io.oracle.paces_parts(io.now, io.life, (bytes, is_alive), &io.plan.shape);
        }
        match frame {
            Ok((_, Frame::Replica(ReplicaFrame::Record(part)))) => self.leaves(io, to, &part),
            Ok((_, Frame::Replica(ReplicaFrame::Request(request)))) => self.asks(io, to, &request.read()),
            Ok((_, Frame::Replica(ReplicaFrame::Description(_)))) => io.oracle.saw("a part of a description"),
            // Still there.
            _ => {}
        }
    }

    /// A part leaves: of a record as it was written, and not too often.
    fn leaves(&mut self, io: &mut Io<'_>, to: NodeIndex, part: &RecordPart<'_>) {
        io.oracle.saw("a part of a record");
        let says = OriginRecord {
            sequence: part.sequence,
            incarnation: part.incarnation,
            stamp: Stamp { epoch: part.epoch, ns: part.stamp_ns },
            len_bytes: part.len as usize,
        };
        let found = io.oracle.records.find(part.place.into(), &says, (part.offset as usize, part.bytes));
        if let Err(text) = found {
            io.oracle.broken(io.now, Promise::Records, format!("node {} sends a part: {text}", io.node));
        }
        let Some(at) = self.counts.iter().position(|counts| (counts.place, counts.to) == (part.place, to)) else {
            let text = format!("node {} sends a part of {says:?} to node {to}, which has no replica", io.node);
            return io.oracle.broken(io.now, Promise::RecordBounds, text);
        };
        let (again, incarnation) = (self.counts[at].again.get(), self.all.peer(to).link.incarnation.get());
        let course = (to, incarnation, part.place, part.generation, part.description);
        if std::mem::replace(&mut self.again[at], again) == again {
            return self.accounts(io, at, course, part);
        }
        io.oracle.saw("a part of a record again");
        let count = self.repeated.entry((course, part.sequence)).or_default();
        *count += 1;
        let most = u64::from(part.len).div_ceil(self.part_bytes).max(1) + MORE_AGAIN;
        if *count > most {
            let text = format!("node {} sends {count} parts of {says:?} to node {to} again, {most} at most", io.node);
            io.oracle.broken(io.now, Promise::RecordBounds, text);
        }
    }

    /// A record begins to leave: all before it were sent, or are counted with a cause, each of them once.
    fn accounts(&mut self, io: &mut Io<'_>, at: usize, course: Course, part: &RecordPart<'_>) {
        if part.offset > 0 {
            return;
        }
        let RecordSums { sent, not_sent } = RecordSums::of(&self.counts[at]);
        let is_whole = part.bytes.len() == part.len as usize;
        let first = part.sequence.wrapping_add(is_whole.into()).wrapping_sub(sent + not_sent);
        let now = (first, part.sequence, self.counts[at].lost.of(ReplicaLoss::Absent));
        let (before, last, absent) = std::mem::replace(self.firsts.entry(course).or_insert(now), now);
        // To a node that was away the newest goes whatever became of it there, or it is passed over: it counts twice.
        let is_sampled = io.plan.streams[usize::from(part.place)].is_sampled();
        let was_away = part.sequence <= last || now.2 > absent;
        if before.wrapping_sub(first) > u64::from(was_away || is_sampled) {
            let text = format!(
                "node {} begins with record {} of stream {}; {sent} were sent to node {}, {not_sent} are counted with \
                 a cause, and it began with {before}",
                io.node, part.sequence, part.place, course.0
            );
            io.oracle.broken(io.now, Promise::RecordAccounts, text);
        }
    }

    fn asks(&mut self, io: &mut Io<'_>, to: NodeIndex, request: &PartRequest) {
        io.oracle.saw("a request for parts");
        let PartRequest { place, router, generation, sequence, first, .. } = *request;
        let count = self.requested.entry((place, router, generation, sequence, first)).or_default();
        *count += 1;
        let times = self.asked_ns.entry(place).or_default();
        times.push_back(io.now.monotonic_ns);
        while times.front().is_some_and(|then_ns| then_ns + S < io.now.monotonic_ns) {
            times.pop_front();
        }
        let (count, in_a_second) = (*count, times.len());
        let parts = u64::from(io.plan.streams[usize::from(place)].shape.record_bytes).div_ceil(self.part_bytes);
        if count > ASKED_MAX * parts || in_a_second > ASKED_A_SECOND_MAX {
            let text = format!(
                "node {} asks node {to} for record {sequence} of stream {place} for the {count}. time, and of that \
                 stream {in_a_second} times in a second",
                io.node
            );
            io.oracle.broken(io.now, Promise::RecordBounds, text);
        }
    }
}
