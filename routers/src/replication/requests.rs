//! Requests for parts, between the two threads of replicas of one node.
//!
//! ```text
//!  replicas-in: a part is missing ─▶ outgoing ─▶ replicas-out ═══ UDP ═══▶ replicas-in there
//!                                                                               │
//!        the part again ◀═ UDP ═ replicas-out there ◀─ incoming, a queue a node ─┘
//! ```
//!
//! Bounded queues without locks, made once. What finds its queue full is dropped: parts that are still missing are
//! asked for again. Each node has a queue of its own, so one that asks without end takes no room from others.

use super::settings::ReplicaSettings;
use crate::frame::{self, FrameKind, NodeIndex, PartRequest};
use crate::outbound::Outbound;
use crate::settings::Settings;
use crossbeam_queue::ArrayQueue;
use std::sync::Arc;

/// Requests of this node that wait for its sending thread: of records of 4 MiB about ten.
const OUTGOING_MAX: usize = 32;
/// Requests of one other node that wait.
const INCOMING_MAX: usize = 32;
/// So many of them are looked at before a part leaves: more than are asked for at a time.
const TAKEN_MAX: usize = 4;

/// A request of this node.
#[derive(Clone, Copy, Debug)]
pub(super) struct OutgoingRequest {
    pub(super) to: NodeIndex,
    /// Level of the stream.
    pub(super) level: u8,
    pub(super) request: PartRequest,
}

/// The queues of a node.
pub struct PartRequests {
    outgoing: ArrayQueue<OutgoingRequest>,
    /// By node; none: it has no replica of a stream of this one.
    incoming: Box<[Option<ArrayQueue<PartRequest>>]>,
    /// By place in the configuration: the nodes that may ask, one bit each.
    askers: Box<[u64]>,
}

impl PartRequests {
    /// Empty queues. Takes all their memory now.
    pub fn new(settings: &Settings, replicas: &[ReplicaSettings]) -> Arc<Self> {
        let of = |replica: &ReplicaSettings| if replica.node == settings.own { replica.to } else { 0 };
        let askers: Box<[u64]> = replicas.iter().map(of).collect();
        let all = askers.iter().fold(0, |all, nodes| all | nodes);
        let queue = |node: usize| (all & 1 << node != 0).then(|| ArrayQueue::new(INCOMING_MAX));
        let incoming = (0..settings.nodes.len()).map(queue).collect();
        Arc::new(Self { outgoing: ArrayQueue::new(OUTGOING_MAX), incoming, askers })
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.outgoing.is_empty() && self.incoming.iter().flatten().all(ArrayQueue::is_empty)
    }

    /// A request of another node has come; false: that node has no such replica, or asks faster than it is answered.
    pub(super) fn came(&self, from: NodeIndex, request: &PartRequest) -> bool {
        let may_ask = self.askers.get(usize::from(request.place)).is_some_and(|nodes| nodes & 1 << from != 0);
        let queue = self.incoming.get(usize::from(from)).filter(|_| may_ask);
        queue.and_then(Option::as_ref).is_some_and(|queue| queue.push(*request).is_ok())
    }

    /// What other nodes ask for: a few requests of each at a time, so none of them delays a part for long.
    pub(super) fn take_next(&self) -> impl Iterator<Item = (NodeIndex, PartRequest)> {
        let all = (0..).zip(&self.incoming).filter_map(|(node, queue)| Some((node, queue.as_ref()?)));
        all.flat_map(|(node, queue)| {
            std::iter::from_fn(move || queue.pop()).take(TAKEN_MAX).map(move |request| (node, request))
        })
    }

    /// This node asks; false: too much waits already.
    pub(super) fn ask(&self, request: OutgoingRequest) -> bool {
        self.outgoing.push(request).is_ok()
    }
}

/// What this node asks for, on its way out.
pub(super) struct OwnRequests {
    queues: Arc<PartRequests>,
    next: Option<OutgoingRequest>,
}

impl OwnRequests {
    pub(super) fn new(queues: Arc<PartRequests>) -> Self {
        Self { queues, next: None }
    }

    pub(super) fn queues(&self) -> &Arc<PartRequests> {
        &self.queues
    }

    /// Writes the next request, if there is one, and it is at least as important as what is of this level: its receiver
    /// and length, or when it may leave. For a node that is not there, or has no room in its socket, it is dropped: the
    /// receiving half asks again.
    pub(super) fn next(
        &mut self,
        now_ns: u64,
        level: Option<u8>,
        outbound: &mut Outbound,
        datagram: &mut [u8],
    ) -> Option<Result<(NodeIndex, usize), u64>> {
        loop {
            self.next = self.next.or_else(|| self.queues.outgoing.pop());
            let is_first = |next: &OutgoingRequest| level.is_none_or(|level| next.level <= level);
            let OutgoingRequest { to, level: own, request } = self.next.filter(is_first)?;
            let is_reached = outbound.ready_peers() & 1 << to != 0 && outbound.is_there(now_ns, to);
            if is_reached && let Err(until_ns) = outbound.may_leave(now_ns, own) {
                return Some(Err(until_ns));
            }
            self.next = None;
            if is_reached {
                let bytes = request.write(&mut datagram[frame::HEAD_BYTES..]);
                return Some(Ok((to, outbound.carry(now_ns, (FrameKind::PartRequest, own), to, (datagram, bytes)))));
            }
        }
    }
}
