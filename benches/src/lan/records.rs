//! Streams of a node, and their replicas on others.
//!
//! ```text
//!  inlet ─▶ ring ─▶ router ══ parts ══▶ router ─▶ ring of the same name ─▶ outlet
//! ```
//! A record is written whole and read in place. Which records come is the routers' matter; what reads them counts.

use super::ends::join;
use super::flow::{LOOK, Outlet, SILENCE, look_at};
use super::router::SYSTEM;
use crate::one_way::Sink;
use crate::streams::{came, stamp, stream_failure};
use rohrpost_bench_local::harness::{Child, Failure, Link, OrFail, copy_whole};
use rohrpost_mailbox::{Class, Name, Next, Shape, StreamId, StreamReader, StreamShape, StreamWriter, Waiting};
use rohrpost_schema::{DataItem, DataKind, Description, Field, Type};
use std::path::Path;
use std::time::{Duration, Instant};

/// Class of the modules that write streams.
pub const RECORDS: Class = Class(150);
/// The stream of each, in its description.
const ITEM: &str = "record";
const NUMBER: u16 = 1;
/// Routers look for new streams twice a second, and send descriptions once.
const BEGINS_WITHIN: Duration = Duration::from_secs(60);
const WRITE_EACH: Duration = Duration::from_millis(5);
/// Routers wait for so long for lost parts, seconds.
const DEADLINE_S: u64 = 5;
const _: () = assert!(DEADLINE_S < SILENCE.as_secs(), "a record that comes late is not lost");

fn stream(instance: u8) -> StreamId {
    StreamId { name: Name::new(SYSTEM, RECORDS.0, instance, 0), number: NUMBER }
}

/// The module, its stream and its replica, as configurations have them. It is never launched: processes of the bench
/// take its place.
pub fn entries(instance: u8, node: &str, to: &[&str], shape: StreamShape) -> String {
    let StreamShape { record_bytes, keep, readers, .. } = shape;
    format!(
        "[[module]]\nname = \"records.{instance}\"\nnode = \"{node}\"\nprogram = \"records\"\noptional = true\n\
         [module.stream.{ITEM}]\nrecord = \"{record_bytes} B\"\nkeep = {keep}\nreaders = {readers}\n\
         [[replica]]\nstream = \"records.{instance}/{ITEM}\"\nto = {to:?}\ndeadline = \"{DEADLINE_S} s\"\n"
    )
}

/// Makes the stream on the node in the first directory, and waits until that in the second one has its replica. Records
/// without bytes are written meanwhile, of which some may be on their way still: what reads passes over them.
///
/// # Errors
/// When that takes too long.
pub fn begin(from: &Path, to: &Path, instance: u8, shape: StreamShape) -> Result<(), Failure> {
    let begun = Child::start(|| {
        let participant = join(from, Name::NONE)?;
        let module = participant.receiver(stream(instance).name, Shape::default()).or_fail("mailbox")?;
        // It stays when its mailbox has no owner any more.
        module.set_about(&description().to_bytes()).or_fail("description")?;
        let (mut inlet, mut outlet) = (RecordInlet::open(from, instance, shape)?, RecordOutlet::open(to, instance)?);
        loop {
            inlet.send(&[])?;
            if outlet.has_any()? {
                return Ok(());
            }
            std::thread::sleep(WRITE_EACH);
        }
    })?;
    begun.finish(Instant::now() + BEGINS_WITHIN).or_fail("a replica does not begin")
}

fn description() -> Description {
    let field = Field::new(ITEM, Type::U64);
    let item = DataItem { number: NUMBER, kind: DataKind::Stream, field };
    let (name, class) = ("Recording".into(), "records".into());
    Description { name, class, text: String::new(), functions: Vec::new(), data: vec![item] }
}

/// The writing side.
pub struct RecordInlet {
    writer: StreamWriter,
}

impl RecordInlet {
    /// Writes the stream of this instance, on the node in this directory.
    ///
    /// # Errors
    /// When somebody else does, or there is no memory for it.
    pub fn open(directory: &Path, instance: u8, shape: StreamShape) -> Result<Self, Failure> {
        let writer = join(directory, Name::NONE)?.stream_writer(stream(instance), shape).map_err(stream_failure)?;
        Ok(Self { writer })
    }
}

impl Sink for RecordInlet {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let stamp = stamp(self.writer.written());
        self.writer.write(stamp, message).map(drop).or_fail("write")
    }
}

/// The reading side.
pub struct RecordOutlet {
    reader: StreamReader,
}

impl RecordOutlet {
    /// Reads the replica of the stream of this instance, on the node in this directory, from the next record on.
    ///
    /// # Errors
    /// When all its seats are taken.
    pub fn open(directory: &Path, instance: u8) -> Result<Self, Failure> {
        let reader = join(directory, Name::NONE)?.stream_reader(stream(instance)).map_err(stream_failure)?;
        Ok(Self { reader })
    }

    /// Whether there is a record; takes it.
    fn has_any(&mut self) -> Result<bool, Failure> {
        let next = self.reader.try_next().map_err(stream_failure)?;
        Ok(matches!(next, Next::Record(_)))
    }
}

impl Outlet for RecordOutlet {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, Failure> {
        let waiting = Waiting { spin: Duration::ZERO, deadline: Some(Instant::now() + LOOK) };
        loop {
            match self.reader.next_timeout(waiting).map_err(stream_failure)? {
                Next::Record(record) if !record.body().is_empty() => {
                    return look_at(record.body(), message).map(|()| true);
                }
                // One of those with which it began, or some are lost: the numbers of those that come say so.
                Next::Record(_) | Next::Lost(_) => {}
                Next::Nothing => return Ok(false),
            }
        }
    }
}

/// One end of a ping-pong: a stream that it writes, and the replica of the other's.
pub struct RecordLink {
    inlet: RecordInlet,
    reader: StreamReader,
    body: Vec<u8>,
}

impl RecordLink {
    /// An end on the node in this directory: instances of what it writes, and of what it reads.
    ///
    /// # Errors
    /// When a stream cannot be opened.
    pub fn open(directory: &Path, [own, other]: [u8; 2], shape: StreamShape) -> Result<Self, Failure> {
        let inlet = RecordInlet::open(directory, own, shape)?;
        let RecordOutlet { reader } = RecordOutlet::open(directory, other)?;
        Ok(Self { inlet, reader, body: Vec::with_capacity(shape.record_bytes as usize) })
    }
}

impl Link for RecordLink {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.inlet.send(message)
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let waiting = Waiting { spin: Duration::ZERO, deadline: None };
        let mut info = came(self.reader.next_timeout_into(&mut self.body, waiting))?;
        while info.len_bytes == 0 {
            // One of those with which it began.
            info = came(self.reader.next_timeout_into(&mut self.body, waiting))?;
        }
        copy_whole(&self.body, message)
    }
}
