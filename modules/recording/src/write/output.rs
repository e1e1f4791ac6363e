//! The bytes of one file: buffered, counted, and never written again after an error.

use crate::disk::DiskFile;
use std::io;

/// Small records are collected to this many bytes; a chunk goes to the kernel by one call.
const BUFFER_BYTES: usize = 64 << 10;

/// The file that is written, and what waits to go to it.
pub(super) struct Output {
    file: Box<dyn DiskFile>,
    buffer: Vec<u8>,
    /// In the file, without the buffer.
    written: u64,
    /// From the first error on nothing is written: half a record is followed by nothing.
    has_failed: bool,
    /// Of all bytes so far.
    sum: crc32fast::Hasher,
}

impl Output {
    pub(super) fn new(file: Box<dyn DiskFile>) -> Self {
        let buffer = Vec::with_capacity(BUFFER_BYTES);
        Self { file, buffer, written: 0, has_failed: false, sum: crc32fast::Hasher::new() }
    }

    /// Behind the last byte.
    pub(super) fn position(&self) -> u64 {
        self.written + self.buffer.len() as u64
    }

    /// Checksum of all bytes so far.
    pub(super) fn sum(&self) -> u32 {
        self.sum.clone().finalize()
    }

    pub(super) fn file(&mut self) -> &mut dyn DiskFile {
        &mut *self.file
    }

    pub(super) fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.has_failed {
            return Err(failed_before());
        }
        self.sum.update(bytes);
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

    /// Hands all of it to the kernel.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        if self.has_failed { Err(failed_before()) } else { self.empty() }
    }

    fn empty(&mut self) -> io::Result<()> {
        let told = self.file.write_all(&self.buffer);
        let len = self.buffer.len();
        self.buffer.clear();
        self.count(len, told)
    }

    fn count(&mut self, len: usize, told: io::Result<()>) -> io::Result<()> {
        match &told {
            Ok(()) => self.written += len as u64,
            Err(_) => self.has_failed = true,
        }
        told
    }
}

fn failed_before() -> io::Error {
    io::Error::other("an earlier write to this file failed")
}
