//! A stream's file, mapped and checked, and the bytes of its records.

use crate::memory::files::Directory;
use crate::memory::layout::PAGE;
use crate::memory::mapping::{Located, Mapping, Pages, Rooms, Use};
use crate::memory::owned::{BadFile, BadSegment, Owned};
use crate::name::Name;
use crate::step::step;
use crate::stream::bytes;
use crate::stream::place::RecordPlace;
use crate::stream::ring::{IndexEntry, Line, Ring, Seat};
use crate::stream::shape::{StreamId, StreamIdentity, StreamPage, StreamShape};
use crate::stream::writing::{Frame, Progress};
use crate::sync::prefetch_to_write;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// A stream's memory. What it is was checked when it was mapped and is not read again.
pub(crate) struct StreamSegment {
    page: Located<StreamPage>,
    seats: Located<[Seat]>,
    entries: Located<[IndexEntry]>,
    hints: Located<[AtomicU64]>,
    /// All frames as words; none of a stream with records of plain memory.
    words: Located<[AtomicU64]>,
    frames: Rooms,
    first: u64,
    pub(crate) id: StreamId,
    pub(crate) shape: StreamShape,
}

/// The file of a stream.
pub(crate) fn file_name(id: StreamId) -> String {
    format!("{:08x}.{}.ring", id.name.raw(), id.number)
}

/// The stream a file of this name belongs to.
pub(crate) fn id_of(path: &Path) -> Option<StreamId> {
    let (name, number) = path.to_str()?.strip_suffix(".ring")?.split_once('.')?;
    let id = StreamId { name: Name::from_raw(u32::from_str_radix(name, 16).ok()?), number: number.parse().ok()? };
    // A stream has exactly one file.
    (path == Path::new(&file_name(id))).then_some(id)
}

impl StreamSegment {
    /// The stream as it stands, to read there; its file, to lock a seat of.
    pub(crate) fn open(node: &Directory, id: StreamId) -> Result<(Self, File), BadSegment> {
        let file = node.open_file(&file_name(id)).map_err(|error| BadSegment::of_open(Self::WHAT, error))?;
        Ok((Self::map(&file, id, Self::identify(&file, id)?, Use::Look)?, file))
    }

    /// Maps a file's parts. Seats are written by each user, whatever the rest is mapped for.
    fn map(file: &File, id: StreamId, shape: StreamShape, used: Use) -> io::Result<Self> {
        let seats = if used == Use::Look { Use::Share } else { used };
        let page: Located<StreamPage> = Mapping::new(file, PAGE, used)?.locate(0);
        let seats = Mapping::part(file, PAGE, shape.seats_bytes(), seats, Pages::Present)?;
        let index = Mapping::part(file, shape.index_offset(), shape.index_bytes(), used, Pages::Present)?;
        let bytes = shape.frames() * shape.frame_bytes();
        // A large ring is neither brought in nor locked at once: that would take longer than a module may to start.
        let (used, pages) = match used {
            _ if shape.is_present() => (used, Pages::Present),
            Use::Keep => (Use::Share, Pages::WhenTouched),
            used => (used, Pages::WhenTouched),
        };
        let frames = Mapping::part(file, shape.frames_offset(), bytes, used, pages)?;
        Ok(Self {
            seats: seats.locate_slice(0, usize::from(shape.readers)),
            entries: index.locate_slice(0, shape.keep as usize),
            hints: index.locate_slice(shape.hints_offset(), shape.keep as usize),
            words: frames.locate_slice(0, if shape.is_racing() { bytes / size_of::<u64>() } else { 0 }),
            frames: frames.rooms(0, shape.frame_bytes(), shape.frames()),
            first: page.identity.first.load(Ordering::Relaxed),
            page,
            id,
            shape,
        })
    }

    /// What a file says that it is. Read, not mapped.
    fn identify(file: &File, id: StreamId) -> Result<StreamShape, BadSegment> {
        let there = file.metadata()?;
        if there.len() < PAGE as u64 {
            return Err(BadFile::Foreign(Self::WHAT).into());
        }
        let mut first = [0; size_of::<StreamIdentity>()];
        file.read_exact_at(&mut first, 0)?;
        let identity = StreamIdentity::from_bytes(&first);
        if let Some(other) = identity.other_version() {
            return Err(BadFile::Version(other).into());
        }
        let (found, shape) = identity.read().ok_or(BadFile::Foreign(Self::WHAT))?;
        if found != id {
            return Err(BadFile::Misnamed(format!("{} {found}", Self::WHAT)).into());
        }
        let (what, there, whole) = (Self::WHAT, there.len(), shape.segment_bytes() as u64);
        if there < whole {
            return Err(BadFile::Cut { what, there, whole }.into());
        }
        Ok(shape)
    }

    #[inline]
    pub(crate) fn page(&self) -> &StreamPage {
        &self.page
    }

