//! What a stream is, and the layout of its file.
//!
//! ```text
//!     0  Identity    what this is: written once, before the file gets its name; then only read
//!    64  Writer      its owner, and what it refused
//!   128  written     records ever written
//!  4096  seats       one a reader, 128 B each, in pages of their own: readers write these alone
//!     …  index       one entry a record that is kept, 64 B each; begins a page
//!     …  hints       one a record that is kept, 8 B each: behind the index
//!     …  frames      keep + readers + 1, each a multiple of 64 B; begins a page
//! ```
//!
//! docs/src/shared-memory.md has the same for other languages.

use crate::memory::layout::{PAGE, VERSION};
use crate::memory::mapping::Shared;
use crate::name::Name;
use crate::stream::ring::{FRAMES_MAX, IndexEntry, SEQUENCE_MAX, STREAM_READERS_MAX, Seat};
use std::fmt;
use std::mem::offset_of;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// `rohrring` in ASCII, little-endian.
const MAGIC: u64 = u64::from_le_bytes(*b"rohrring");
/// Most records that a stream keeps.
pub const STREAM_KEEP_MAX: u32 = (FRAMES_MAX - STREAM_READERS_MAX - 1) as u32;
/// Records up to this size are copied with atomics, and may be read while the writer goes on. Larger ones are held
/// while they are copied: an atomic copy moves eight bytes at a time.
pub(crate) const RACING_BYTES_MAX: usize = 4096;
/// Records of a replica that may be begun at a time, by [`StreamShape::begun_max`].
const BEGUN_MIN: usize = 2;
const BEGUN_MAX: usize = 8;
/// Frames of more bytes than this in all are not brought in when they are mapped: each page comes when it is touched.
const PRESENT_BYTES_MAX: usize = 1 << 20;

/// Which stream: the mailbox of the module that writes it, and a number of that module's own.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct StreamId {
    /// The mailbox.
    pub name: Name,
    /// The number; a module's streams and published data share one set of numbers.
    pub number: u16,
}

impl fmt::Display for StreamId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.name, self.number)
    }
}

/// What a stream is asked to be.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StreamShape {
    /// Largest record, bytes; at least 1.
    pub record_bytes: u32,
    /// Records that are kept, at least 2.
    pub keep: u32,
    /// Most readers at a time, 1..=64. Each has room for one record that it reads in place.
    pub readers: u16,
    /// How far behind the newest a stamp may be. Zero: a record that is behind is refused.
    pub late: Duration,
}

impl Default for StreamShape {
    fn default() -> Self {
        Self { record_bytes: 1024, keep: 64, readers: 8, late: Duration::ZERO }
    }
}

/// Why a [`StreamShape`] cannot be.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum StreamShapeError {
    /// Nothing could be written.
    #[error("records of 0 bytes; at least 1 is needed to write")]
    Record,
    /// Too few, or more than there can be.
    #[error("keeps {0} records; a stream keeps 2 to {STREAM_KEEP_MAX}")]
    Keep(u32),
    /// None, or more than there can be.
    #[error("{0} readers; a stream has 1 to {STREAM_READERS_MAX}")]
    Readers(u16),
}

impl StreamShape {
    pub(crate) fn check(&self) -> Result<(), StreamShapeError> {
        if self.record_bytes == 0 {
            return Err(StreamShapeError::Record);
        }
        if self.keep < 2 || self.keep > STREAM_KEEP_MAX {
            return Err(StreamShapeError::Keep(self.keep));
        }
        if self.readers == 0 || usize::from(self.readers) > STREAM_READERS_MAX {
            return Err(StreamShapeError::Readers(self.readers));
        }
        Ok(())
    }

    /// Bytes of shared memory that such a stream takes.
    pub fn segment_bytes(&self) -> usize {
        (self.frames_offset() + self.frames() * self.frame_bytes()).next_multiple_of(PAGE)
    }

    pub(crate) fn frames(&self) -> usize {
        self.keep as usize + usize::from(self.readers) + 1
    }

    pub(crate) fn frame_bytes(&self) -> usize {
        (self.record_bytes as usize).next_multiple_of(64)
    }

    pub(crate) fn seats_bytes(&self) -> usize {
        (usize::from(self.readers) * size_of::<Seat>()).next_multiple_of(PAGE)
    }

