//! Replicas by a session: a line on which nothing is lost while it is up, and which may be slow, as a laptop's Wi-Fi.
//!
//! ```text
//!  ring of the server's node ─▶ part by part, when the line has room ═ TCP ═▶ ReplicaReceiver ─▶ ring there
//!    held: the record that leaves │ waits: the newest one, in the ring
//! ```
//!
//! One record of a stream leaves to a node at a time. It is held in its ring until its last part has left, so it comes
//! whole however slow the line is; a newer one takes the place of the one that waits behind it. Each node has a reader
//! of its own for that. Nothing is asked for again: what was under way when a connection ends is given up at both ends,
//! and the next connection begins with the description and the newest record.

use super::by_level::StreamsByLevel;
use super::counts::{ReplicaCounts, SentReplica};
use super::outgoing::OutgoingReplica;
use super::receiving::ReplicaReceiver;
use super::settings::LineSettings;
use super::{Describe, LINE_PART_BYTES, LINE_PART_ROOM, ReplicaSettings};
use crate::counts::Count;
use crate::frame::{FrameKind, NodeIndex, ReplicaFrame};
use rohrpost_mailbox::{Name, Participant, StreamReader, SystemTime};
use std::sync::Arc;

/// Modules that have begun are looked for this often, ns.
const LOOK_EVERY_NS: u64 = 500_000_000;

/// Tells system time at a moment of the monotonic clock.
pub type TellsTime = Box<dyn Fn(u64) -> SystemTime + Send>;

/// What one node gets.
struct LineDestination {
    node: NodeIndex,
    streams: StreamsByLevel,
    /// Counts its connections, which are its lives; 0: it is not there.
    connection: u64,
}

impl LineDestination {
    fn refresh(&mut self, now_ns: u64) {
        let connection = self.connection;
        self.streams.refresh(now_ns, |_| (connection, connection != 0));
    }
}

/// All replicas of one node that go by sessions, both halves. One thread has it.
pub struct LineReplicas {
    server: NodeIndex,
    nodes: Vec<(NodeIndex, Name)>,
    participant: Arc<Participant>,
    describe: Arc<Describe>,
    time: TellsTime,
    destinations: Vec<LineDestination>,
    receiver: ReplicaReceiver,
    connections: u64,
    look_ns: u64,
    /// Parts of replicas that this node has not.
    unknown: Arc<Count>,
}

impl LineReplicas {
    /// Rings are made when their first record comes.
    pub fn new(
        settings: &LineSettings,
        participant: Arc<Participant>,
        describe: Arc<Describe>,
        time: TellsTime,
    ) -> Self {
        let all = settings.sent.iter().fold(0, |all, replica| all | replica.to);
        let to = |node: &NodeIndex| all & 1 << *node != 0;
        let destination = |node| LineDestination { node, streams: streams_to(node, &settings.sent), connection: 0 };
        let (own, way) = (settings.own, (LINE_PART_BYTES, true));
        let receiver = ReplicaReceiver::of(own, way, &settings.received, participant.clone(), describe.clone());
        Self {
            server: settings.server,
            nodes: settings.nodes.clone(),
            participant,
            describe,
            time,
            destinations: (0..rohrpost_network::NODES_MAX as NodeIndex).filter(to).map(destination).collect(),
            receiver,
            connections: 0,
            look_ns: 0,
            unknown: Arc::default(),
        }
    }

    /// The node of the server.
    pub fn server(&self) -> NodeIndex {
        self.server
    }

    /// On that node: the nodes beyond the LAN, each with the name of its client.
    pub fn nodes(&self) -> &[(NodeIndex, Name)] {
        &self.nodes
    }

    /// Counters of each replica.
    pub fn counts(&self) -> ReplicaCounts {
        let streams = self.destinations.iter().flat_map(|destination| &destination.streams.streams);
        let sent: Vec<Arc<SentReplica>> =
            streams.flat_map(|stream| &stream.destinations).map(|destination| destination.counts.clone()).collect();
        ReplicaCounts { sent, received: self.receiver.counts() }
    }

    /// Parts that came of replicas that this node has not.
    pub fn unknown(&self) -> &Arc<Count> {
        &self.unknown
    }

