//! Streams of the server's node and of a client's, their replicas by sessions, and what must hold of them.

use super::{MS, World};
use crate::frame::NodeIndex;
use crate::replication::{LineReplicas, LineSettings, ReplicaSettings};
use crate::session::frame::{HEAD_BYTES, LENGTH_MAX, SessionFrameHead, SessionMessage};
use crate::session::tests::oracle::SessionOracle;
use crate::session::tests::plan::module;
use rohrpost_config::Sampling;
use rohrpost_mailbox::{
    Name, Next, Node, Participant, Stamp, StreamId, StreamReader, StreamShape, StreamWriter, SystemTime,
};
use std::sync::Arc;
use std::time::Duration;

/// The server's node; those of clients have their indices.
pub(in crate::session::tests) const SERVER: NodeIndex = 63;
/// The client of the node on which the last stream is written.
const WRITER: NodeIndex = 0;
const NUMBER: u16 = 7;
/// By place: the module, bytes of a record, records that are kept, the level, and how often one is written, ms.
const STREAMS: [(Name, u32, u32, u8, u64); 3] = [
    (Name::new(1, 112, 0, 0), 40_000, 4, 18, 100),
    (Name::new(1, 240, 0, 0), 64, 64, 2, 10),
    (Name::new(1, 130, 0, 0), 20_000, 4, 12, 70),
];
pub(in crate::session::tests) const PICTURE: usize = 0;
pub(in crate::session::tests) const POSE: usize = 1;
/// It is written on the node of a client.
pub(in crate::session::tests) const BACK: usize = 2;

fn shape(place: usize) -> StreamShape {
    let (_, record_bytes, keep, ..) = STREAMS[place];
    StreamShape { record_bytes, keep, readers: 10, late: Duration::ZERO }
}

/// The record of a sequence: its length and bytes tell it from all others near it.
fn record(place: usize, sequence: u64) -> Vec<u8> {
    let most = u64::from(STREAMS[place].1);
    let len = if place == POSE { most } else { sequence.wrapping_mul(0x9e37_79b9) % (most + 1) };
    (0..len).map(|at| (at * 7 + at / 251 + sequence * 31 + place as u64) as u8).collect()
}

/// Replicas of one end: from where to where, by place.
fn settings(place: usize, node: NodeIndex, to: u64) -> ReplicaSettings {
    ReplicaSettings {
        from: STREAMS[place].0,
        item: "item".into(),
        stream: format!("sensor.{place}/item"),
        shape: shape(place),
        node,
        to,
        sampling: Sampling::Each,
        changed: false,
        delay_alarm_ns: 60_000 * MS,
        deadline_ns: 200 * MS,
        level: STREAMS[place].3,
    }
}

fn line_settings(own: NodeIndex, clients: usize) -> LineSettings {
    let (all, nobody) = ((1 << clients) - 1, |place| settings(place, NodeIndex::MAX, 0));
    let (is_server, is_writer) = (own == SERVER, own == WRITER);
    let sent = [PICTURE, POSE].map(|place| if is_server { settings(place, SERVER, all) } else { nobody(place) });
    let received =
        [PICTURE, POSE].map(|place| if is_server { nobody(place) } else { settings(place, SERVER, 1 << own) });
    let back = [
        if is_writer { settings(BACK, WRITER, 1 << SERVER) } else { nobody(BACK) },
        if is_server { settings(BACK, WRITER, 1 << SERVER) } else { nobody(BACK) },
    ];
    let [back_sent, back_received] = back;
    let nodes = (0..if is_server { clients } else { 0 }).map(|client| (client as NodeIndex, module(client)));
    LineSettings {
        own,
        server: SERVER,
        nodes: nodes.collect(),
        sent: sent.into_iter().chain([back_sent]).collect(),
        received: received.into_iter().chain([back_received]).collect(),
    }
}

