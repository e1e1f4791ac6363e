//! The part of the target `segments` that makes, writes, reads and looks at a stream.

use crate::split::Bytes;
use rohrpost_mailbox::{
    Around, Name, Next, Node, Participant, RecordInfo, Stamp, StreamId, StreamReader, StreamShape, StreamWriter,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

const ID: StreamId = StreamId { name: Name::new(1, 200, 0, 0), number: 1 };
/// Instructions for streams.
pub(crate) const STREAM_STEPS: u8 = 8;

/// The stream's file.
pub(crate) fn ring_file(node: &Path) -> PathBuf {
    node.join(format!("{:08x}.{}.ring", ID.name.raw(), ID.number))
}

/// A stream as a program has it. What could not be made or opened is missing.
pub(crate) struct Stream {
    shape: StreamShape,
    writer: Option<StreamWriter>,
    reader: Option<StreamReader>,
    copy: Vec<u8>,
}

impl Stream {
    pub(crate) fn new(how: u8) -> Self {
        // Copied while they are written, or held.
        let record_bytes = if how & 1 == 0 { 40 } else { 5000 };
        let late = Duration::from_nanos(if how & 2 == 0 { 0 } else { 100 });
        let shape = StreamShape { record_bytes, keep: 2 + u32::from(how >> 2 & 1), readers: 2, late };
        Self { shape, writer: None, reader: None, copy: Vec::new() }
    }

    /// One of [`STREAM_STEPS`] instructions.
    pub(crate) fn step(&mut self, which: u8, me: Option<&Arc<Participant>>, bytes: &mut Bytes<'_>) {
        match which {
            0 => self.writer = me.and_then(|me| me.stream_writer(ID, self.shape).ok()),
            1 => self.writer = None,
            2 => self.reader = me.and_then(|me| me.stream_reader(ID).ok()),
            3 => self.reader = None,
            4 => self.write(bytes),
            5 => self.read(bytes.byte()),
            6 => self.find(bytes),
            _ => look(me, bytes.byte()),
        }
    }

    fn write(&mut self, bytes: &mut Bytes<'_>) {
        let Some(writer) = &mut self.writer else { return };
        let (how, len) = (bytes.byte(), usize::from(bytes.byte()));
        let stamp = stamp(how >> 2, bytes);
        let body = [7; 256];
        let written = match how & 3 {
            0 | 1 => writer.write(stamp, &body[..len]),
            2 => writer.begin(stamp).and_then(|mut open| {
                open.body_mut().fill(9);
                open.finish(len)
            }),
            _ => {
                drop(writer.begin(stamp));
                return;
            }
        };
        if let Ok(sequence) = written {
            assert_eq!(sequence + 1, writer.written());
        }
    }

    fn read(&mut self, how: u8) {
        let Some(reader) = &mut self.reader else { return };
        let (max, moment) = (reader.shape().map_or(0, |shape| shape.record_bytes), Duration::from_micros(1));
        let max = max.max(self.shape.record_bytes) as usize;
        let (read, lost) = reader.accounts();
        let copied = match how % 5 {
            0 => held(reader.try_next(), max),
            1 => held(reader.next_timeout(moment), max),
            2 => reader.try_next_into(&mut self.copy).ok(),
            3 => reader.next_timeout_into(&mut self.copy, moment).ok(),
            _ => {
                let newest = reader.newest_into(&mut self.copy).ok().flatten();
                assert!(newest.is_none_or(|info| info.len_bytes == self.copy.len()));
                held(reader.newest().map(|record| record.map_or(Next::Nothing, Next::Record)), max);
                None
            }
        };
        assert!(self.copy.len() <= max);
        let (more_read, more_lost) = (reader.accounts().0 - read, reader.accounts().1 - lost);
        match copied {
            Some(Next::Record(info)) => assert_eq!((more_read, more_lost, info.len_bytes <= max), (1, 0, true)),
            Some(Next::Lost(lost)) => assert_eq!((more_read, more_lost), (0, lost)),
            Some(Next::Nothing) | None => assert_eq!((more_read, more_lost), (0, 0)),
        }
    }

    fn find(&mut self, bytes: &mut Bytes<'_>) {
        let Some(reader) = &mut self.reader else { return };
        let how = bytes.byte();
        let at = stamp(how, bytes);
        if let Ok(Around::Records { before, after }) = reader.around(at) {
            assert!(before.stamp <= at && at <= after.stamp, "{before:?} {at:?} {after:?}");
        }
        let sequence = bytes.long();
        if how & 1 != 0 {
            reader.seek(sequence);
        }
        for sequence in [sequence, reader.position(), reader.position().saturating_sub(1)] {
            let found = reader.record_into(sequence, &mut self.copy);
            assert!(found.is_none_or(|info| info.len_bytes == self.copy.len()));
        }
        let _ = reader.has_next();
    }
}

/// A record in hand has as many bytes as it says, and no more than there can be.
fn held<E>(next: Result<Next<rohrpost_mailbox::HeldRecord<'_>>, E>, max: usize) -> Option<Next<RecordInfo>> {
    let told = next.ok()?.map(|record| {
        let info = record.info();
        assert!(record.body().len() == info.len_bytes && info.len_bytes <= max);
        info
    });
    Some(told)
}

/// Most are near each other.
fn stamp(how: u8, bytes: &mut Bytes<'_>) -> Stamp {
    match how & 3 {
        0 => Stamp { epoch: 1, ns: 1000 + u64::from(bytes.byte()) },
        1 => Stamp { epoch: bytes.byte().into(), ns: 1000 },
        _ => Stamp { epoch: bytes.long(), ns: bytes.long() },
    }
}

fn look(me: Option<&Arc<Participant>>, how: u8) {
    let Some(me) = me else { return };
    let node: &Node = me.node();
    for id in node.streams().unwrap_or_default().into_iter().chain([ID]) {
        if let Ok(Some(info)) = node.inspect_stream(id) {
            assert!(info.id == id && info.holding <= info.readers && info.sleeping <= info.readers);
            assert!(info.readers <= info.shape.readers && info.shape.segment_bytes() > 0);
        }
    }
    if how & 1 != 0 {
        let _ = node.remove_orphan_stream(ID);
    }
}
