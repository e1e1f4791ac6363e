//! Both halves, over a wire in memory: with the outbound and the inbound that ship, and rings of two nodes.

mod asked;
mod asking;
mod by_line;
mod changed;
mod damaged;
mod hops;
mod hostile;
mod joining;
mod lives;
mod lossy;
mod older;
mod reordered;
mod requests;
mod sealed;
mod slow;
mod stepped;
mod turns;
mod two_hops;

use super::{Describe, ReceivedReplica, ReplicaLoss, ReplicaReceiver, ReplicaSender, ReplicaSettings, ReplicaStep};
use crate::counts::Count;
use crate::frame::{FrameHead, NodeIndex, ReplicaFrame};
use crate::harness::{MS, START, address, settings};
use crate::inbound::{Datagram, Inbound};
use crate::outbound::Outbound;
use crate::report::{Deliver, NotDelivered, Report, RouterEvent};
use crate::settings::Settings;
use crate::stats::Stats;
use rohrpost_config::Sampling;
use rohrpost_mailbox::{
    Head, Missed, Name, Next, Node, Participant, Stamp, StreamId, StreamReader, StreamShape, StreamWriter, SystemTime,
};
use std::sync::Arc;
use std::time::Duration;

const CAMERA: Name = Name::new(1, 112, 0, 0);
const NUMBER: u16 = 7;
const ID: StreamId = StreamId { name: CAMERA, number: NUMBER };
const SHAPE: StreamShape = StreamShape { record_bytes: 6000, keep: 16, readers: 3, late: Duration::ZERO };
const ORIGIN: NodeIndex = 0;
const HOLDER: NodeIndex = 1;

/// A description is the number of its stream `image`, and more.
pub(super) struct FirstByte;

impl Describe for FirstByte {
    fn number(&self, description: &[u8], item: &str) -> Option<u16> {
        description.first().filter(|_| item == "image").map(|number| u16::from(*number))
    }
}

fn words(of: u8) -> Vec<u8> {
    let mut words = vec![of; 4000];
    words[0] = NUMBER as u8;
    words
}

fn image() -> ReplicaSettings {
    ReplicaSettings {
        from: CAMERA,
        item: "image".into(),
        stream: "camera.0/image".into(),
        shape: SHAPE,
        node: ORIGIN,
        to: 1 << HOLDER,
        sampling: Sampling::Each,
        changed: false,
        delay_alarm_ns: 5 * MS,
        deadline_ns: 200 * MS,
        level: 18,
    }
}

struct Ground {
    _folder: tempfile::TempDir,
    node: Arc<Node>,
}

impl Ground {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        Self { _folder: folder, node }
    }

    fn join(&self) -> Arc<Participant> {
        Participant::join(&self.node, Name::NONE).unwrap()
    }
}

/// Both halves of a node's router.
struct Router {
    outbound: Outbound,
    stats: Arc<Stats>,
    sender: ReplicaSender,
    inbound: Inbound,
    receiver: ReplicaReceiver,
}

impl Router {
    fn new(ground: &Ground, settings: &Settings, replicas: &[ReplicaSettings]) -> Self {
        let stats = Stats::new(settings, START);
        let mut sender = ReplicaSender::new(settings, replicas);
        let receiver = ReplicaReceiver::new(settings, replicas, ground.join(), Arc::new(FirstByte));
        let receiver = receiver.asking_by(sender.requests());
        let outbound = Outbound::new(settings, stats.clone());
        Self { outbound, stats, sender, inbound: Inbound::new(settings, Stats::new(settings, START)), receiver }
    }

    /// The next datagram, if one leaves now, with the peer that it is for.
    fn poll(&mut self, now_ns: u64) -> Result<(NodeIndex, Vec<u8>), ReplicaStep> {
        for peer in 0..3 {
            self.stats.peer(peer).link.heard_ns.set(now_ns);
        }
        let mut datagram = vec![0; 1472];
        match self.sender.poll(now_ns, time, &mut self.outbound, &mut datagram) {
            ReplicaStep::Send { to, bytes } => Ok((to, datagram[..bytes].to_vec())),
            waits => Err(waits),
        }
    }

