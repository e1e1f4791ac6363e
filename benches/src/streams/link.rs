//! A stream in each direction, for ping-pong.

use super::node::{came, stamp, stream_failure};
use rohrpost_bench_local::harness::{End, Failure, Link, Meetings, OrFail};
use rohrpost_bench_local::ours::{How, join, name};
use rohrpost_mailbox::{StreamId, StreamReader, StreamShape, StreamWriter, Waiting};
use std::path::Path;
use std::time::Duration;

/// Records that a stream keeps; in ping-pong more than one is never new.
const KEEP: u32 = 4;
/// How long a spinning reader looks before it sleeps: longer than any record takes, so that it never sleeps.
const SPIN: Duration = Duration::from_millis(100);

/// One end: a stream that it writes, and the other's that it reads.
pub struct StreamLink {
    writer: StreamWriter,
    reader: StreamReader,
    how: How,
    waiting: Waiting,
    /// Bytes of each record, of which the link's user sees the head when they are read in place.
    bytes: usize,
    /// Where records are copied to.
    body: Vec<u8>,
}

impl StreamLink {
    /// Opens an end on the node in this directory.
    ///
    /// # Errors
    /// When the streams cannot be made.
    pub fn open(directory: &Path, end: End, bytes: usize, how: How, meetings: &mut Meetings) -> Result<Self, Failure> {
        let record_bytes = u32::try_from(bytes).or_fail("record")?;
        let [mine, other] = [end, end.other()].map(name);
        let participant = join(directory, mine)?;
        let id = |name| StreamId { name, number: 1 };
        let shape = StreamShape { record_bytes, keep: KEEP, readers: 1, late: Duration::ZERO };
        let writer = participant.stream_writer(id(mine), shape).map_err(stream_failure)?;
        meetings.meet()?;
        let reader = participant.stream_reader(id(other)).map_err(stream_failure)?;
        let spin = if how == How::Blocking { Duration::ZERO } else { SPIN };
        let waiting = Waiting { spin, deadline: None };
        Ok(Self { writer, reader, how, waiting, bytes, body: Vec::with_capacity(bytes) })
    }

    fn check(&self, len_bytes: usize) -> Result<(), Failure> {
        if len_bytes == self.bytes {
            return Ok(());
        }
        Err(Failure::Failed(format!("{len_bytes} bytes came, not {}", self.bytes)))
    }
}

impl Link for StreamLink {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let (stamp, bytes) = (stamp(self.writer.written()), self.bytes);
        let written = match self.how {
            How::Blocking | How::Spinning => self.writer.write(stamp, message),
            How::Loaned => self.writer.begin(stamp).and_then(|mut record| {
                record.body_mut()[..message.len()].copy_from_slice(message);
                record.finish(bytes)
            }),
        };
        written.map(drop).or_fail("write")
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let len_bytes = if self.how == How::Loaned {
            let record = came(self.reader.next_timeout(self.waiting))?;
            let body = record.body();
            let head = body.get(..message.len()).ok_or_else(|| Failure::Failed(format!("{} bytes", body.len())))?;
            message.copy_from_slice(head);
            body.len()
        } else {
            let info = came(self.reader.next_timeout_into(&mut self.body, self.waiting))?;
            self.check(info.len_bytes)?;
            message.copy_from_slice(&self.body);
            info.len_bytes
        };
        self.check(len_bytes)
    }
}
