//! The sending half: which part of which record leaves next.
//!
//! Each node that has a replica has a place of its own in the stream, so one without room in its socket delays no
//! other. A place that is behind by more than half of the ring goes on with the newest record: older ones would be
//! overwritten on their way. What such a node asks for again goes before what is new to it. Requests of this node for
//! parts of others leave here as well, each at the level of its stream, and before parts of that level.

use super::by_level::StreamsByLevel;
use super::counts::SentReplica;
use super::outgoing::OutgoingReplica;
use super::requests::{PartRequests, RequestPlan, SentRequests};
use super::settings::ReplicaSettings;
use super::{Describe, part_bytes};
use crate::frame::{self, NodeIndex, RECORD_PART_HEAD_BYTES};
use crate::outbound::Outbound;
use crate::settings::Settings;
use rohrpost_mailbox::{Participant, StreamReader, SystemTime};
use rohrpost_network::LEVELS;
use std::sync::Arc;

/// Next step for the code around the core.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ReplicaStep {
    /// Send the first bytes of the buffer as one datagram, then ask again.
    Send {
        /// Receiver.
        to: NodeIndex,
        /// Length.
        bytes: usize,
    },
    /// Something waits for the wire, at the most until then, ns of the monotonic clock.
    Wait {
        /// Until when.
        until_ns: u64,
    },
    /// Nothing before this time, unless a record is written.
    Idle {
        /// Until when.
        until_ns: u64,
    },
}

/// The sending half of all replicas of a node's streams. One thread has it.
pub struct ReplicaSender {
    part_bytes: usize,
    /// Incarnation of this router.
    incarnation: u64,
    plan: RequestPlan,
    requests: SentRequests,
    /// The nodes that such requests go to, one bit each.
    origins: u64,
    by_level: StreamsByLevel,
}

impl ReplicaSender {
    /// Of all `replicas` those that are written on this node.
    pub fn new(settings: &Settings, replicas: &[ReplicaSettings]) -> Self {
        let own = (0..).zip(replicas).filter(|(_, replica)| replica.node == settings.own);
        let part_bytes = part_bytes(settings);
        let streams = own.map(|of| OutgoingReplica::new(of, settings.peers(), part_bytes, false));
        let by_level = StreamsByLevel::new(streams.collect());
        let here = replicas.iter().filter(|replica| replica.to & 1 << settings.own != 0);
        let origins = here.fold(0, |all, replica| all | 1 << replica.node) & !(1 << settings.own);
        let (plan, requests) = (RequestPlan::new(settings, replicas), SentRequests::default());
        Self { part_bytes, incarnation: settings.incarnation, plan, requests, origins, by_level }
    }

    /// Whether no stream of this node has a replica, and this one has none.
    pub fn is_empty(&self) -> bool {
        self.by_level.streams.is_empty() && self.origins == 0
    }

    /// Rings between this half and [`ReplicaReceiver::asking_by`](super::ReplicaReceiver::asking_by): that one's ends.
    /// What was there before is for nobody.
    pub fn requests(&mut self) -> PartRequests {
        let (receiving, sending) = self.plan.rings(self.counts());
        self.requests = sending;
        receiving
    }

    /// The nodes that something goes to, one bit each.
    pub(crate) fn peers(&self) -> u64 {
        let all = self.by_level.streams.iter().flat_map(|stream| &stream.destinations);
        all.fold(self.origins, |peers, destination| peers | 1 << destination.peer)
    }

    /// Counters of each replica and node.
    pub fn counts(&self) -> Vec<Arc<SentReplica>> {
        let all = self.by_level.streams.iter().flat_map(|stream| &stream.destinations);
        all.map(|destination| destination.counts.clone()).collect()
    }

    /// Looks which modules have begun, and what they say of their streams. A few system calls: call it now and then.
    pub fn look(&mut self, participant: &Arc<Participant>, describe: &Describe) {
        self.by_level.streams.iter_mut().for_each(|stream| stream.look(participant, describe));
    }

    /// The streams that are read, to sleep until there is a record, and whether a request waits.
    pub fn waits_on(&mut self) -> (Vec<&mut StreamReader>, impl Fn() -> bool + '_) {
        let Self { by_level, requests, .. } = self;
        let awaited = by_level.streams.iter_mut().filter(|stream| !stream.is_stalled);
        (awaited.filter_map(|stream| stream.reader.as_mut()).collect(), || !requests.is_empty())
    }

    /// The next datagram, or when to ask again. `datagram` has room for the largest; `system` tells system time at a
    /// moment of the monotonic clock.
    ///
    /// # Panics
    /// If it has not.
    pub fn poll(
        &mut self,
        now_ns: u64,
        system: impl Fn(u64) -> SystemTime,
        outbound: &mut Outbound,
        datagram: &mut [u8],
    ) -> ReplicaStep {
        self.by_level.refresh(now_ns, |peer| (outbound.incarnation_of(peer), outbound.is_there(now_ns, peer)));
        for (from, request) in self.requests.take_next() {
            let stream = self.by_level.streams.iter_mut().find(|stream| stream.place == request.place);
            stream.into_iter().for_each(|stream| stream.ask(from, &request, (self.incarnation, self.part_bytes)));
        }
        loop {
            let ready = outbound.ready_peers();
            let chosen = self.by_level.choose(now_ns, ready, LEVELS as u8);
            let level = chosen.map(|(at, _)| self.by_level.streams[at].settings.level);
            match self.requests.next(now_ns, level, outbound, datagram) {
                Some(Ok((to, bytes))) => return ReplicaStep::Send { to, bytes },
                Some(Err(until_ns)) => return ReplicaStep::Wait { until_ns },
                None => {}
            }
            let Some((at, to)) = chosen else { return self.wait(now_ns) };
            let stream = &mut self.by_level.streams[at];
            let level = stream.settings.level;
            if let Err(until_ns) = outbound.may_leave(now_ns, level) {
                return ReplicaStep::Wait { until_ns };
            }
            // A record that was overwritten meanwhile is gone: another one is chosen.
            // Behind it is room for a seal.
            let content = &mut datagram[frame::HEAD_BYTES..][..RECORD_PART_HEAD_BYTES + self.part_bytes];
            let filled = stream.fill(now_ns, &system, (to, self.part_bytes), content);
            let Some((kind, bytes)) = filled else { continue };
            let peer = stream.destinations[to].peer;
            self.by_level.made((at, to));
            let bytes = outbound.carry(now_ns, (kind, level), peer, (datagram, bytes));
            return ReplicaStep::Send { to: peer, bytes };
        }
    }

    fn wait(&self, now_ns: u64) -> ReplicaStep {
        let all =
            || self.by_level.streams.iter().flat_map(|stream| stream.destinations.iter().map(move |to| (stream, to)));
        if all().any(|(stream, to)| stream.is_behind(to)) {
            // For room in a socket: that is known elsewhere.
            return ReplicaStep::Wait { until_ns: u64::MAX };
        }
        // What is due and not under way is for a node that is not there.
        let due = all().map(|(_, to)| to.describe_ns).filter(|at_ns| *at_ns > now_ns);
        ReplicaStep::Idle { until_ns: due.min().unwrap_or(u64::MAX) }
    }
}
