//! Parts of replicas in slots: behind all packages, off the wire before the guard, and whole records where they arrive.

use super::{CYCLE, Computer, Router};
use crate::counts::Cause;
use crate::frame::{FrameHead, NodeIndex, ReplicaFrame};
use crate::harness::{End, MS, START, address, head, module, settings};
use crate::inbound::{Datagram, Inbound};
use crate::outbound::Outbound;
use crate::port::Port;
use crate::replication::{ReplicaReceiver, ReplicaSender, ReplicaSettings, ReplicaStep};
use crate::report::{Deliver, NotDelivered, Report, RouterEvent};
use crate::stats::Stats;
use rohrpost_config::Sampling;
use rohrpost_mailbox::{
    Head, Name, Next, Node, Participant, Stamp, StreamId, StreamReader, StreamShape, StreamWriter, SystemTime,
};
use std::sync::Arc;
use std::time::Duration;

const ID: StreamId = StreamId { name: Name::new(1, 112, 0, 0), number: 2 };
const SHAPE: StreamShape = StreamShape { record_bytes: 200_000, keep: 8, readers: 2, late: Duration::ZERO };
const HOLDER: NodeIndex = 1;

fn time(ns: u64) -> SystemTime {
    SystemTime { ns, epoch: 1, error: Duration::ZERO, age: Duration::ZERO }
}

/// The node that has the replica.
struct Holder {
    inbound: Inbound,
    receiver: ReplicaReceiver,
}

/// Takes parts.
struct PartDelivery<'a>(&'a mut ReplicaReceiver, u64);

impl Report for PartDelivery<'_> {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], _: Cause) {}
}

impl Deliver for PartDelivery<'_> {
    fn deliver(&mut self, _: NodeIndex, _: &Head, _: &[u8]) -> Result<(), NotDelivered> {
        Err(NotDelivered::NoMailbox)
    }

    fn replica(&mut self, head: &FrameHead, part: &ReplicaFrame<'_>) -> bool {
        self.0.take(self.1, || time(self.1), head, part)
    }

    fn event(&mut self, _: RouterEvent) {}
}

/// A stream of the router's node, and its replica on another one.
pub(super) struct Replicated {
    sender: ReplicaSender,
    outbound: Outbound,
    writer: StreamWriter,
    holder: Holder,
    reader: StreamReader,
    /// When so many parts have left, a package comes.
    interrupted_after: Option<usize>,
    _folder: tempfile::TempDir,
}

impl Replicated {
    fn new(end: &End) -> Self {
        let replica = ReplicaSettings {
            from: ID.name,
            item: "image".into(),
            stream: "camera.0/image".into(),
            shape: SHAPE,
            node: 0,
            to: 1 << HOLDER,
            sampling: Sampling::Each,
            changed: false,
            delay_alarm_ns: 1000 * MS,
            deadline_ns: 200_000_000,
            level: 18,
        };
        let folder = tempfile::tempdir().unwrap();
        let nodes = ["here", "there"].map(|name| Node::create(&folder.path().join(name), 0o700).unwrap());
        let join = |node: usize| Participant::join(&nodes[node], Name::NONE).unwrap();
        join(0).describe_replicas(ID.name, b"of a camera").unwrap();
        let writer = join(0).stream_writer(ID, SHAPE).unwrap();
        let mut sender = ReplicaSender::new(&end.settings, std::slice::from_ref(&replica));
        sender.look(&join(0), &|_: &[u8], _: &str| Some(ID.number));
        let stats = Stats::of_port(Port::Replicas, &end.settings, &end.stats);
        let outbound = Outbound::new(&end.settings, stats).behind(&end.stats).only_to(sender.peers());
        let there = settings(HOLDER, 3);
        let inbound = Inbound::new(&there, Stats::of_port(Port::Replicas, &there, &Stats::new(&there, START)));
        let receiver = ReplicaReceiver::new(&there, &[replica], join(1), Arc::new(|_: &[u8], _: &str| Some(ID.number)));
        let holder = Holder { inbound, receiver };
        let reader = join(1).stream_reader(ID).unwrap();
        Self { sender, outbound, writer, holder, reader, interrupted_after: None, _folder: folder }
    }

