//! Requests for parts, between the two threads of replicas of one node.
//!
//! ```text
//!  replicas-in: a part is missing ─▶ a ring a replica ─▶ replicas-out ═══ UDP ═══▶ replicas-in there
//!                                                                                       │
//!        the part again ◀═ UDP ═ replicas-out there ◀──────────────── a ring a node ─────┘
//! ```
//!
//! Each ring has one writer and one reader and is wait-free: with time slots the thread of the slots reads it, and a
//! queue of many writers makes its reader spin while a writer that has been preempted is half through. What finds its
//! ring full is dropped: parts that are still missing are asked for again. Each replica and each node has a ring of its
//! own, so none takes room from others, and what is less important holds up nothing.

use super::counts::{ReplicaLoss, SentReplica};
use super::settings::ReplicaSettings;
use crate::frame::{self, FrameKind, NodeIndex, PartRequest, PartRequestBytes};
use crate::outbound::Outbound;
use crate::settings::Settings;
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::Arc;

/// Requests of a replica that wait for the sending thread: of two open records of 4 MiB.
const OUTGOING_MAX: usize = 8;
/// Requests of one other node that wait.
const INCOMING_MAX: usize = 32;
/// So many of them are looked at before a part leaves: more than are asked for at a time.
const TAKEN_MAX: usize = 4;

/// A request of this node.
#[derive(Clone, Copy, Debug)]
pub(super) struct OutgoingRequest {
    pub(super) to: NodeIndex,
    pub(super) request: PartRequest,
}

/// The receiving half's ends of all rings of a node. Made by
/// [`ReplicaSender::requests`](super::ReplicaSender::requests).
pub struct PartRequests {
    /// By place in the configuration; none: this node has no such replica.
    pub(super) outgoing: Vec<Option<Producer<OutgoingRequest>>>,
    pub(super) incoming: IncomingRequests,
}

/// What became of a request of another node.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum RequestFate {
    /// It waits for the sending half.
    Waits,
    /// That node asks faster than it is answered; counted.
    Crowded,
    /// That node has no such replica.
    Refused,
}

/// Requests of other nodes, as they come.
pub(super) struct IncomingRequests {
    /// Of this node's replicas. What is written there by this half is one count that the other does not write.
    counts: Vec<Arc<SentReplica>>,
    /// By node; none: it has no replica of a stream of this one.
    rings: Box<[Option<Producer<PartRequest>>]>,
    /// By place in the configuration: the nodes that may ask, one bit each.
    askers: Box<[u64]>,
}

impl IncomingRequests {
    /// A request of another node has come.
    pub(super) fn came(&mut self, from: NodeIndex, request: &PartRequestBytes<'_>) -> RequestFate {
        let place = request.place();
        let may_ask = self.askers.get(usize::from(place)).is_some_and(|nodes| nodes & 1 << from != 0);
        let Some(Some(ring)) = self.rings.get_mut(usize::from(from)).filter(|_| may_ask) else {
            return RequestFate::Refused;
        };
        if ring.push(request.read()).is_ok() {
            return RequestFate::Waits;
        }
        let counts = self.counts.iter().find(|counts| (counts.place, counts.to) == (place, from));
        counts.into_iter().for_each(|counts| counts.lost.add(ReplicaLoss::Crowded, 1));
        RequestFate::Crowded
    }
}

/// The sending half's ends of all rings of a node.
#[derive(Default)]
pub(super) struct SentRequests {
    /// What this node asks for, the most important first, each with the level of its stream.
    outgoing: Vec<(u8, Consumer<OutgoingRequest>)>,
    /// By node.
    incoming: Vec<(NodeIndex, Consumer<PartRequest>)>,
}

/// Which rings a node needs.
pub(super) struct RequestPlan {
    /// By place in the configuration: the level of a replica that this node has.
    here: Box<[Option<u8>]>,
    /// By place in the configuration: the nodes that may ask, one bit each.
    askers: Box<[u64]>,
    nodes: usize,
}

impl RequestPlan {
    pub(super) fn new(settings: &Settings, replicas: &[ReplicaSettings]) -> Self {
        let is_here = |replica: &&ReplicaSettings| replica.to & 1 << settings.own != 0 && replica.node != settings.own;
        let level = |replica: &ReplicaSettings| Some(replica).filter(is_here).map(|replica| replica.level);
        let askers = |replica: &ReplicaSettings| if replica.node == settings.own { replica.to } else { 0 };
        Self {
            here: replicas.iter().map(level).collect(),
            askers: replicas.iter().map(askers).collect(),
            nodes: settings.nodes.len(),
        }
    }

    /// Empty rings, by their ends; `counts`: of all that this node sends. Takes all their memory now.
    pub(super) fn rings(&self, counts: Vec<Arc<SentReplica>>) -> (PartRequests, SentRequests) {
        let mut sent = SentRequests::default();
        let mut of_replica = |level: u8| {
            let (writes, reads) = RingBuffer::new(OUTGOING_MAX);
            sent.outgoing.push((level, reads));
            writes
        };
        let outgoing = self.here.iter().map(|level| level.map(&mut of_replica)).collect();
        sent.outgoing.sort_by_key(|(level, _)| *level);
        let all = self.askers.iter().fold(0, |all, nodes| all | nodes);
        let mut of_node = |node: NodeIndex| {
            let (writes, reads) = RingBuffer::new(INCOMING_MAX);
            sent.incoming.push((node, reads));
            writes
        };
        let asks = |node: NodeIndex| all & 1 << node != 0;
        let rings = (0..).take(self.nodes).map(|node| asks(node).then(|| of_node(node))).collect();
        let incoming = IncomingRequests { counts, rings, askers: self.askers.clone() };
        (PartRequests { outgoing, incoming }, sent)
    }
}

impl SentRequests {
    /// Whether nothing waits.
    pub(super) fn is_empty(&self) -> bool {
        self.outgoing.iter().all(|(_, ring)| ring.is_empty()) && self.incoming.iter().all(|(_, ring)| ring.is_empty())
    }

    /// What other nodes ask for: a few requests of each at a time, so none of them delays a part for long.
    pub(super) fn take_next(&mut self) -> impl Iterator<Item = (NodeIndex, PartRequest)> {
        self.incoming.iter_mut().flat_map(|(node, ring)| {
            let node = *node;
            (0..TAKEN_MAX).map_while(move |_| ring.pop().ok()).map(move |request| (node, request))
        })
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
        for (own, ring) in self.outgoing.iter_mut().take_while(|(own, _)| level.is_none_or(|level| *own <= level)) {
            while let Ok(&OutgoingRequest { to, request }) = ring.peek() {
                let is_reached = outbound.ready_peers() & 1 << to != 0 && outbound.is_there(now_ns, to);
                if is_reached && let Err(until_ns) = outbound.may_leave(now_ns, *own) {
                    return Some(Err(until_ns));
                }
                // It is there: this is its only reader.
                let _ = ring.pop();
                if is_reached {
                    let bytes = request.write(&mut datagram[frame::HEAD_BYTES..]);
                    let kind = (FrameKind::PartRequest, *own);
                    return Some(Ok((to, outbound.carry(now_ns, kind, to, (datagram, bytes)))));
                }
            }
        }
        None
    }
}
