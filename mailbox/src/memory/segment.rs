//! A mailbox's segment: the file, mapped and checked, and the bodies of its slots.

use crate::clock::monotonic_ns;
use crate::memory::files::Directory;
use crate::memory::layout::{Identity, PAGE, Page, SLOT_PREFIX, Shape};
use crate::memory::mapped;
use crate::memory::mapping::{Located, Mapping, Rooms, Use};
use crate::memory::owned::{BadFile, BadSegment};
use crate::name::Name;
use crate::package::{HEAD_BYTES, Head};
use crate::slots::bodies::Bodies;
use crate::slots::protocol::{Claim, Slots, Taken};
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, Ordering};

/// Numbers the segments of this process; none comes twice.
static NEXT: AtomicU64 = AtomicU64::new(0);

/// A mailbox's memory. What it is was checked when it was mapped and is not read again.
pub(crate) struct Segment {
    page: Located<Page>,
    words: Located<[AtomicU64]>,
    /// Prefix and body of each slot; none of a segment that is only looked at.
    rooms: Rooms,
    /// No other segment of this process has this number, also no other of the same file.
    number: u64,
    pub(crate) name: Name,
    pub(crate) shape: Shape,
    /// What the shape says, worked out once.
    word_stride: usize,
}

/// The word for what has a segment of this kind.
pub(crate) const WHAT: &str = "mailbox";

/// The file of a mailbox.
pub(crate) fn file_name(name: Name) -> String {
    format!("{:08x}.mbx", name.raw())
}

/// The mailbox a file of this name belongs to.
pub(crate) fn name_of(path: &Path) -> Option<Name> {
    if path.extension()? != "mbx" {
        return None;
    }
    let name = u32::from_str_radix(path.file_stem()?.to_str()?, 16).ok().map(Name::from_raw)?;
    // `1.mbx` is nobody's: a name has exactly one file.
    (path == Path::new(&file_name(name))).then_some(name)
}

impl Segment {
    /// Maps a file that was just made, and writes what it is.
    pub(crate) fn format(file: &File, name: Name, shape: Shape) -> io::Result<Self> {
        let segment = Self::new(&Mapping::new(file, shape.segment_bytes(), Use::Keep)?, name, shape, true);
        segment.page().identity.write(name, &shape);
        Ok(segment)
    }

    /// The mailbox of this name as it stands, to send there; mapped once, however many of this process send there.
    pub(crate) fn open(node: &Directory, name: Name) -> Result<Self, BadSegment> {
        let file = node.open_file(&file_name(name)).map_err(|error| BadSegment::of_open(WHAT, error))?;
        let shape = Self::identify(&file, name)?;
        Ok(Self::new(&mapped::mapping(&file, shape.segment_bytes())?, name, shape, true))
    }

    /// Maps its page and words, to look at: no body is read, and so none of its pages need be brought in.
    pub(crate) fn look_at(node: &Directory, name: Name) -> Result<(Self, File), BadSegment> {
        let file = node.open_to_read(&file_name(name)).map_err(|error| BadSegment::of_open(WHAT, error))?;
        let shape = Self::identify(&file, name)?;
        Ok((Self::new(&Mapping::new(&file, shape.slots_offset(), Use::Look)?, name, shape, false), file))
    }

    /// Maps a file and checks that it is this mailbox, whole.
    pub(crate) fn check(file: &File, name: Name, used: Use) -> Result<Self, BadSegment> {
        let shape = Self::identify(file, name)?;
        Ok(Self::new(&Mapping::new(file, shape.segment_bytes(), used)?, name, shape, true))
    }

    fn new(mapping: &Mapping, name: Name, shape: Shape, has_bodies: bool) -> Self {
        let slots = if has_bodies { usize::from(shape.slots) } else { 0 };
        let rooms = mapping.rooms(shape.slots_offset(), shape.slot_bytes(), slots);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let (page, words) = (mapping.locate(0), mapping.locate_slice(PAGE, shape.words()));
        Self { page, words, rooms, number, name, shape, word_stride: shape.word_stride() }
    }