    pub(crate) fn index_offset(&self) -> usize {
        PAGE + self.seats_bytes()
    }

    /// Of the index and the hints behind it.
    pub(crate) fn index_bytes(&self) -> usize {
        (self.hints_offset() + self.keep as usize * size_of::<u64>()).next_multiple_of(PAGE)
    }

    /// In the index's part.
    pub(crate) fn hints_offset(&self) -> usize {
        self.keep as usize * size_of::<IndexEntry>()
    }

    pub(crate) fn frames_offset(&self) -> usize {
        self.index_offset() + self.index_bytes()
    }

    /// Whether its records are copied while the writer goes on.
    pub(crate) fn is_racing(&self) -> bool {
        self.record_bytes as usize <= RACING_BYTES_MAX
    }

    /// How many records of a replica of this shape may be begun at a time. Small ones overtake each other where the
    /// delay of the network varies; they are filled beside the ring, and all that are whole fit into it at once.
    ///
    /// ```
    /// use rohrpost_mailbox::StreamShape;
    ///
    /// let poses = StreamShape { record_bytes: 64, keep: 256, ..StreamShape::default() };
    /// let pictures = StreamShape { record_bytes: 1 << 20, ..poses };
    /// assert_eq!((poses.begun_max(), pictures.begun_max()), (8, 2));
    /// ```
    pub fn begun_max(&self) -> usize {
        if self.is_racing() { (self.keep as usize).clamp(BEGUN_MIN, BEGUN_MAX) } else { BEGUN_MIN }
    }

    /// Whether all its frames are brought in at once.
    pub(crate) fn is_present(&self) -> bool {
        self.frames() * self.frame_bytes() <= PRESENT_BYTES_MAX
    }

    pub(crate) fn late_ns(&self) -> u64 {
        u64::try_from(self.late.as_nanos()).unwrap_or(u64::MAX)
    }

    /// As the file will say it: else a stream would not know its own shape again.
    pub(crate) fn as_stored(self) -> Self {
        Self { late: Duration::from_nanos(self.late_ns()), ..self }
    }
}

/// The first line of a stream's file.
#[repr(C, align(64))]
pub(crate) struct StreamIdentity {
    magic: AtomicU64,
    version: AtomicU32,
    name: AtomicU32,
    number: AtomicU32,
    record_bytes: AtomicU32,
    keep: AtomicU32,
    readers: AtomicU32,
    late_ns: AtomicU64,
    /// The first sequence that is written here: the stream before was given up after the one before it.
    pub(crate) first: AtomicU64,
}

impl StreamIdentity {
    /// As the first bytes of a file have it. Nobody changes it once the file has its name, so a copy is as good.
    pub(crate) fn from_bytes(bytes: &[u8; size_of::<Self>()]) -> Self {
        let long = |at: usize| AtomicU64::new(u64::from_ne_bytes(std::array::from_fn(|i| bytes[at + i])));
        let short = |at: usize| AtomicU32::new(u32::from_ne_bytes(std::array::from_fn(|i| bytes[at + i])));
        Self {
            magic: long(offset_of!(Self, magic)),
            version: short(offset_of!(Self, version)),
            name: short(offset_of!(Self, name)),
            number: short(offset_of!(Self, number)),
            record_bytes: short(offset_of!(Self, record_bytes)),
            keep: short(offset_of!(Self, keep)),
            readers: short(offset_of!(Self, readers)),
            late_ns: long(offset_of!(Self, late_ns)),
            first: long(offset_of!(Self, first)),
        }
    }

    /// Before the file has its name, so that nobody else can see it.
    pub(crate) fn write(&self, id: StreamId, shape: &StreamShape) {
        self.version.store(VERSION, Ordering::Relaxed);
        self.name.store(id.name.raw(), Ordering::Relaxed);
        self.number.store(id.number.into(), Ordering::Relaxed);
        self.record_bytes.store(shape.record_bytes, Ordering::Relaxed);
        self.keep.store(shape.keep, Ordering::Relaxed);
        self.readers.store(shape.readers.into(), Ordering::Relaxed);
        self.late_ns.store(shape.late_ns(), Ordering::Relaxed);
        self.magic.store(MAGIC, Ordering::Release);
    }

    /// The version of the layout, if it is not ours.
    pub(crate) fn other_version(&self) -> Option<u32> {
        let version = (self.magic.load(Ordering::Acquire) == MAGIC).then(|| self.version.load(Ordering::Relaxed));
        version.filter(|version| *version != VERSION)
    }