    fn take(&mut self, now_ns: u64, from: NodeIndex, bytes: &[u8]) {
        let datagram = Datagram { source: address(from), arrived_ns: now_ns, bytes };
        self.inbound.handle(now_ns, &datagram, &mut Parts(&mut self.receiver, now_ns));
    }
}

/// The node that writes: its streams, and its router.
struct Origin {
    ground: Ground,
    participant: Arc<Participant>,
    router: Router,
}

impl Origin {
    fn new(replicas: &[ReplicaSettings]) -> Self {
        let ground = Ground::new();
        ground.join().describe_replicas(CAMERA, &words(1)).unwrap();
        Self::on(ground, 100, replicas)
    }

    /// The incarnation of the router.
    fn on(ground: Ground, incarnation: u64, replicas: &[ReplicaSettings]) -> Self {
        let settings = Settings { incarnation, ..settings(ORIGIN, 3) };
        let mut origin = Self { participant: ground.join(), router: Router::new(&ground, &settings, replicas), ground };
        origin.look();
        origin
    }

    fn look(&mut self) {
        self.router.sender.look(&self.participant, &FirstByte);
    }

    fn writer(&self, id: StreamId, shape: StreamShape) -> StreamWriter {
        self.ground.join().stream_writer(id, shape).unwrap()
    }

    /// All that leaves until nothing waits, however long the wire takes.
    fn leave(&mut self, now_ns: &mut u64) -> Vec<Vec<u8>> {
        let mut all = Vec::new();
        loop {
            match self.router.poll(*now_ns) {
                Ok((_, datagram)) => all.push(datagram),
                Err(ReplicaStep::Wait { .. }) => *now_ns += MS,
                Err(_) => return all,
            }
        }
    }

    fn lost(&self, cause: ReplicaLoss) -> u64 {
        self.router.sender.counts().iter().map(|counts| counts.lost.of(cause)).sum()
    }
}

/// Takes parts alone.
struct Parts<'a>(&'a mut ReplicaReceiver, u64);

impl Report for Parts<'_> {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], _: crate::counts::Cause) {
        panic!("no package was sent");
    }
}

impl Deliver for Parts<'_> {
    fn deliver(&mut self, _: NodeIndex, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        panic!("no package was sent");
    }

    fn replica(&mut self, head: &FrameHead, part: &ReplicaFrame<'_>) -> bool {
        self.0.take(self.1, || time(self.1), head, part)
    }

    fn event(&mut self, _: RouterEvent) {}
}

/// The node that has the replica.
struct Holder {
    ground: Ground,
    router: Router,
}

impl Holder {
    fn new(replicas: &[ReplicaSettings]) -> Self {
        Self::on(Ground::new(), 101, replicas)
    }

    fn on(ground: Ground, incarnation: u64, replicas: &[ReplicaSettings]) -> Self {
        let settings = Settings { incarnation, ..settings(HOLDER, 3) };
        Self { router: Router::new(&ground, &settings, replicas), ground }
    }

    fn take(&mut self, now_ns: u64, bytes: &[u8]) {
        self.router.take(now_ns, ORIGIN, bytes);
    }

    /// Does what time makes due.
    fn pass(&mut self, now_ns: u64) {
        self.router.receiver.poll(now_ns, || time(now_ns));
    }

    fn take_all(&mut self, now_ns: u64, datagrams: &[Vec<u8>]) {
        datagrams.iter().for_each(|datagram| self.take(now_ns, datagram));
    }

    fn reader(&self) -> StreamReader {
        self.ground.join().stream_reader(ID).unwrap()
    }

    fn records(&self) -> u64 {
        self.counts().records.get()
    }

    fn lost(&self, cause: ReplicaLoss) -> u64 {
        self.counts().lost.of(cause)
    }

    /// Of its first replica.
    fn counts(&self) -> Arc<ReceivedReplica> {
        self.router.receiver.counts()[0].clone()
    }
}