    pub(super) fn next(&mut self, now_ns: u64, datagram: &mut [u8]) -> Option<(NodeIndex, usize)> {
        self.outbound.look_at_peers(now_ns);
        match self.sender.poll(now_ns, time, &mut self.outbound, datagram) {
            ReplicaStep::Send { to, bytes } => Some((to, bytes)),
            ReplicaStep::Wait { .. } | ReplicaStep::Idle { .. } => None,
        }
    }

    /// It crosses the wire; whether a package comes now.
    pub(super) fn send(&mut self, now_ns: u64, bytes: &[u8]) -> bool {
        let Holder { inbound, receiver } = &mut self.holder;
        let came = Datagram { source: address(0), arrived_ns: now_ns, bytes };
        inbound.handle(now_ns, &came, &mut PartDelivery(receiver, now_ns));
        let left = self.interrupted_after.as_mut().map(|left| {
            *left -= 1;
            *left
        });
        left == Some(0) && self.interrupted_after.take().is_some()
    }

    fn write(&mut self, number: u64) {
        self.writer.write(Stamp { epoch: 1, ns: 1 + number }, &body(number)).unwrap();
    }

    /// All records that have come are as they were written; how many, and how many were lost.
    fn read(&mut self) -> (u64, u64) {
        let (mut came, mut lost) = (0, 0);
        loop {
            match self.reader.try_next().unwrap() {
                Next::Record(record) => {
                    assert_eq!(record.body(), body(record.info().sequence));
                    came += 1;
                }
                Next::Lost(more) => lost += more,
                Next::Nothing => return (came, lost),
            }
        }
    }
}

fn body(number: u64) -> Vec<u8> {
    (0..SHAPE.record_bytes as u64 - number).map(|at| (at * 7 + number * 13) as u8).collect()
}

fn replicating() -> Router {
    let mut router = Router::new();
    router.on.replicated = Some(Replicated::new(&router.on.end));
    router.on.sent.clear();
    router
}

fn queue(on: &mut Computer, to: NodeIndex) {
    on.end.queue(on.now_ns, head(module(100, to), module(100, 0), 90), &[0; 900]);
}

/// What left in windows with a package or a part: true for parts.
fn windows(router: &Router) -> Vec<&[bool]> {
    router.on.sent.iter().map(Vec::as_slice).filter(|sent| !sent.is_empty()).collect()
}

#[test]
fn records_cross_in_slots_behind_packages_and_inside_of_windows() {
    let mut router = replicating();
    let (mut came, mut lost) = (0, 0);
    for cycle in 0..40 {
        if cycle % 8 == 0 {
            router.on.replicated.as_mut().unwrap().write(cycle / 8);
        }
        [1, 2].into_iter().for_each(|to| queue(&mut router.on, to));
        router.run_for(CYCLE.as_nanos() as u64);
        let (more, less) = router.on.replicated.as_mut().unwrap().read();
        (came, lost) = (came + more, lost + less);
        let log = &router.on.log;
        assert!(log.windows.iter().flatten().all(|used| used.spare_ns >= 0), "off the wire before the guard: {log:?}");
    }
    assert_eq!((came, lost), (5, 0), "each is whole");
    let windows = windows(&router);
    assert!(windows.iter().all(|sent| sent.is_sorted()), "a part left before a package: {windows:?}");
    let both = windows.iter().filter(|sent| sent.contains(&true) && sent.contains(&false)).count();
    let most = windows.iter().map(|sent| sent.len()).max().unwrap();
    assert!(both > 10 && most > 40, "{both} windows with both, {most} datagrams in one");
}

#[test]
fn a_package_that_comes_in_a_slot_waits_for_one_part() {
    let mut router = replicating();
    let replicated = router.on.replicated.as_mut().unwrap();
    replicated.write(0);
    replicated.interrupted_after = Some(10);
    router.run_for(3 * CYCLE.as_nanos() as u64);
    let windows = windows(&router);
    let begun = windows[0].iter().position(|is_part| *is_part).unwrap();
    let first = &windows[0][begun..];
    assert_eq!(first.iter().position(|is_part| !is_part), Some(10), "{first:?}");
    assert!(first[11..].iter().all(|is_part| *is_part) && first.len() > 20, "parts go on behind it: {first:?}");
    assert_eq!(router.on.log.behind, 0, "bounds promise it the next slot, so it was not late");
}