    /// What the file claims to be; none when that cannot be. Another process wrote it, so everything is checked here,
    /// once.
    pub(crate) fn read(&self) -> Option<(StreamId, StreamShape)> {
        if self.magic.load(Ordering::Acquire) != MAGIC || self.version.load(Ordering::Relaxed) != VERSION {
            return None;
        }
        let shape = StreamShape {
            record_bytes: self.record_bytes.load(Ordering::Relaxed),
            keep: self.keep.load(Ordering::Relaxed),
            readers: self.readers.load(Ordering::Relaxed).try_into().ok()?,
            late: Duration::from_nanos(self.late_ns.load(Ordering::Relaxed)),
        };
        shape.check().ok()?;
        if self.first.load(Ordering::Relaxed) > SEQUENCE_MAX {
            return None;
        }
        let number = self.number.load(Ordering::Relaxed).try_into().ok()?;
        Some((StreamId { name: Name::from_raw(self.name.load(Ordering::Relaxed)), number }, shape))
    }
}

/// The writer.
#[repr(C, align(64))]
pub(crate) struct WriterSays {
    pub(crate) participant: AtomicU32,
    pub(crate) pid: AtomicU32,
    /// The module it is.
    pub(crate) module: AtomicU32,
    /// Times a new writer took over.
    pub(crate) adoptions: AtomicU32,
    /// Not 0: the stream was given up, and another has its name; nothing more is written here.
    pub(crate) retired: AtomicU32,
    /// Not 0: a replica. It begins with what came first: what its origin wrote before that was never lost here.
    pub(crate) replica: AtomicU32,
    /// Records refused since their stamps were too far behind.
    pub(crate) refused: AtomicU64,
}

/// The count of records, in a line of its own.
#[repr(C, align(64))]
pub(crate) struct WrittenCount(pub(crate) AtomicU64);

/// The first page of a stream's file.
#[repr(C)]
pub(crate) struct StreamPage {
    pub(crate) identity: StreamIdentity,
    pub(crate) writer: WriterSays,
    pub(crate) written: WrittenCount,
}

// SAFETY: made of atomics alone.
unsafe impl Shared for StreamPage {}
// SAFETY: made of atomics alone.
unsafe impl Shared for IndexEntry {}
// SAFETY: made of atomics alone.
unsafe impl Shared for Seat {}

const _: () = {
    assert!(size_of::<StreamIdentity>() == 64 && offset_of!(StreamIdentity, first) == 40);
    assert!(size_of::<WriterSays>() == 64 && offset_of!(WriterSays, refused) == 24);
    assert!(offset_of!(StreamPage, writer) == 64 && offset_of!(StreamPage, written) == 128);
    assert!(size_of::<StreamPage>() <= PAGE);
    assert!(size_of::<IndexEntry>() == 64 && offset_of!(IndexEntry, len_bytes) == 40);
    assert!(offset_of!(IndexEntry, lost) == 48 && offset_of!(IndexEntry, sampled) == 56);
    assert!(size_of::<Seat>() == 128 && offset_of!(Seat, module) == 4);
    assert!(offset_of!(Seat, sleeper) == 8 && offset_of!(Seat, passed_over) == 16);
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_that_cannot_be_say_why() {
        let shape = StreamShape::default();
        for (shape, why) in [
            (StreamShape { record_bytes: 0, ..shape }, "records of 0 bytes; at least 1 is needed to write"),
            (StreamShape { keep: 1, ..shape }, "keeps 1 records; a stream keeps 2 to 1048510"),
            (StreamShape { readers: 65, ..shape }, "65 readers; a stream has 1 to 64"),
        ] {
            assert_eq!(shape.check().unwrap_err().to_string(), why);
        }
    }

    #[test]
    fn what_readers_write_lies_in_pages_of_its_own() {
        for readers in [1, 8, 32, 33, 64] {
            for record_bytes in [1, 64, 4097, 8 << 20] {
                let shape = StreamShape { readers, record_bytes, ..StreamShape::default() };
                assert_eq!((shape.index_offset() % PAGE, shape.frames_offset() % PAGE), (0, 0));
                assert!(shape.seats_bytes() >= usize::from(readers) * size_of::<Seat>());
            }
        }
    }
}
