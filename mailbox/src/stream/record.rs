//! A reader's seat in a ring, and what is said of records.

use crate::memory::owned::BadSegment;
use crate::node::lock::Held;
use crate::node::participant::Participant;
use crate::step::step;
use crate::stream::error::StreamError;
use crate::stream::place::RecordPlace;
use crate::stream::ring::{Line, Ring, Stamp};
use crate::stream::segment::{StreamSegment, file_name};
use crate::stream::shape::StreamId;
use std::io;
use std::os::unix::fs::MetadataExt;

/// What is said of a record, besides its bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RecordInfo {
    /// Its number in the stream, from 0 on; it goes on over writers' lives.
    pub sequence: u64,
    /// When it was produced.
    pub stamp: Stamp,
    /// When it was written, on the monotonic clock.
    pub written_ns: u64,
    /// Its bytes.
    pub len_bytes: usize,
    /// Tells its writer's life from others.
    pub incarnation: u32,
}

impl RecordInfo {
    pub(super) fn of(segment: &StreamSegment, line: &Line) -> Self {
        let (about, len_bytes) = (&line.about, segment.len(line));
        let (stamp, written_ns, incarnation) = (about.stamp, about.written_ns, about.incarnation);
        Self { sequence: line.sequence, stamp, written_ns, len_bytes, incarnation }
    }
}

/// What comes next for a reader.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next<T> {
    /// The next record.
    Record(T),
    /// The writer has passed this reader, which lost so many records. It stands at the oldest still there.
    Lost(u64),
    /// Nothing was written since.
    Nothing,
}

impl<T> Next<T> {
    /// The same with another record.
    pub fn map<U>(self, change: impl FnOnce(T) -> U) -> Next<U> {
        match self {
            Self::Record(record) => Next::Record(change(record)),
            Self::Lost(lost) => Next::Lost(lost),
            Self::Nothing => Next::Nothing,
        }
    }
}

/// The records around a time, or exactly why not.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Around {
    /// The nearest ones; both are the same when it has this very stamp. Final: nothing that is written later changes
    /// it.
    Records {
        /// The nearest that is not after.
        before: RecordInfo,
        /// The nearest that is not before.
        after: RecordInfo,
    },
    /// Nothing was written yet.
    Empty,
    /// The nearest before is there no more, or never was; how far it is to the first that is known to be the nearest.
    BeforeOldest {
        /// How far.
        by_ns: u64,
    },
    /// What is still to be written may be nearer; how far the newest stamp must go at most until it may not.
    NotYet {
        /// How far.
        by_ns: u64,
    },
    /// No two records of this epoch are around it, and none will be.
    OtherEpoch {
        /// The epoch that there is instead.
        newest: u64,
    },
}

/// A seat in a ring.
pub(crate) struct TakenSeat {
    pub(super) segment: StreamSegment,
    pub(super) seat: usize,
    /// Holds the seat's lock. Below `segment`: fields drop in order, and the lock must outlast the map.
    lock: Held,
}

impl TakenSeat {
    /// None when there is no such stream, or still the one of this seat: it was given up, and what replaces it has not
    /// its name yet. A second seat there would be another reader's.
    pub(super) fn take(
        participant: &Participant,
        id: StreamId,
        instead_of: Option<&Self>,
    ) -> Result<Option<Self>, StreamError> {
        let node = participant.node();
        let path = node.path().join(file_name(id));
        let (segment, file) = match StreamSegment::open(node.directory(), id) {
            Ok(opened) => opened,
            Err(BadSegment::Io(error)) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(why) => return Err(StreamError::of_bad(&path, id, why)),
        };
        let failed = |error| StreamError::of(&path, id, 0, error);
        if let Some(old) = instead_of {
            let [there, here] = [&file, &old.lock.file].map(|file| file.metadata().map_err(failed));
            let (there, here) = (there?, here?);
            if (there.dev(), there.ino()) == (here.dev(), here.ino()) {
                return Ok(None);
            }
        }
        let readers = segment.shape.readers;
        // The first byte is the writer's.
        let lock = Held::try_take_first(file, 1..1 + u64::from(readers));
        let Some(lock) = lock.map_err(failed)? else {
            return Err(StreamError::Crowded { id, readers });
        };
        step!("seat: locked");
        let seat = lock.byte() as usize - 1;
        segment.ring().sit_down(seat, participant.module().raw());
        Ok(Some(Self { segment, seat, lock }))
    }

    pub(super) fn ring(&self) -> Ring<'_> {
        self.segment.ring()
    }

    pub(super) fn info(&self, line: &Line) -> RecordInfo {
        RecordInfo::of(&self.segment, line)
    }
}

/// A record in hand, read where it lies: its writer goes round it. Dropped, the writer may have its place.
pub struct HeldRecord<'a> {
    pub(super) place: &'a TakenSeat,
    pub(super) line: Line,
    /// It stays held, for its reader.
    pub(super) is_kept: bool,
}

impl HeldRecord<'_> {
    /// Its bytes.
    pub fn body(&self) -> &[u8] {
        self.place.segment.body(&self.line)
    }

    /// What is said of it.
    pub fn info(&self) -> RecordInfo {
        self.place.info(&self.line)
    }

    /// Where its bytes are.
    pub fn at(&self) -> RecordPlace {
        let Line { frame, .. } = self.line;
        self.place.segment.place_of(frame, self.place.segment.len(&self.line))
    }

    /// Stays held until its reader takes another record, or is dropped; where its bytes are.
    pub fn stay(mut self) -> RecordPlace {
        self.is_kept = true;
        self.at()
    }
}

impl Drop for HeldRecord<'_> {
    fn drop(&mut self) {
        if !self.is_kept {
            self.place.ring().release(self.place.seat);
        }
    }
}