/// Sequences and lengths of what a reader has, and how many it lost.
fn read(reader: &mut StreamReader) -> (Vec<(u64, usize)>, u64) {
    let (mut all, mut lost) = (Vec::new(), 0);
    loop {
        match reader.try_next().unwrap() {
            Next::Record(record) => all.push((record.info().sequence, record.body().len())),
            Next::Lost(more) => lost += more,
            Next::Nothing => return (all, lost),
        }
    }
}

/// Sequences of what a reader has.
fn sequences(reader: &mut StreamReader) -> Vec<u64> {
    read(reader).0.into_iter().map(|(sequence, _)| sequence).collect()
}

/// System time of both nodes: that of the tests.
fn time(ns: u64) -> SystemTime {
    SystemTime { ns, epoch: 1, error: Duration::from_micros(10), age: Duration::ZERO }
}

fn at(ns: u64) -> Stamp {
    Stamp { epoch: 1, ns }
}

#[test]
fn records_arrive_as_they_were_written() {
    let replicas = [image()];
    let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
    let (mut now_ns, mut writer, mut reader) = (START, origin.writer(ID, SHAPE), holder.reader());
    for (sequence, len) in (0..).zip([0, 1, 1372, 1373, 6000, 17]) {
        let body: Vec<u8> = (0..len).map(|at| (at * 7 + sequence as usize) as u8).collect();
        writer.write(at(100 + sequence), &body).unwrap();
        holder.take_all(now_ns, &origin.leave(&mut now_ns));
        let Next::Record(record) = reader.try_next().unwrap() else { panic!("record {sequence} is not there") };
        let there = writer.newest().unwrap();
        assert_eq!(record.body(), there.1, "{sequence}");
        let told = |info: rohrpost_mailbox::RecordInfo| (info.sequence, info.stamp, info.incarnation, info.len_bytes);
        assert_eq!(told(record.info()), told(there.0));
    }
    assert_eq!((holder.records(), reader.accounts()), (6, (6, 0)));
    let (sent, received) = (&origin.router.sender.counts()[0], holder.counts());
    let bytes = 1 + 1372 + 1373 + 6000 + 17;
    assert_eq!((sent.records.get(), sent.bytes.get(), received.bytes.get()), (6, bytes, bytes));
    assert_eq!([&received.completed, &received.asked, &received.gaps, &sent.again].map(Count::get), [0; 4]);
    assert_eq!(holder.ground.node.about(CAMERA), Some(words(1)), "its readers know what they read");
    assert!(ReplicaLoss::ALL.iter().all(|cause| holder.lost(*cause) == 0));
}

#[test]
fn a_writer_that_begins_anew_goes_on() {
    let replicas = [image()];
    let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
    let (mut now_ns, mut reader, mut incarnations) = (START, holder.reader(), Vec::new());
    for life in 0..3 {
        let mut writer = origin.writer(ID, SHAPE);
        for step in 0..2 {
            writer.write(at(100 + 10 * life + step), b"picture").unwrap();
            holder.take_all(now_ns, &origin.leave(&mut now_ns));
            let Next::Record(record) = reader.try_next().unwrap() else { panic!("it is there") };
            incarnations.push(record.info().incarnation);
        }
    }
    assert_eq!(reader.accounts(), (6, 0));
    incarnations.dedup();
    assert_eq!(incarnations.len(), 3, "{incarnations:?}");
}

#[test]
fn another_interface_makes_the_replica_anew() {
    let replicas = [image()];
    let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
    let (mut now_ns, mut reader) = (START, holder.reader());
    let mut writer = origin.writer(ID, SHAPE);
    writer.write(at(100), b"old").unwrap();
    holder.take_all(now_ns, &origin.leave(&mut now_ns));
    assert_eq!(read(&mut reader).0, [(0, 3)]);
    origin.ground.join().describe_replicas(CAMERA, &words(2)).unwrap();
    origin.look();
    writer.write(at(101), b"newer").unwrap();
    holder.take_all(now_ns, &origin.leave(&mut now_ns));
    assert_eq!(holder.ground.node.about(CAMERA), Some(words(2)));
    assert_eq!(read(&mut reader).0, [(1, 5)]);
    let there = holder.ground.node.inspect_stream(ID).unwrap().unwrap();
    assert_eq!(there.oldest.map(|record| record.sequence), Some(1), "what the new one does not describe is gone");
}

