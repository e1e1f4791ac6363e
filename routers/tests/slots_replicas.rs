//! A stream of one node is read on two others in time slots, while declared flows keep what was computed for them. One
//! in a hundred datagrams of replicas is lost, and asked for in slots.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "slots_common/mod.rs"]
mod common;

use common::declared::{flows_keep_their_bounds, segment};
use common::{PATIENCE, Segment, Station, module, name};
use rohrpost_config::Sampling;
use rohrpost_mailbox::{Name, Next, Participant, Stamp, StreamId, StreamReader, StreamShape, StreamWriter};
use rohrpost_network::Security;
use rohrpost_routers::replication::{ReplicaLoss, ReplicaSettings};
use rohrpost_routers::security::{Port, Rejection};
use rohrpost_routers::shell::ReplicaParts;
use rohrpost_testbed::stalls::unless_stalled;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Of some slots each: seventy parts.
const SHAPE: StreamShape = StreamShape { record_bytes: 100_000, keep: 16, readers: 3, late: Duration::ZERO };
const NUMBER: u16 = 2;
/// So many are to come to each node.
const RECORDS: u64 = 60;
/// A computer that stands still may have dropped a part of the newest: then the next one says so.
const AGAIN: Duration = Duration::from_millis(300);

fn id() -> StreamId {
    StreamId { name: module(0), number: NUMBER }
}

/// Node 0 writes, both others have it. Returns when all send.
fn replicate(segment: &mut Segment) -> (Writing, [Reading; 2]) {
    let replica = ReplicaSettings {
        from: module(0),
        item: "image".into(),
        stream: "camera.0/image".into(),
        shape: SHAPE,
        node: 0,
        to: 1 << 1 | 1 << 2,
        sampling: Sampling::Each,
        changed: false,
        delay_alarm_ns: PATIENCE.as_nanos() as u64,
        deadline_ns: 200_000_000,
        level: 18,
    };
    let replicas = [replica];
    let Segment { stations, lab, .. } = segment;
    for station in stations {
        let _inside = lab.enter(&name(station.own)).unwrap();
        let impair = Some("loss=1%,seed=22".parse().unwrap());
        let parts = ReplicaParts {
            replicas: &replicas,
            describe: Arc::new(|_: &[u8], _: &str| Some(NUMBER)),
            socket: None,
            impair,
        };
        station.shell.as_mut().unwrap().replicate(&station.node, parts).unwrap();
    }
    segment.wait_until_all_send();
    join(&segment.stations[0]).describe_replicas(module(0), b"of a camera").unwrap();
    let writer = join(&segment.stations[0]).stream_writer(id(), SHAPE).unwrap();
    let reading = |node: usize| {
        let reader = join(&segment.stations[node]).stream_reader(id()).unwrap();
        Reading { reader, next: 0, whole: 0, lost: 0 }
    };
    (Writing { writer, last: Instant::now() }, [reading(1), reading(2)])
}

fn join(station: &Station) -> Arc<Participant> {
    Participant::join(&station.node, Name::NONE).unwrap()
}

fn body(sequence: u64) -> Vec<u8> {
    (0..u64::from(SHAPE.record_bytes) - sequence).map(|at| (at * 7 + sequence * 31) as u8).collect()
}

/// What one of the others has read.
struct Reading {
    reader: StreamReader,
    next: u64,
    whole: u64,
    lost: u64,
}

impl Reading {
    /// Each record is as it was written, or told as lost.
    fn read(&mut self) {
        loop {
            match self.reader.try_next().unwrap() {
                Next::Record(record) => {
                    let sequence = record.info().sequence;
                    assert!(sequence >= self.next, "{sequence}, then {}", self.next);
                    assert!(record.body() == body(sequence), "record {sequence} is not as it was written");
                    (self.next, self.whole) = (sequence + 1, self.whole + 1);
                }
                Next::Lost(lost) => self.lost += lost,
                Next::Nothing => return,
            }
        }
    }
}

/// Writes a record when the one before has come, or seems to be lost.
struct Writing {
    writer: StreamWriter,
    last: Instant,
}

impl Writing {
    fn write(&mut self, readings: &[Reading]) {
        let written = self.writer.written();
        if readings.iter().all(|reading| reading.next == written) || self.last.elapsed() > AGAIN {
            self.last = Instant::now();
            self.writer.write(Stamp { epoch: 1, ns: 1 + written }, &body(written)).unwrap();
        }
    }
}

#[test]
fn records_cross_in_slots_and_declared_flows_keep_their_bounds() {
    unless_stalled(|stalls| {
        let Some(mut segment) = segment(None) else { return Ok(()) };
        let (mut writing, mut readings) = replicate(&mut segment);
        let began = Instant::now();
        let kept = flows_keep_their_bounds(&segment, stalls, "beside replicas", || {
            readings.iter_mut().for_each(Reading::read);
            writing.write(&readings);
            let all = readings.each_ref().map(|reading| (reading.whole, reading.lost));
            assert!(began.elapsed() < PATIENCE, "{all:?} whole and lost, of {}", writing.writer.written());
            all.iter().all(|(whole, _)| *whole >= RECORDS)
        });
        for (node, reading) in [1, 2].into_iter().zip(&readings) {
            let counts = &segment.stations[node].shell().replicas().received[0];
            let incomplete = counts.lost.of(ReplicaLoss::Incomplete);
            let completed = counts.completed.get();
            println!(
                "node {node}: {} records whole, {completed} of these by asking, {} lost, {incomplete} incomplete",
                reading.whole, reading.lost
            );
            assert!(counts.records.get() >= reading.whole && completed > 0, "{counts:?}");
        }
        let sent = &segment.stations[0].shell().replicas().sent;
        assert!(sent.iter().all(|sent| sent.records.get() >= RECORDS), "{sent:?}");
        kept
    });
}

/// Parts and requests are sealed by the thread of the slots, with keys of their own port, and opened at the others.
#[test]
fn records_cross_in_slots_where_datagrams_are_sealed() {
    let Some(mut segment) = Segment::at_rest(None) else { return };
    for station in &mut segment.stations {
        station.settings.network.security = Security::Keys;
        station.settings.network.datagram_bytes_max -= Security::Keys.tag_bytes();
        station.start(&segment.lab);
    }
    let (mut writing, mut readings) = replicate(&mut segment);
    segment.wait_until("records are read on both other nodes", |_| {
        readings.iter_mut().for_each(Reading::read);
        writing.write(&readings);
        readings.iter().all(|reading| reading.whole >= RECORDS / 3)
    });
    for node in [1, 2] {
        let shell = segment.stations[node].shell();
        let counts = &shell.replicas().received[0];
        assert_eq!(counts.lost.of(ReplicaLoss::Unsound) + counts.lost.of(ReplicaLoss::Foreign), 0, "{counts:?}");
        assert!(counts.completed.get() > 0, "{counts:?}");
        let rejections = shell.rejections(Port::Replicas).unwrap();
        assert_eq!(rejections.of(Some(0), Rejection::Forged) + rejections.of(Some(0), Rejection::Unsealed), 0);
    }
}
