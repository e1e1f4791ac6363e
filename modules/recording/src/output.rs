//! The bytes of one file: buffered, counted, and never written again after an error.

use crate::disk::DiskFile;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Small records are collected to this many bytes; a chunk goes to the kernel by one call.
const BUFFER_BYTES: usize = 64 << 10;

/// What `mcap` writes to, shared with what syncs it. One thread has both.
#[derive(Clone)]
pub(crate) struct Output(Arc<Mutex<Sink>>);

/// The file behind it.
pub(crate) struct Sink {
    file: Box<dyn DiskFile>,
    buffer: Vec<u8>,
    /// In the file, without the buffer.
    written: u64,
    /// The first error. From then on nothing is written: half a record is followed by nothing.
    error: Option<io::Error>,
}

impl Output {
    pub(crate) fn new(file: Box<dyn DiskFile>) -> Self {
        let sink = Sink { file, buffer: Vec::with_capacity(BUFFER_BYTES), written: 0, error: None };
        Self(Arc::new(Mutex::new(sink)))
    }

    pub(crate) fn sink(&self) -> MutexGuard<'_, Sink> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Sink {
    /// Behind the last byte.
    pub(crate) fn position(&self) -> u64 {
        self.written + self.buffer.len() as u64
    }

    pub(crate) fn file(&mut self) -> &mut dyn DiskFile {
        &mut *self.file
    }

    /// Why nothing is written any more.
    pub(crate) fn take_error(&mut self) -> Option<io::Error> {
        self.error.as_mut().map(|error| std::mem::replace(error, closed()))
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.error.is_some() {
            return Err(closed());
        }
        if self.buffer.len() + bytes.len() > BUFFER_BYTES {
            self.empty()?;
        }
        if bytes.len() < BUFFER_BYTES {
            self.buffer.extend_from_slice(bytes);
            return Ok(());
        }
        let told = self.file.write_all(bytes);
        self.count(bytes.len(), told)
    }

    fn empty(&mut self) -> io::Result<()> {
        let told = self.file.write_all(&self.buffer);
        let len = self.buffer.len();
        self.buffer.clear();
        self.count(len, told)
    }

    fn count(&mut self, len: usize, told: io::Result<()>) -> io::Result<()> {
        match told {
            Ok(()) => self.written += len as u64,
            Err(error) => {
                self.error = Some(error);
                return Err(closed());
            }
        }
        Ok(())
    }
}

/// What `mcap` is told; the error itself stays here.
fn closed() -> io::Error {
    io::Error::other("an earlier write to this file failed")
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.sink().put(bytes).map(|()| bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let mut sink = self.sink();
        if sink.error.is_some() { Err(closed()) } else { sink.empty() }
    }
}

impl Seek for Output {
    /// `mcap` only asks where it is, as chunks are put together in memory.
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.sink().position()),
            _ => Err(io::Error::from(io::ErrorKind::Unsupported)),
        }
    }
}