    /// The streams that are read for nodes that are there, to sleep until there is a record.
    pub fn readers(&mut self) -> impl Iterator<Item = &mut StreamReader> {
        let there = self.destinations.iter_mut().filter(|destination| destination.connection != 0);
        let streams = there.flat_map(|destination| &mut destination.streams.streams);
        streams.filter(|stream| !stream.is_stalled).filter_map(|stream| stream.reader.as_mut())
    }

    /// A node is there by a new connection.
    pub fn came(&mut self, now_ns: u64, node: NodeIndex) {
        self.connections += 1;
        self.set(now_ns, node, self.connections);
    }

    /// It is not any more: what was under way either way is given up.
    pub fn left(&mut self, now_ns: u64, node: NodeIndex) {
        self.set(now_ns, node, 0);
        self.receiver.cut(node);
    }

    fn set(&mut self, now_ns: u64, node: NodeIndex, connection: u64) {
        if let Some(destination) = self.destinations.iter_mut().find(|destination| destination.node == node) {
            destination.connection = connection;
            destination.refresh(now_ns);
        }
    }

    /// Looks for newer records, and now and then which modules have begun, which is a few system calls.
    pub fn refresh(&mut self, now_ns: u64) {
        let looks = now_ns >= self.look_ns;
        if looks {
            self.look_ns = now_ns + LOOK_EVERY_NS;
        }
        for destination in &mut self.destinations {
            if looks {
                destination
                    .streams
                    .streams
                    .iter_mut()
                    .for_each(|stream| stream.look(&self.participant, &*self.describe));
            }
            destination.refresh(now_ns);
        }
    }

    /// Whether there is something to look at for a node: its next part, or records that sampling leaves out.
    pub fn is_behind(&self, node: NodeIndex) -> bool {
        self.streams_to(node).any(|stream| stream.destinations.iter().any(|to| stream.is_behind(to)))
    }

    /// Whether a part waits for a node.
    pub fn waits_for(&self, now_ns: u64, node: NodeIndex) -> bool {
        self.streams_to(node).any(|stream| stream.destinations.iter().any(|to| stream.waits_for(now_ns, to)))
    }

    fn streams_to(&self, node: NodeIndex) -> impl Iterator<Item = &OutgoingReplica> {
        let all = self.destinations.iter().filter(move |destination| destination.node == node);
        all.flat_map(|destination| &destination.streams.streams)
    }

    /// Writes the next part for a node, of streams that are more important than this level: its kind and length. None:
    /// there is none.
    ///
    /// # Panics
    /// When `content` has less than [`LINE_PART_ROOM`] bytes.
    pub fn next_before(
        &mut self,
        now_ns: u64,
        (node, level): (NodeIndex, u8),
        content: &mut [u8],
    ) -> Option<(FrameKind, usize)> {
        let content = &mut content[..LINE_PART_ROOM];
        let destination = self.destinations.iter_mut().find(|destination| destination.node == node)?;
        loop {
            let (at, to) = destination.streams.choose(now_ns, 1 << node, level)?;
            // What is held is there; but a stream that was made anew takes it along, and another one is chosen.
            let stream = &mut destination.streams.streams[at];
            if let Some(filled) = stream.fill(now_ns, &self.time, (to, LINE_PART_BYTES), content) {
                destination.streams.made((at, to));
                return Some(filled);
            }
        }
    }

    /// Takes a part that came from a node, in a life of its end; none: it came from no node that has a replica.
    pub fn take(&mut self, now_ns: u64, (from, life): (Option<NodeIndex>, u64), part: &ReplicaFrame<'_>) {
        let from = (from.unwrap_or(NodeIndex::MAX), life);
        if !self.receiver.take_from(now_ns, || (self.time)(now_ns), from, part) {
            self.unknown.add(1);
        }
    }
}

/// Of all replicas those that a node has by the line.
fn streams_to(node: NodeIndex, replicas: &[ReplicaSettings]) -> StreamsByLevel {
    let own = (0..).zip(replicas).filter(|(_, replica)| replica.to & 1 << node != 0);
    let stream = |of| OutgoingReplica::new(of, std::iter::once(node), LINE_PART_BYTES, true);
    StreamsByLevel::new(own.map(stream).collect())
}
