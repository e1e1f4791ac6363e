//! What is watched of a node's time: from where it has what it goes by, and that one master alone is followed.

use super::rejected::TimeRejections;
use crate::sim::clock::Now;
use crate::sim::promise::Promise;
use crate::sim::spans::S;
use crate::sim::station::{Arrived, Io};
use rohrpost_mailbox::TimeRecord;
use rohrpost_routers::driver::{TimeEvent, TimeSource};
use rohrpost_routers::frame::{FrameHead, NodeIndex};
use rohrpost_routers::security::PeerSessions;
use rohrpost_routers::time::message::TimeMessage;
use rohrpost_routers::time::{Clock, JOINING_SYNCS, RATE_MAX_PPB, Role, TIME_BYTES, Term, TimeEstimate};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// All routers have begun, and one of them is master.
const STARTED_NS: u64 = S;

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

/// A peer that a node hears, and of which it does not know whether it lives.
pub(in crate::sim) struct UnverifiedPeer {
    pub(in crate::sim) estimate: TimeEstimate,
    pub(in crate::sim) term: Term,
    pub(in crate::sim) is_misled: bool,
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

/// Appends a frame of time, and keeps the last ones that a node uses to find its windows.
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

/// What is watched of one incarnation.
pub(super) struct TimeWatch {
    /// Term and cycle of the Sync that was heard last.
    heard: (Term, u64),
    was_master: bool,
    /// Before a frame is handled: by what it would ask, and its role.
    before: (Option<TimeEstimate>, Role),
    /// The last frames that told the time, newest last.
    told: VecDeque<TimeFrame>,
    /// Those of incarnations that had not shown that they live.
    overheard: BTreeMap<(NodeIndex, u64), VecDeque<TimeFrame>>,
    /// What came last.
    arrived: Option<Arrived>,
    rejections: TimeRejections,
    /// What the page says.
    written: Option<TimeRecord>,
}

impl TimeWatch {
    pub(super) fn new(written: Option<TimeRecord>) -> Self {
        Self {
            heard: (Term::NONE, 0),
            was_master: false,
            before: (None, Role::Listening),
            told: VecDeque::new(),
            overheard: BTreeMap::new(),
            arrived: None,
            rejections: TimeRejections::default(),
            written,
        }
    }

    /// The same, of a node that seals what it sends.
    pub(super) fn sealed(self, all: &Arc<PeerSessions>) -> Self {
        Self { rejections: TimeRejections::of(Some(all.clone())), ..self }
    }

    pub(super) fn reads(&mut self, arrived: Arrived) {
        self.rejections.reads(&arrived);
        self.arrived = Some(arrived);
    }

    pub(super) fn writes(&mut self, record: &TimeRecord) {
        self.written = Some(*record);
    }

    pub(super) fn happened(&mut self, io: &mut Io<'_>, clock: &Clock, event: TimeEvent<'_>) {
        match event {
            TimeEvent::Unsteady { why, .. } => {
                io.line(|| format!("time: {why}"));
                io.oracle.saw("time: unsteady");
            }
            TimeEvent::NotOpened { .. } | TimeEvent::NoFrame => {
                let is_frame = !matches!(event, TimeEvent::NoFrame);
                io.oracle.saw(if is_frame { "time: rejected" } else { "time: no frame" });
                if let Some(arrived) = &self.arrived {
                    self.rejections.is_rejected(io, arrived);
                }
            }
            TimeEvent::Hears => self.before = (clock.coarse(io.now.monotonic_ns), clock.role()),
            TimeEvent::Heard { source, head, rest, taken } => {
                io.line(|| format!("time: {:?} from {}, {source:?}: {taken:?}", head.kind, head.from));
                if let Some(arrived) = &self.arrived {
                    self.rejections.opens(io, arrived, source, head, clock.digest());
                }
                if let (TimeSource::Proven, Ok(TimeMessage::Sync(sync))) = (source, TimeMessage::parse(head.kind, rest))
                    && !sync.replacement
                {
                    self.rejections.syncs(io, clock, head, &sync, taken);
                }
                self.hears(io, clock, (source, taken == Some(Ok(()))), head, rest);
                self.look(io, clock);
            }
            TimeEvent::Sends(datagram) => {
                self.look(io, clock);
                self.sends(io, datagram);
            }
            TimeEvent::NoSession => io.oracle.saw("time: nobody known"),
            TimeEvent::Polled => self.look(io, clock),
        }
    }

