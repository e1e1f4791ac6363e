//! The receiving half: parts become records of this node's rings, and what is missing is asked for.
//!
//! Records are known by sequence, incarnation and stamp, never by when they come. A sequence does not go back, unless
//! the origin's router says in a later life that its stream was made anew: then so is the replica.

use super::counts::{ReceivedReplica, ReplicaLoss};
use super::description::KnownOrigin;
use super::gathering::Life;
use super::incoming::{IncomingReplica, Now};
use super::requests::{IncomingRequests, PartRequests, RequestFate};
use super::settings::ReplicaSettings;
use super::{Describe, part_bytes};
use crate::frame::{DescriptionPart, FrameHead, NodeIndex, ReplicaFrame};
use crate::settings::Settings;
use rohrpost_mailbox::{Name, NodeError, Participant, StreamId, SystemTime};
use std::sync::Arc;
use std::time::Duration;

/// What time alone makes due is looked at this often, ns: it is due after milliseconds.
const LOOK_EVERY_NS: u64 = 500_000;

/// The receiving half of all replicas of a node. One thread has it.
pub struct ReplicaReceiver {
    participant: Arc<Participant>,
    describe: Arc<Describe>,
    /// By place in the configuration; none: this node has no such replica.
    streams: Vec<Option<IncomingReplica>>,
    /// Of other nodes, to the thread that sends; none: nothing is sent again.
    requests: Option<IncomingRequests>,
    /// Something is waited for.
    waits: bool,
    look_ns: u64,
    /// The thread that sends has something to do.
    rings: bool,
}

impl ReplicaReceiver {
    /// Of all `replicas` those that this node has. Rings are made when their first record comes.
    pub fn new(
        settings: &Settings,
        replicas: &[ReplicaSettings],
        participant: Arc<Participant>,
        describe: Arc<Describe>,
    ) -> Self {
        Self::of(settings.own, (part_bytes(settings), false), replicas, participant, describe)
    }

    /// With parts of so many bytes, by a line or not.
    pub(super) fn of(
        own: NodeIndex,
        (part_bytes, by_line): (usize, bool),
        replicas: &[ReplicaSettings],
        participant: Arc<Participant>,
        describe: Arc<Describe>,
    ) -> Self {
        let incoming = |(place, replica): (u16, &ReplicaSettings)| {
            let is_here = replica.to & 1 << own != 0 && replica.node != own;
            is_here.then(|| IncomingReplica::new(place, replica, part_bytes, by_line))
        };
        let streams = (0..).zip(replicas).map(incoming).collect();
        Self { participant, describe, streams, requests: None, waits: false, look_ns: 0, rings: false }
    }

    /// From now on parts that are missing are asked for, and requests of other nodes are taken. The sending half has
    /// the other ends of these rings.
    #[must_use]
    pub fn asking_by(mut self, requests: PartRequests) -> Self {
        let PartRequests { outgoing, incoming } = requests;
        for (stream, ring) in self.streams.iter_mut().zip(outgoing) {
            stream.iter_mut().zip(ring).for_each(|(stream, ring)| stream.ask_by(ring));
        }
        self.requests = Some(incoming);
        self
    }

    /// Counters of each replica.
    pub fn counts(&self) -> Vec<Arc<ReceivedReplica>> {
        self.streams.iter().flatten().map(|stream| stream.counts.clone()).collect()
    }

    /// Takes what came in a datagram with this head; false when this node has no such replica, or takes no such
    /// request. `system` tells system time now.
    pub fn take(
        &mut self,
        now_ns: u64,
        system: impl Fn() -> SystemTime,
        head: &FrameHead,
        frame: &ReplicaFrame<'_>,
    ) -> bool {
        self.take_from(now_ns, system, (head.from, head.incarnation), frame)
    }