    /// What a file says that it is. Read, not mapped: a map costs more than all of the rest.
    fn identify(file: &File, name: Name) -> Result<Shape, BadSegment> {
        let there = file.metadata()?;
        if there.len() < size_of::<Page>() as u64 {
            return Err(BadFile::Foreign(WHAT).into());
        }
        let mut first = [0; size_of::<Identity>()];
        file.read_exact_at(&mut first, 0)?;
        let identity = Identity::from_bytes(&first);
        if let Some(other) = identity.other_version() {
            return Err(BadFile::Version(other).into());
        }
        let (found, shape) = identity.read().ok_or(BadFile::Foreign(WHAT))?;
        if found != name || there.len() < shape.segment_bytes() as u64 {
            return Err(BadFile::Foreign(WHAT).into());
        }
        Ok(shape)
    }

    #[inline]
    pub(crate) fn page(&self) -> &Page {
        &self.page
    }

    #[inline(always)]
    pub(crate) fn slots(&self) -> Slots<'_> {
        let bodies = Bodies { first: self.rooms.first(), bytes: self.rooms.bytes_each(), segment: self.number };
        Slots::new(&self.page.hot, &self.words, self.word_stride, usize::from(self.shape.slots), bodies)
    }

    /// A slot that this process has claimed or taken.
    ///
    /// # Panics
    /// If it is a slot of another segment.
    #[inline]
    fn slot(&self, slot: usize, segment: u64) -> NonNull<u8> {
        assert!(segment == self.number);
        self.rooms.room(slot)
    }

    /// The body of a claimed slot, to write.
    #[inline(always)]
    pub(crate) fn body_mut<'a>(&'a self, claim: &'a mut Claim) -> &'a mut [u8] {
        let (slot, len) = (self.slot(claim.slot(), claim.segment()), usize::from(self.shape.body_bytes_max));
        // SAFETY: `slot` gives room for prefix and body, and the borrow of `self` keeps the map. The claim is of this
        // segment (`slot`), the only one of its slot (see `slots`), and borrowed: nothing else reaches these bytes.
        unsafe { std::slice::from_raw_parts_mut(slot.add(SLOT_PREFIX).as_ptr(), len) }
    }

    /// Writes the prefix of a claimed slot: the time (which is the result) and the head.
    #[inline(always)]
    pub(crate) fn write_head(&self, claim: &mut Claim, head: &Head) -> u64 {
        let (prefix, now_ns) = (self.slot(claim.slot(), claim.segment()), monotonic_ns());
        // SAFETY: inside the slot and aligned (slots start at multiples of 64); exclusive as in `body_mut`.
        unsafe {
            prefix.cast::<u64>().write(now_ns);
            prefix.add(8).cast::<[u8; HEAD_BYTES]>().write(head.to_bytes());
        }
        now_ns
    }

    /// When a taken package was published (monotonic ns), and its head; the length in it is one that the slot has room
    /// for.
    #[inline(always)]
    pub(crate) fn read_head(&self, taken: &Taken) -> (u64, Head) {
        let prefix = self.slot(taken.slot(), taken.segment());
        // SAFETY: inside the slot and aligned; taken, and of this segment (`slot`), so nobody writes it.
        let (published_ns, head) =
            unsafe { (prefix.cast::<u64>().read(), prefix.add(8).cast::<[u8; HEAD_BYTES]>().read()) };
        // Its length is only believed as far as the slot goes.
        let head = Head::of(&head);
        (published_ns, Head { len: head.len.min(self.shape.body_bytes_max), ..head })
    }

    /// The first `len` bytes of a taken package's body.
    #[inline]
    pub(crate) fn body<'a>(&'a self, taken: &'a Taken, len: u16) -> &'a [u8] {
        let (slot, len) = (self.slot(taken.slot(), taken.segment()), len.min(self.shape.body_bytes_max));
        // SAFETY: `len` stays inside the slot. Taken, and of this segment (`slot`), so nobody writes it; it is
        // borrowed, so it is not released while the result lives.
        unsafe { std::slice::from_raw_parts(slot.add(SLOT_PREFIX).as_ptr(), usize::from(len)) }
    }
}