    fn hears(
        &mut self,
        io: &mut Io<'_>,
        clock: &Clock,
        (source, is_taken): (TimeSource, bool),
        head: &FrameHead,
        rest: &[u8],
    ) {
        io.oracle.saw(match source {
            TimeSource::Unproven => "time: overheard",
            TimeSource::OtherTable if is_taken => "time: of another configuration",
            TimeSource::Proven if is_taken => "time: taken",
            _ => "time: ignored",
        });
        let (heard_before, role_before) = self.before;
        if source == TimeSource::Unproven && role_before == Role::Master && clock.role() == Role::Listening {
            io.oracle.saw("time: stepped back");
        }
        let Some(message) = TimeMessage::parse(head.kind, rest).ok().filter(|_| is_taken) else { return };
        let Some(told) = self.arrived.as_ref().map(|arrived| told(io, arrived, head, clock.digest(), &message)) else {
            return;
        };
        match (source, told) {
            (TimeSource::Unproven, Some(told)) => {
                note(self.overheard.entry((head.from, head.incarnation)).or_default(), told);
            }
            // A node that hears a master does not go by others.
            (TimeSource::Proven, Some(told))
                if matches!(message, TimeMessage::Sync(_)) || clock.role() == Role::Listening =>
            {
                note(&mut self.told, told);
            }
            _ => {}
        }
        if let (TimeSource::Proven, TimeMessage::Sync(sync)) = (source, message) {
            self.heard = if sync.replacement { self.heard } else { (sync.term, sync.cycle) };
            if sync.replacement && clock.coarse(io.now.monotonic_ns) != heard_before {
                let text = format!("node {} goes by what {} says in the place of the master", io.node, head.from);
                io.oracle.broken(io.now, Promise::OneMaster, text);
            }
        }
    }

    /// No Sync leaves in the place of a master if that one's Sync of this cycle has come.
    fn sends(&self, io: &mut Io<'_>, datagram: &[u8; TIME_BYTES]) {
        let Ok((head, rest)) = FrameHead::parse(datagram) else { return };
        if let Ok(TimeMessage::Sync(sync)) = TimeMessage::parse(head.kind, rest)
            && sync.replacement
            && self.heard == (sync.term, sync.cycle)
        {
            let text = format!("node {} sends in the place of a master that it has heard", io.node);
            io.oracle.broken(io.now, Promise::OneMaster, text);
        }
    }

    /// The term of which this node heard the time last.
    pub(super) fn told_term(&self) -> Term {
        self.told.back().map_or(Term::NONE, |told| told.term)
    }

    /// Whether all of the last frames that told the time were on their way for longer than `way_ns`, with what clocks
    /// may have drifted since: a node that asks relies on one that was not.
    pub(super) fn is_misled(&self, now: Now, way_ns: u64) -> bool {
        are_late(&self.told, now, way_ns)
    }

    /// The unverified peer by which this node would send a hello: its estimate, its term, and whether the node [is
    /// misled](Self::is_misled).
    pub(super) fn overheard(&self, clock: &Clock, now: Now, way_ns: u64) -> Option<UnverifiedPeer> {
        let (from, estimate) = clock.overheard(now.monotonic_ns)?;
        // Of several incarnations of a node it does not say by which: then any of them may mislead it.
        let lives = self.overheard.iter().filter(|((node, _), _)| *node == from).map(|(_, told)| told);
        let is_other = |told: &VecDeque<TimeFrame>| told.iter().any(|told| told.is_other);
        let is_misled = lives.clone().any(|told| are_late(told, now, way_ns) || is_other(told));
        let latest = lives.filter_map(|told| told.back()).max_by_key(|told| told.came_ns);
        Some(UnverifiedPeer { estimate, term: latest.map_or(Term::NONE, |told| told.term), is_misled })
    }

    fn look(&mut self, io: &mut Io<'_>, clock: &Clock) {
        if io.stood_still() {
            return;
        }
        let is_master = clock.role() == Role::Master;
        if is_master && !std::mem::replace(&mut self.was_master, is_master) && io.now.true_ns > STARTED_NS {
            io.oracle.saw("took over");
        }
        self.was_master = is_master;
        io.oracle.times.look(io.now, io.node, clock, &mut io.oracle.problems);
    }

    /// Others see how it stands.
    pub(super) fn publishes(&mut self, io: &mut Io<'_>, clock: &Clock) {
        self.look(io, clock);
        if !io.stood_still() {
            io.oracle.times.publish(io.now, io.node, clock, self.written, &mut io.oracle.problems);
        }
    }
}