/// A reader of a replica.
struct Follower {
    place: usize,
    reader: StreamReader,
    /// The sequence behind the newest that was read.
    next: Option<u64>,
    /// Records that were told to be lost since.
    lost: u64,
    records: u64,
}

/// One node's rings, and the half of its router that carries them.
pub(in crate::session::tests) struct Rings {
    node: Arc<Node>,
    settings: LineSettings,
    pub(in crate::session::tests) line: LineReplicas,
    /// By place: what is written here, and how many records were.
    writers: Vec<(usize, StreamWriter, u64)>,
    followers: Vec<Follower>,
    /// Dropped last.
    _folder: tempfile::TempDir,
}

fn line(node: &Arc<Node>, settings: &LineSettings) -> LineReplicas {
    let time = |ns| SystemTime { ns, epoch: 1, error: Duration::from_micros(10), age: Duration::ZERO };
    LineReplicas::new(
        settings,
        Participant::join(node, Name::NONE).unwrap(),
        Arc::new(|_: &[u8], _: &str| Some(NUMBER)),
        Box::new(time),
    )
}

impl Rings {
    pub(in crate::session::tests) fn new(own: NodeIndex, clients: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        let settings = line_settings(own, clients);
        let id = |place: usize| StreamId { name: STREAMS[place].0, number: NUMBER };
        let join = || Participant::join(&node, Name::NONE).unwrap();
        let is_for =
            |all: &[ReplicaSettings]| (0..STREAMS.len()).filter(|place| all[*place].to != 0).collect::<Vec<_>>();
        let writer = |place: usize| {
            join().describe_replicas(STREAMS[place].0, &[place as u8; 5000]).unwrap();
            (place, join().stream_writer(id(place), shape(place)).unwrap(), 0)
        };
        let follower = |place: usize| Follower {
            place,
            reader: join().stream_reader(id(place)).unwrap(),
            next: None,
            lost: 0,
            records: 0,
        };
        let writers = is_for(&settings.sent).into_iter().map(writer).collect();
        let followers = is_for(&settings.received).into_iter().map(follower).collect();
        Self { line: line(&node, &settings), node, settings, writers, followers, _folder: folder }
    }

    /// The process with the router begins anew.
    pub(super) fn restart(&mut self) {
        self.line = line(&self.node, &self.settings);
    }

    /// Records of a stream that were written here.
    pub(super) fn written(&self, place: usize) -> u64 {
        self.writers.iter().find(|(of, ..)| *of == place).map_or(0, |(.., written)| *written)
    }

    /// Writes what is due at this moment; whether something was.
    pub(in crate::session::tests) fn write(&mut self, now_ms: u64) -> bool {
        let mut has_written = false;
        for (place, writer, written) in &mut self.writers {
            if now_ms.is_multiple_of(STREAMS[*place].4) {
                writer.write(Stamp { epoch: 1, ns: 1000 + *written }, &record(*place, *written)).unwrap();
                *written += 1;
                has_written = true;
            }
        }
        has_written
    }

    /// Reads what came: whole and unchanged, and what is missing is told; no sequence goes back.
    fn follow(&mut self, oracle: &mut SessionOracle) {
        for Follower { place, reader, next, lost, records } in &mut self.followers {
            loop {
                match reader.try_next().unwrap() {
                    Next::Record(came) => {
                        let sequence = came.info().sequence;
                        let expected = next.map(|next| next + *lost);
                        if expected.is_some_and(|expected| expected != sequence) {
                            oracle
                                .broken(format!("of {place} came {sequence}, and {expected:?} was next or told lost"));
                        }
                        if next.is_some_and(|next| sequence < next) {
                            oracle.broken(format!("of {place} came {sequence}, which goes back"));
                        }
                        if came.body() != record(*place, sequence) {
                            oracle.broken(format!("record {sequence} of {place} is not as it was written"));
                        }
                        (*next, *lost, *records) = (Some(sequence + 1), 0, *records + 1);
                        oracle.saw(["pictures", "poses", "records back"][*place]);
                    }
                    Next::Lost(more) => *lost += more,
                    Next::Nothing => break,
                }
            }
        }
    }
}

