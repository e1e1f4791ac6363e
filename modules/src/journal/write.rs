//! Entries on their way into the module's journal, a stream in shared memory.
//!
//! They are gathered in memory of the module, and become a record as soon as they fill one or the first of them is
//! [`WAIT_NS`] old: no system call and no memory is taken for that. A panic hands on what is there. A process that is
//! killed takes what it has not handed on with it, and its journal ends before.

use super::entry;
use super::run::{PIECE_HEAD_BYTES, Piece};
use super::tag::Tag;
use rohrpost_config::JOURNAL;
use rohrpost_mailbox::{Stamp, StreamWriter, SystemClock};
use serde::Serialize;

/// Entries wait no longer for others to share a record with.
const WAIT_NS: u64 = 20_000_000;
/// Bytes of a record.
const RECORD_BYTES: usize = JOURNAL.record_bytes as usize;
/// Of these, the length of what follows.
const LENGTH_BYTES: usize = 2;
/// Entries in a record.
const PIECE_BYTES: usize = RECORD_BYTES - LENGTH_BYTES - PIECE_HEAD_BYTES;

/// Writes a journal.
pub(crate) struct JournalWriter {
    /// None once it cannot be written: the journal has ended then.
    stream: Option<StreamWriter>,
    clock: SystemClock,
    /// Tells it from other journals of the module.
    incarnation: u32,
    /// Bytes that were handed on.
    offset: u64,
    /// Those that were not.
    waiting: Vec<u8>,
    sum: u32,
    due_ns: Option<u64>,
}

impl JournalWriter {
    pub(crate) fn new(stream: StreamWriter, clock: SystemClock, incarnation: u32) -> Self {
        let waiting = Vec::with_capacity(16 * RECORD_BYTES);
        Self { stream: Some(stream), clock, incarnation, offset: 0, waiting, sum: 0, due_ns: None }
    }

    pub(super) fn put<T: Serialize + ?Sized>(&mut self, tag: Tag, content: &T) {
        if self.stream.is_none() {
            return;
        }
        match entry::append(&mut self.waiting, self.sum, tag, content) {
            Ok(sum) => self.sum = sum,
            Err(error) => {
                self.fail(&error);
                return;
            }
        }
        let mut done = 0;
        while self.waiting.len() >= done + PIECE_BYTES {
            self.piece(done, PIECE_BYTES);
            done += PIECE_BYTES;
        }
        self.waiting.drain(..done.min(self.waiting.len()));
        if tag == Tag::Hole {
            self.flush();
            self.stream = None;
        }
    }

    pub(super) fn due_ns(&self) -> Option<u64> {
        self.due_ns
    }

    pub(super) fn pass_on(&mut self, now_ns: u64) {
        match self.due_ns {
            _ if self.waiting.is_empty() => self.due_ns = None,
            None => self.due_ns = Some(now_ns + WAIT_NS),
            Some(due_ns) if due_ns <= now_ns => self.flush(),
            Some(_) => {}
        }
    }

    pub(super) fn flush(&mut self) {
        self.due_ns = None;
        if !self.waiting.is_empty() {
            self.piece(0, self.waiting.len());
            self.waiting.clear();
        }
    }

    /// Hands on so many bytes from there on, at most as many as a record takes. They stay where they are.
    fn piece(&mut self, from: usize, len: usize) {
        let Some(stream) = &mut self.stream else { return self.waiting.clear() };
        let bytes = &self.waiting[from..from + len];
        let piece = Piece { incarnation: self.incarnation, offset: self.offset, bytes };
        let now = self.clock.now();
        // The length tells tools that these are bytes.
        let written = stream.begin(Stamp { epoch: now.epoch, ns: now.ns.max(1) }).and_then(|mut record| {
            let len = piece.write(record.body_mut());
            record.finish(len)
        });
        match written {
            Ok(_) => self.offset += len as u64,
            Err(error) => self.fail(&error),
        }
    }

    #[cold]
    fn fail(&mut self, error: &dyn std::fmt::Display) {
        tracing::error!("its journal ends here, and cannot be replayed any further: {error}");
        (self.stream, self.due_ns) = (None, None);
        self.waiting.clear();
    }
}

/// A module that does not come to its end leaves what it did.
impl Drop for JournalWriter {
    fn drop(&mut self) {
        self.flush();
    }
}