    /// The same of a router in this life.
    pub(super) fn take_from(
        &mut self,
        now_ns: u64,
        system: impl Fn() -> SystemTime,
        (from, router): (NodeIndex, u64),
        frame: &ReplicaFrame<'_>,
    ) -> bool {
        if let ReplicaFrame::Request(request) = frame {
            let Some(requests) = &mut self.requests else { return false };
            let fate = requests.came(from, request);
            self.rings |= fate == RequestFate::Waits;
            return fate != RequestFate::Refused;
        }
        let Some(Some(stream)) = self.streams.get_mut(usize::from(frame.place())) else { return false };
        if stream.settings.node != from {
            stream.lose(ReplicaLoss::Foreign);
            return true;
        }
        match frame {
            ReplicaFrame::Record(part) => {
                let life = Life { router, generation: part.generation };
                let now = Now { ns: now_ns, participant: &self.participant, system: &system };
                stream.take(now, life, part);
                self.waits |= stream.waits(now_ns);
                self.rings |= std::mem::take(&mut stream.has_asked);
            }
            ReplicaFrame::Description(part) => self.describe(now_ns, router, part),
            ReplicaFrame::Request(_) => {}
        }
        true
    }

    /// The connection to a node is over: nothing more comes of what is open.
    pub(super) fn cut(&mut self, from: NodeIndex) {
        let all = self.streams.iter_mut().flatten().filter(|stream| stream.settings.node == from);
        all.for_each(IncomingReplica::cut);
    }

    /// Does what time alone makes due. Says whether it waits for parts: then call it again within milliseconds, though
    /// nothing comes.
    pub fn poll(&mut self, now_ns: u64, system: impl Fn() -> SystemTime) -> bool {
        if self.waits && now_ns >= self.look_ns {
            self.look_ns = now_ns + LOOK_EVERY_NS;
            self.waits = false;
            let now = Now { ns: now_ns, participant: &self.participant, system: &system };
            for stream in self.streams.iter_mut().flatten() {
                self.waits |= stream.poll(now);
                self.rings |= std::mem::take(&mut stream.has_asked);
            }
        }
        self.waits
    }

    /// Whether the thread that sends has something to do since this was asked last.
    pub fn must_ring(&mut self) -> bool {
        std::mem::take(&mut self.rings)
    }

    fn describe(&mut self, now_ns: u64, router: u64, part: &DescriptionPart<'_>) {
        let Some(Some(stream)) = self.streams.get_mut(usize::from(part.place)) else { return };
        let life = Life { router, generation: part.generation };
        if stream.is_over(life) {
            return;
        }
        stream.announced = Some((life, part.written));
        if stream.known.is_some_and(|known| known.check == part.check) {
            return;
        }
        let Some(words) = stream.assembly.take(part) else { return };
        if !stream.may_describe(now_ns) {
            return stream.lose(ReplicaLoss::Undescribed);
        }
        let Some(number) = (self.describe)(&words, &stream.settings.item) else {
            stream.lose(ReplicaLoss::Undescribed);
            return stream.tell("the description that came with it names no such stream");
        };
        let name = stream.settings.from;
        let patience = stream.patience();
        let laid = self.lay_down(name, &words, patience);
        let Some(Some(stream)) = self.streams.get_mut(usize::from(part.place)) else { return };
        match laid {
            Ok(()) => stream.is_described(KnownOrigin { check: part.check, id: StreamId { name, number } }),
            Err(error) => stream.tell(&error.to_string()),
        }
    }

    /// Lays a module's description down here, unless it is there. Records that were written by another one are not read
    /// by this one: their rings go.
    fn lay_down(&mut self, module: Name, words: &[u8], patience: Duration) -> Result<(), NodeError> {
        let node = self.participant.node();
        if node.about(module).as_deref() == Some(words) {
            return Ok(());
        }
        let all = self.streams.iter_mut().flatten().filter(|stream| stream.settings.from == module);
        all.for_each(IncomingReplica::forget);
        for id in node.streams()?.into_iter().filter(|id| id.name == module) {
            node.remove_orphan_stream_within(id, patience)?;
        }
        self.participant.describe_replicas(module, words)
    }
}