    #[inline]
    pub(crate) fn ring(&self) -> Ring<'_> {
        Ring::new(&self.page.written.0, self.first, (&self.entries, &self.hints), &self.seats)
    }

    /// Whether it is a replica, which may begin with any sequence.
    pub(crate) fn is_replica(&self) -> bool {
        // ORDERING: Relaxed; it goes along with nothing: whichever writer said it, a reader begins as with that one.
        self.page.writer.replica.load(Ordering::Relaxed) != 0
    }

    /// Whether nothing more is written here.
    pub(crate) fn is_retired(&self) -> bool {
        // ORDERING: Acquire; pairs with the store of `retire`: all records are seen.
        self.page.writer.retired.load(Ordering::Acquire) != 0
    }

    fn words(&self, frame: usize) -> &[AtomicU64] {
        let each = self.shape.frame_bytes() / size_of::<u64>();
        &self.words[frame * each..][..each]
    }

    /// Bytes of a record: its line is only believed as far as the frame goes.
    pub(crate) fn len(&self, line: &Line) -> usize {
        usize::try_from(line.about.len_bytes).unwrap_or(usize::MAX).min(self.shape.record_bytes as usize)
    }

    // ---- the writer ----

    /// Writes a record's bytes into its frame; no more than the frame has room for.
    #[inline]
    pub(crate) fn fill(&self, frame: &mut Frame, bytes: &[u8]) {
        if self.shape.is_racing() {
            bytes::store(self.words(frame.number()), bytes);
        } else {
            self.body_mut(frame)[..bytes.len()].copy_from_slice(bytes);
        }
    }

    /// Asks for the beginning of a frame that is about to be filled.
    #[inline]
    pub(crate) fn expect(&self, frame: usize) {
        prefetch_to_write(self.frames.room(frame).as_ptr());
    }

    /// The bytes of a frame, to fill in place.
    ///
    /// # Panics
    /// When records of this stream may be copied meanwhile.
    pub(crate) fn body_mut<'a>(&'a self, frame: &'a mut Frame) -> &'a mut [u8] {
        assert!(!self.shape.is_racing());
        let body = self.frames.room(frame.number());
        // SAFETY: a room of so many bytes; the borrow of `self` keeps its map. The frame is the only one of its number,
        // borrowed, and named by no entry and no seat (`Progress::claim`): nothing else reaches these bytes, since
        // records of this size are only read held (`copy`).
        unsafe { std::slice::from_raw_parts_mut(body.as_ptr(), self.shape.record_bytes as usize) }
    }

    /// Where [`StreamSegment::body_mut`] has so many bytes.
    pub(crate) fn place_of(&self, frame: usize, len: usize) -> RecordPlace {
        RecordPlace::new(self.frames.room(frame), len.min(self.shape.record_bytes as usize), self.frames.mapping())
    }

    // ---- readers ----

    /// Copies a record's bytes; false when it was overwritten, and then there are none. The seat is the caller's, and
    /// names no frame.
    pub(crate) fn copy(&self, seat: usize, line: &Line, into: &mut Vec<u8>) -> bool {
        let (ring, len) = (self.ring(), self.len(line));
        let copied = if self.shape.is_racing() {
            // What is there is written over: a body of the same length needs nothing.
            into.resize(len, 0);
            bytes::load(self.words(line.frame), into);
            ring.is_there(line)
        } else {
            let held = ring.hold(seat, line);
            if held {
                into.clear();
                into.extend_from_slice(self.body(line));
                ring.release(seat);
            }
            held
        };
        if !copied {
            into.clear();
        }
        copied
    }

    /// The bytes of a record that the caller holds, or has written and is the only one to write over.
    pub(crate) fn body(&self, line: &Line) -> &[u8] {
        let body = self.frames.room(line.frame);
        // SAFETY: `len` stays inside the room, and the borrow of `self` keeps the map. The caller's seat names the
        // frame since before the entry was seen to name it still (`Ring::hold`), so the writer goes round it; or the
        // caller borrows the writer (`StreamWriter::newest`). Nobody writes these bytes. All bits are bytes.
        unsafe { std::slice::from_raw_parts(body.as_ptr(), self.len(line)) }
    }
}

impl Owned for StreamSegment {
    const WHAT: &'static str = "stream";
    type Id = StreamId;
    /// With where it begins, if not behind what was there before: a replica has the sequences of its origin.
    type Shape = (StreamShape, Option<u64>);

    fn file_name(id: StreamId) -> String {
        file_name(id)
    }

    fn bytes((shape, _): &Self::Shape) -> usize {
        shape.segment_bytes()
    }

    fn check(file: &File, id: StreamId, used: Use) -> Result<Self, BadSegment> {
        Ok(Self::map(file, id, Self::identify(file, id)?, used)?)
    }

    fn format(file: &File, id: StreamId, (shape, first): Self::Shape, old: Option<&Self>) -> io::Result<Self> {
        let mut segment = Self::map(file, id, shape, Use::Keep)?;
        segment.first = first.unwrap_or_else(|| old.map_or(0, |old| Progress::resume(&old.ring()).next()));
        segment.page.identity.first.store(segment.first, Ordering::Relaxed);
        segment.page.writer.replica.store(first.is_some().into(), Ordering::Relaxed);
        segment.ring().format();
        segment.page.identity.write(id, &shape);
        Ok(segment)
    }

    fn goes_on_as(&self, (shape, first): &Self::Shape) -> bool {
        let is_behind = || first.is_none_or(|first| Progress::resume(&self.ring()).next() <= first);
        self.shape == *shape && !self.is_retired() && is_behind()
    }

    /// Nothing of the records: the writer looks through the index when it begins.
    fn adopt(&self, (_, first): &Self::Shape) {
        self.page.writer.replica.store(first.is_some().into(), Ordering::Relaxed);
        self.page.writer.adoptions.fetch_add(1, Ordering::Relaxed);
    }

    fn replace(&self, old: &Self) {
        let refused = old.page.writer.refused.load(Ordering::Relaxed);
        self.page.writer.refused.store(refused, Ordering::Relaxed);
        old.retire();
    }

    fn retire(&self) {
        step!("retire: before ring");
        // ORDERING: Release; a reader that sees this sees all records.
        self.page.writer.retired.store(1, Ordering::Release);
        step!("retire: ring");
    }
}
