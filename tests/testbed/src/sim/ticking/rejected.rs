//! Whether a node rejects frames of time only for what is so, and takes none from a wrong address.

use crate::sim::promise::Promise;
use crate::sim::station::{Arrived, Io, Origin};
use crate::sim::table::Group;
use rohrpost_routers::driver::TimeSource;
use rohrpost_routers::frame::{FrameHead, NodeIndex};
use rohrpost_routers::inbound::WINDOW;
use rohrpost_routers::security::{PeerSessions, Port, Rejection};
use rohrpost_routers::time::message::Sync;
use rohrpost_routers::time::{Clock, Ignored, Role, Term};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a node has opened of an incarnation of a peer.
#[derive(Default)]
struct OpenedFrames {
    sequences: Group<u64>,
    highest: u64,
    /// The first one since it is known to live.
    first: Option<u64>,
}

/// What one incarnation of a node has opened, and what it counted before the datagram at hand.
#[derive(Default)]
pub(super) struct TimeRejections {
    all: Option<Arc<PeerSessions>>,
    before: [u64; Rejection::ALL.len()],
    opened: BTreeMap<(NodeIndex, u64), OpenedFrames>,
    /// The incarnation of each peer that was known to live when it was heard last.
    present: BTreeMap<NodeIndex, u64>,
    /// Master, its incarnation and its term, and the id of the Sync that was taken last.
    synced: Option<((NodeIndex, u64, Term), u64)>,
}

impl TimeRejections {
    pub(super) fn of(all: Option<Arc<PeerSessions>>) -> Self {
        Self { all, ..Self::default() }
    }

    fn counted(&self, arrived: &Arrived) -> [u64; Rejection::ALL.len()] {
        let source = arrived.source.map(|node| node as NodeIndex);
        Rejection::ALL.map(|why| self.all.as_ref().map_or(0, |all| all.rejections(Port::Time).of(source, why)))
    }

    pub(super) fn reads(&mut self, arrived: &Arrived) {
        self.before = self.counted(arrived);
    }

    /// A datagram was not opened, or is no frame of time. One that a router sent to this one, and that nobody altered,
    /// - is of another incarnation only if this node knows its sender by another one, or not at all;
    /// - is a replay only if it was opened before, is out of the window, or was sent before its incarnation was known;
    ///
    /// and is rejected for no other reason.
    pub(super) fn is_rejected(&self, io: &mut Io<'_>, arrived: &Arrived) {
        let counted = self.before.into_iter().zip(self.counted(arrived)).map(|(before, after)| after > before);
        let why = Rejection::ALL.into_iter().zip(counted).find(|(_, is_counted)| *is_counted).map(|(why, _)| why);
        let head = FrameHead::read(&arrived.bytes).ok().map(|(head, _)| head);
        let is_allowed = |head: &FrameHead| match why {
            Some(Rejection::OtherIncarnation) => {
                self.all.as_ref().and_then(|all| all.incarnation(head.from)) != Some(head.incarnation)
            }
            Some(Rejection::Replay) => {
                self.opened.get(&(head.from, head.incarnation)).is_none_or(|opened| opened.has(head.sequence))
            }
            _ => false,
        };
        if matches!(arrived.origin, Origin::Sent { .. }) && !head.as_ref().is_some_and(is_allowed) {
            let text = format!("node {} rejects time, {why:?}: {head:?} of node {:?}", io.node, arrived.source);
            io.oracle.broken(io.now, Promise::Rejection, text);
        }
    }

    pub(super) fn opens(&mut self, io: &mut Io<'_>, arrived: &Arrived, source: TimeSource, head: &FrameHead, own: u64) {
        let is_sent = matches!(arrived.origin, Origin::Sent { .. });
        let is_wrong = match source {
            TimeSource::WrongAddress => is_sent,
            TimeSource::OtherTable => is_sent && head.digest == own,
            TimeSource::Proven | TimeSource::Unproven => false,
        };
        if is_wrong {
            let text = format!("node {} takes {head:?} of node {:?} for {source:?}", io.node, arrived.source);
            io.oracle.broken(io.now, Promise::Rejection, text);
        }
        let is_from_its_node = arrived.source == Some(usize::from(head.from));
        if matches!(source, TimeSource::Proven | TimeSource::Unproven) && !is_from_its_node {
            let text = format!("node {} hears time of node {} from {:?}", io.node, head.from, arrived.source);
            io.oracle.broken(io.now, Promise::Admission, text);
        }
        let opened = self.opened.entry((head.from, head.incarnation)).or_default();
        opened.sequences.insert(head.sequence);
        opened.highest = opened.highest.max(head.sequence);
        if source == TimeSource::Proven && self.present.insert(head.from, head.incarnation) != Some(head.incarnation) {
            opened.first = Some(head.sequence);
        }
    }

    /// A Sync of an incarnation that is known to live was handled. The next one of the master that a node follows is
    /// not late. What was ignored for another reason, brought here from another node, is none of these.
    pub(super) fn syncs(
        &mut self,
        io: &mut Io<'_>,
        clock: &Clock,
        head: &FrameHead,
        sync: &Sync,
        taken: Option<Result<(), Ignored>>,
    ) {
        let said = (head.from, head.incarnation, sync.term);
        let is_next = self.synced.is_some_and(|(before, id)| before == said && sync.id > id);
        let is_followed = clock.role() == Role::Slave && clock.term() == sync.term && clock.master() == Some(head.from);
        if taken == Some(Err(Ignored::Late)) && is_next && is_followed {
            let text = format!("node {} ignores the next Sync of its master: {head:?}", io.node);
            io.oracle.broken(io.now, Promise::Rejection, text);
        }
        self.synced = if taken == Some(Ok(())) { Some((said, sync.id)) } else { self.synced };
    }
}

impl OpenedFrames {
    /// Whether a datagram was opened before, or cannot be told from one.
    fn has(&self, sequence: u64) -> bool {
        let is_before = self.first.is_none_or(|first| sequence < first) || sequence + WINDOW <= self.highest;
        is_before || self.sequences.contains(&sequence)
    }
}