/// Watches what is made ready for a client: a record that begins is the newest, or was when it was made.
#[derive(Default)]
pub(super) struct Tap {
    bytes: Vec<u8>,
    /// By place: records that were written when the frame before was taken.
    written: [u64; STREAMS.len()],
}

impl Tap {
    /// So many bytes were taken; `written`: records of each stream that are there.
    pub(super) fn took(&mut self, bytes: &[u8], written: [u64; STREAMS.len()], oracle: &mut SessionOracle) {
        self.bytes.extend_from_slice(bytes);
        while let Some((head, rest)) = self.bytes.split_first_chunk::<HEAD_BYTES>() {
            let head = SessionFrameHead::parse(head, LENGTH_MAX).unwrap();
            let Some(frame) = rest.get(..head.length) else { return };
            if let Ok(SessionMessage::Record(part)) = SessionMessage::parse(head, frame) {
                let before = self.written[usize::from(part.place)];
                if part.offset == 0 && part.sequence + 1 < before {
                    oracle.broken(format!("of {} leaves {}, and {before} were written", part.place, part.sequence));
                }
            }
            self.bytes.drain(..HEAD_BYTES + head.length);
            self.written = written;
        }
    }
}

/// The rings of all nodes.
pub(in crate::session::tests) struct AllRings {
    pub(in crate::session::tests) server: Rings,
    pub(in crate::session::tests) clients: Vec<Rings>,
}

impl AllRings {
    pub(super) fn new(clients: usize) -> Self {
        let of = |client: usize| Rings::new(client as NodeIndex, clients);
        Self { server: Rings::new(SERVER, clients), clients: (0..clients).map(of).collect() }
    }

    /// Records of each stream that were written on the server's node.
    pub(super) fn written(&self) -> [u64; STREAMS.len()] {
        std::array::from_fn(|place| self.server.written(place))
    }
}

impl World {
    /// Modules write, and read.
    pub(super) fn turn_rings(&mut self) {
        let Some(rings) = &mut self.rings else { return };
        let now_ms = self.now_ns / MS;
        if self.may_post {
            if rings.server.write(now_ms) {
                self.server_wake_ns = 0;
            }
            for (client, node) in rings.clients.iter_mut().zip(&mut self.nodes) {
                if client.write(now_ms) {
                    node.wake_ns = 0;
                }
            }
        }
        if now_ms.is_multiple_of(5) {
            let all = rings.clients.iter_mut().chain([&mut rings.server]);
            all.for_each(|rings| rings.follow(&mut self.oracle));
        }
    }

    /// The newest record of each stream is on each node that has it.
    pub(in crate::session::tests) fn check_rings(&mut self) {
        let Some(rings) = &self.rings else { return };
        let written = [PICTURE, POSE, BACK].map(|place| rings.server.written(place) + rings.clients[0].written(place));
        let all = rings.clients.iter().enumerate().map(|(client, rings)| (format!("client {client}"), rings));
        let all = all.chain([("the server".into(), &rings.server)]);
        for (end, follower) in all.flat_map(|(end, rings)| rings.followers.iter().map(move |one| (end.clone(), one))) {
            if follower.next != Some(written[follower.place]) {
                let (next, place) = (follower.next, follower.place);
                self.oracle.problems.push(format!("{end} has of {place} up to {next:?} of {}", written[place]));
            }
        }
    }

    /// Records of a stream that a client has read.
    pub(in crate::session::tests) fn records(&self, client: usize, place: usize) -> u64 {
        let followers = self.rings.iter().flat_map(|rings| &rings.clients[client].followers);
        followers.filter(|follower| follower.place == place).map(|follower| follower.records).sum()
    }
}