#[test]
fn the_more_important_goes_first_and_no_replica_delays_another() {
    let pose = ReplicaSettings { shape: StreamShape { record_bytes: 64, ..SHAPE }, level: 2, from: POSE, ..image() };
    let replicas = [image(), pose];
    const POSE: Name = Name::new(1, 240, 0, 0);
    let pose_id = StreamId { name: POSE, number: NUMBER };
    let mut origin = Origin::new(&replicas);
    origin.ground.join().describe_replicas(POSE, &words(3)).unwrap();
    origin.look();
    let (mut pictures, mut poses) = (origin.writer(ID, SHAPE), origin.writer(pose_id, replicas[1].shape));
    let mut now_ns = START;
    origin.leave(&mut now_ns);
    pictures.write(at(100), &[1; 6000]).unwrap();
    let place = |datagram: &[u8]| datagram[36];
    now_ns += MS;
    assert_eq!(place(&origin.router.poll(now_ns).unwrap().1), 0);
    poses.write(at(100), &[2; 64]).unwrap();
    let places: Vec<u8> = origin.leave(&mut now_ns).iter().map(|datagram| place(datagram)).collect();
    assert_eq!(places, [1, 0, 0, 0, 0]);
}

#[test]
fn sampling_leaves_out_what_it_says() {
    for (sampling, expected, left_out) in
        [(Sampling::Every(3), vec![0, 3, 6, 9], 6), (Sampling::Rate(250.0), vec![0, 4, 8], 7)]
    {
        let replicas = [ReplicaSettings { sampling, ..image() }];
        let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
        let (mut writer, mut reader) = (origin.writer(ID, SHAPE), holder.reader());
        for step in 0..10 {
            let mut now_ns = START + step * MS;
            writer.write(at(100 + step), &[]).unwrap();
            holder.take_all(now_ns, &origin.leave(&mut now_ns));
        }
        let (all, lost) = read(&mut reader);
        assert_eq!(all.iter().map(|(sequence, _)| *sequence).collect::<Vec<_>>(), expected, "{sampling}");
        let told: u64 = expected.last().unwrap() + 1 - expected.len() as u64;
        assert_eq!((lost, origin.lost(ReplicaLoss::Sampled)), (told, left_out), "{sampling}");
        assert_eq!(reader.missed(), Missed { lost: 0, sampled: told, passed_over: 0 }, "{sampling}");
    }
}

#[test]
fn a_wire_that_is_too_slow_carries_the_newest() {
    let replicas = [image()];
    let (mut origin, mut holder) = (Origin::new(&replicas), Holder::new(&replicas));
    let (mut now_ns, mut writer, mut reader) = (START, origin.writer(ID, SHAPE), holder.reader());
    holder.take_all(now_ns, &origin.leave(&mut now_ns));
    for step in 0..100 {
        writer.write(at(100 + step), &[3; 6000]).unwrap();
        // One part for each record of five.
        if let Ok((_, datagram)) = origin.router.poll(now_ns + step * MS) {
            holder.take(now_ns, &datagram);
        }
    }
    now_ns += 100 * MS;
    holder.take_all(now_ns, &origin.leave(&mut now_ns));
    // Nothing more comes of a record that was overwritten on its way.
    holder.pass(now_ns + 1000 * MS);
    let (all, lost) = read(&mut reader);
    assert_eq!(all.last(), Some(&(99, 6000)));
    assert_eq!(all.len() as u64 + lost, 100, "each is read or told");
    assert!(origin.lost(ReplicaLoss::Passed) >= 60, "{}", origin.lost(ReplicaLoss::Passed));
    assert_eq!(holder.records() + holder.counts().gaps.get(), 100);
    let passed_over = holder.records() - all.len() as u64;
    assert_eq!(reader.missed(), Missed { lost: 100 - holder.records(), sampled: 0, passed_over });
}
