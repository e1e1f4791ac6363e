//! A stream, one way, with nothing lost: its writer waits before it would take a record from its reader.
//!
//! A stream's writer waits for nobody by itself. Beside a ring with a sender that waits for room, that would compare
//! a rate with losses to one without; so here the reader tells how far it is, in a word that is not of the stream.

use super::node::{StreamNode, came, stamp};
use crate::floors::ring::CacheLine;
use crate::one_way::{Sink, Source};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{OrFail, Zeroable, copy_whole};
use rohrpost_mailbox::{StreamReader, StreamWriter, Waiting};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// The reader tells its progress after so many records: each time moves a cache line.
const TELL_EACH: u64 = 8;
/// Spinning is always spinning for a while, then sleeping.
const SPIN: Duration = Duration::from_millis(100);

/// How many records the reader has read.
#[repr(transparent)]
pub struct Progress(CacheLine<AtomicU64>);

// SAFETY: one atomic.
unsafe impl Zeroable for Progress {}

/// The writer.
pub struct RecordSink<'a> {
    writer: StreamWriter,
    keep: u64,
    progress: &'a Progress,
    /// As last seen.
    read: u64,
}

impl<'a> RecordSink<'a> {
    /// Makes the stream.
    ///
    /// # Errors
    /// When there is no memory for it.
    pub fn open(node: &StreamNode, progress: &'a Progress) -> Result<Self, Failure> {
        let writer = node.writer()?;
        let keep = writer.shape().keep.into();
        Ok(Self { writer, keep, progress, read: 0 })
    }
}

impl Sink for RecordSink<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let sequence = self.writer.written();
        while sequence - self.read >= self.keep {
            // ORDERING: Acquire; pairs with the store in `receive`: what is written over has been read.
            self.read = self.progress.0.0.load(Ordering::Acquire);
        }
        self.writer.write(stamp(sequence), message).map(drop).or_fail("write")
    }
}

/// The reader.
pub struct RecordSource<'a> {
    reader: StreamReader,
    body: Vec<u8>,
    progress: &'a Progress,
}

impl<'a> RecordSource<'a> {
    /// Opens the stream, which may come later.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(node: &StreamNode, bytes: usize, progress: &'a Progress) -> Result<Self, Failure> {
        Ok(Self { reader: node.reader()?, body: Vec::with_capacity(bytes), progress })
    }
}

impl Source for RecordSource<'_> {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let waiting = Waiting { spin: SPIN, deadline: None };
        let info = came(self.reader.next_timeout_into(&mut self.body, waiting))?;
        copy_whole(&self.body, message)?;
        let read = info.sequence + 1;
        if read.is_multiple_of(TELL_EACH) {
            // ORDERING: Release; pairs with the load in `send`.
            self.progress.0.0.store(read, Ordering::Release);
        }
        Ok(())
    }
}
