//! Both halves of two nodes' routers, and rings of both.

use super::*;
use std::collections::BTreeMap;

pub(super) struct Ground {
    _folder: tempfile::TempDir,
    pub(super) node: Arc<Node>,
}

impl Ground {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let node = Node::create(&folder.path().join("node"), 0o700).unwrap();
        Self { _folder: folder, node }
    }

    pub(super) fn join(&self) -> Arc<Participant> {
        Participant::join(&self.node, Name::NONE).unwrap()
    }
}

/// Both halves of a node's router.
pub(super) struct Router {
    pub(super) outbound: Outbound,
    pub(super) stats: Arc<Stats>,
    pub(super) sender: ReplicaSender,
    pub(super) inbound: Inbound,
    pub(super) receiver: ReplicaReceiver,
}

impl Router {
    pub(super) fn new(ground: &Ground, settings: &Settings, replicas: &[ReplicaSettings]) -> Self {
        let stats = Stats::new(settings, START);
        let mut sender = ReplicaSender::new(settings, replicas);
        let receiver = ReplicaReceiver::new(settings, replicas, ground.join(), Arc::new(first_byte));
        let receiver = receiver.asking_by(sender.requests());
        let outbound = Outbound::new(settings, stats.clone());
        Self { outbound, stats, sender, inbound: Inbound::new(settings, Stats::new(settings, START)), receiver }
    }

    /// The next datagram, if one leaves now, with the peer that it is for.
    pub(super) fn poll(&mut self, now_ns: u64) -> Result<(NodeIndex, Vec<u8>), ReplicaStep> {
        for peer in 0..3 {
            self.stats.peer(peer).link.heard_ns.set(now_ns);
        }
        let mut datagram = vec![0; 1472];
        match self.sender.poll(now_ns, time, &mut self.outbound, &mut datagram) {
            ReplicaStep::Send { to, bytes } => Ok((to, datagram[..bytes].to_vec())),
            waits => Err(waits),
        }
    }

    pub(super) fn take(&mut self, now_ns: u64, from: NodeIndex, bytes: &[u8]) {
        let datagram = Datagram { source: address(from), arrived_ns: now_ns, bytes };
        self.inbound.handle(now_ns, &datagram, &mut Parts(&mut self.receiver, now_ns));
    }
}

/// The node that writes: its streams, and its router.
pub(super) struct Origin {
    pub(super) ground: Ground,
    pub(super) participant: Arc<Participant>,
    pub(super) router: Router,
}

impl Origin {
    pub(super) fn new(replicas: &[ReplicaSettings]) -> Self {
        let ground = Ground::new();
        ground.join().describe_replicas(CAMERA, &words(1)).unwrap();
        Self::on(ground, 100, replicas)
    }

    /// The incarnation of the router.
    pub(super) fn on(ground: Ground, incarnation: u64, replicas: &[ReplicaSettings]) -> Self {
        let settings = Settings { incarnation, ..settings(ORIGIN, 3) };
        let mut origin = Self { participant: ground.join(), router: Router::new(&ground, &settings, replicas), ground };
        origin.look();
        origin
    }

    pub(super) fn look(&mut self) {
        self.router.sender.look(&self.participant, &first_byte);
    }

    pub(super) fn writer(&self, id: StreamId, shape: StreamShape) -> StreamWriter {
        self.ground.join().stream_writer(id, shape).unwrap()
    }

    /// All that leaves until nothing waits, however long the wire takes.
    pub(super) fn leave(&mut self, now_ns: &mut u64) -> Vec<Vec<u8>> {
        let mut all = Vec::new();
        loop {
            match self.router.poll(*now_ns) {
                Ok((_, datagram)) => all.push(datagram),
                Err(ReplicaStep::Wait { .. }) => *now_ns += MS,
                Err(_) => return all,
            }
        }
    }

    pub(super) fn lost(&self, cause: ReplicaLoss) -> u64 {
        self.router.sender.counts().iter().map(|counts| counts.lost.of(cause)).sum()
    }
}

