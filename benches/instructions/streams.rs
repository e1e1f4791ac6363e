//! A record of 64 bytes through a stream, and the two records around a time.

use super::Path;
use rohrpost_bench_local::harness::Scratch;
use rohrpost_mailbox::{
    Around, Name, Next, Node, Participant, Stamp, StreamId, StreamReader, StreamShape, StreamWriter,
};
use std::hint::black_box;

const BYTES: usize = 64;
const STREAM: StreamId = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
const KEEP: u32 = 4096;

/// A stream of this process, and a reader of another participant. Its stamps are one to two microseconds apart, as a
/// producer that is not quite regular has them.
struct Stream {
    writer: StreamWriter,
    reader: StreamReader,
    body: Vec<u8>,
    written: u64,
    _scratch: Scratch,
}

impl Default for Stream {
    fn default() -> Self {
        let scratch = Scratch::new().unwrap();
        let node = Node::create(&scratch.directory().join("node"), 0o700).unwrap();
        let shape = StreamShape { record_bytes: BYTES as u32, keep: KEEP, ..StreamShape::default() };
        let writer = Participant::join(&node, STREAM.name).unwrap().stream_writer(STREAM, shape).unwrap();
        let reader = Participant::join(&node, Name::new(1, 100, 0, 0)).unwrap().stream_reader(STREAM).unwrap();
        Self { writer, reader, body: Vec::with_capacity(BYTES), written: 0, _scratch: scratch }
    }
}

impl Stream {
    fn write(&mut self) {
        self.written += 1;
        let stamp = Stamp { epoch: 1, ns: self.written * 1500 + self.written * 7919 % 500 };
        self.writer.write(stamp, black_box(&[7; BYTES])).unwrap();
    }

    fn copy(&mut self) {
        let next = self.reader.try_next_into(&mut self.body).unwrap();
        assert!(matches!(next, Next::Record(_)) && black_box(&self.body).len() == BYTES);
    }
}

/// Writes a record.
#[derive(Default)]
pub(super) struct Write(Stream);

impl Path for Write {
    fn operate(&mut self) {
        self.0.write();
    }

    fn finish(&mut self) {
        self.0.copy();
    }
}

/// Copies the next record.
#[derive(Default)]
pub(super) struct Copy(Stream);

impl Path for Copy {
    fn prepare(&mut self) {
        self.0.write();
    }

    fn operate(&mut self) {
        self.0.copy();
    }
}

/// Holds the next record, and reads it where it lies.
#[derive(Default)]
pub(super) struct Hold(Stream);

impl Path for Hold {
    fn prepare(&mut self) {
        self.0.write();
    }

    fn operate(&mut self) {
        let Next::Record(record) = self.0.reader.try_next().unwrap() else { panic!("one was written") };
        assert_eq!(black_box(record.body()).len(), BYTES);
    }
}

/// Finds the two records around a time, in a full ring.
pub(super) struct AroundTime {
    stream: Stream,
    asked: u64,
}

impl Default for AroundTime {
    fn default() -> Self {
        let mut stream = Stream::default();
        (0..KEEP).for_each(|_| stream.write());
        Self { stream, asked: 0 }
    }
}

impl Path for AroundTime {
    fn operate(&mut self) {
        self.asked += 1;
        // All over the ring, in no order.
        let ns = 3000 + self.asked * 7919 % u64::from(KEEP - 4) * 1500;
        let around = self.stream.reader.around(Stamp { epoch: 1, ns: black_box(ns) }).unwrap();
        let Around::Records { before, after } = around else { panic!("{ns}: {around:?}") };
        assert!(before.stamp.ns <= ns && ns <= after.stamp.ns && after.sequence - before.sequence <= 1);
    }
}