/// Takes parts alone.
pub(super) struct Parts<'a>(pub(super) &'a mut ReplicaReceiver, pub(super) u64);

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
pub(super) struct Holder {
    pub(super) ground: Ground,
    pub(super) router: Router,
}

impl Holder {
    pub(super) fn new(replicas: &[ReplicaSettings]) -> Self {
        Self::on(Ground::new(), 101, replicas)
    }

    pub(super) fn on(ground: Ground, incarnation: u64, replicas: &[ReplicaSettings]) -> Self {
        let settings = Settings { incarnation, ..settings(HOLDER, 3) };
        Self { router: Router::new(&ground, &settings, replicas), ground }
    }

    pub(super) fn take(&mut self, now_ns: u64, bytes: &[u8]) {
        self.router.take(now_ns, ORIGIN, bytes);
    }

    /// Does what time makes due.
    pub(super) fn pass(&mut self, now_ns: u64) {
        self.router.receiver.poll(now_ns, || time(now_ns));
    }

    pub(super) fn take_all(&mut self, now_ns: u64, datagrams: &[Vec<u8>]) {
        datagrams.iter().for_each(|datagram| self.take(now_ns, datagram));
    }

    pub(super) fn reader(&self) -> StreamReader {
        self.ground.join().stream_reader(ID).unwrap()
    }

    pub(super) fn records(&self) -> u64 {
        self.counts().records.get()
    }

    pub(super) fn lost(&self, cause: ReplicaLoss) -> u64 {
        self.counts().lost.of(cause)
    }

    /// Of its first replica.
    pub(super) fn counts(&self) -> Arc<ReceivedReplica> {
        self.router.receiver.counts()[0].clone()
    }
}

/// Sequences and lengths of what a reader has, and how many it lost.
pub(super) fn read(reader: &mut StreamReader) -> (Vec<(u64, usize)>, u64) {
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
pub(super) fn sequences(reader: &mut StreamReader) -> Vec<u64> {
    read(reader).0.into_iter().map(|(sequence, _)| sequence).collect()
}

/// System time of both nodes: that of the tests.
pub(super) fn time(ns: u64) -> SystemTime {
    SystemTime { ns, epoch: 1, error: Duration::from_micros(10), age: Duration::ZERO }
}

pub(super) fn at(ns: u64) -> Stamp {
    Stamp { epoch: 1, ns }
}

/// A stream and its replica, without a wire: what leaves arrives.
pub(super) struct Both {
    pub(super) origin: Origin,
    pub(super) holder: Holder,
    pub(super) writer: StreamWriter,
    pub(super) reader: StreamReader,
    pub(super) now_ns: u64,
}

impl Both {
    pub(super) fn new(replica: ReplicaSettings) -> Self {
        let (shape, replicas) = (replica.shape, [replica]);
        let (origin, holder) = (Origin::new(&replicas), Holder::new(&replicas));
        let (writer, reader) = (origin.writer(ID, shape), holder.reader());
        Self { origin, holder, writer, reader, now_ns: START }
    }

    /// All that leaves until nothing waits arrives.
    pub(super) fn carry(&mut self) {
        let (came_ns, left) = (self.now_ns, self.origin.leave(&mut self.now_ns));
        self.holder.take_all(came_ns, &left);
    }

    /// A record is written, and arrives.
    pub(super) fn send(&mut self, stamp_ns: u64, body: &[u8]) {
        self.writer.write(at(stamp_ns), body).unwrap();
        self.carry();
    }

    pub(super) fn read(&mut self) -> (Vec<(u64, usize)>, u64) {
        read(&mut self.reader)
    }
}

/// A wire one way: what arrives when, in the order of the arrivals.
#[derive(Default)]
pub(super) struct Wire(BTreeMap<(u64, u64), Vec<u8>>, u64);

impl Wire {
    pub(super) fn put(&mut self, arrives_ns: u64, datagram: Vec<u8>) {
        self.1 += 1;
        self.0.insert((arrives_ns, self.1), datagram);
    }

    pub(super) fn take(&mut self, now_ns: u64) -> Option<Vec<u8>> {
        self.0.first_entry().filter(|first| first.key().0 <= now_ns).map(|first| first.remove())
    }
}
