//! A mailbox's segment: the file, mapped and checked, and the bodies of its slots.

use crate::clock::monotonic_ns;
use crate::files::{open_shared, open_to_read};
use crate::layout::{Identity, Page, SLOT_PREFIX, Shape, VERSION};
use crate::memory::{Mapping, Use};
use crate::name::Name;
use crate::package::{HEAD_BYTES, Head};
use crate::slots::Slots;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::ptr::NonNull;

/// A mailbox's memory. What it is was checked when it was mapped and is not read again.
pub(crate) struct Segment {
    mapping: Mapping,
    pub(crate) name: Name,
    pub(crate) shape: Shape,
}

/// Why a file is not the mailbox it should be.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BadSegment {
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Foreign, or damaged.
    #[error("its file is no mailbox, or damaged; end its owner, and remove the file with `rohrpost clean`")]
    Foreign,
    /// Another version's layout.
    #[error("it was made by another version (layout {0}, this program {VERSION}); build both from the same version")]
    Version(u32),
}

/// The file of a mailbox.
pub(crate) fn path_of(node: &Path, name: Name) -> PathBuf {
    node.join(format!("{:08x}.mbx", name.raw()))
}

/// The mailbox a file of a node's directory belongs to.
pub(crate) fn name_of(path: &Path) -> Option<Name> {
    if path.extension()? != "mbx" {
        return None;
    }
    let name = u32::from_str_radix(path.file_stem()?.to_str()?, 16).ok().map(Name::from_raw)?;
    // `1.mbx` is nobody's: a name has exactly one file.
    (path.file_name() == path_of(Path::new(""), name).file_name()).then_some(name)
}

impl Segment {
    /// Maps a file that was just made, and writes what it is.
    pub(crate) fn format(file: &File, name: Name, shape: Shape) -> io::Result<Self> {
        let mapping = Mapping::new(file, shape.segment_bytes(), Use::Keep)?;
        let segment = Self { mapping, name, shape };
        segment.page().identity.write(name, &shape);
        Ok(segment)
    }

    /// Maps the mailbox of this name as it stands.
    pub(crate) fn open(node: &Path, name: Name) -> Result<Self, BadSegment> {
        Self::check(&open_shared(&path_of(node, name), false)?, name, Use::Share)
    }

    /// Maps its page and words, to look at: no body is read, and so none of its pages need be brought in.
    pub(crate) fn look_at(node: &Path, name: Name) -> Result<(Self, File), BadSegment> {
        let file = open_to_read(&path_of(node, name))?;
        let shape = Self::identify(&file, name)?;
        Ok((Self { mapping: Mapping::new(&file, shape.slots_offset(), Use::Look)?, name, shape }, file))
    }

    /// Maps a file and checks that it is this mailbox, whole.
    pub(crate) fn check(file: &File, name: Name, used: Use) -> Result<Self, BadSegment> {
        let shape = Self::identify(file, name)?;
        Ok(Self { mapping: Mapping::new(file, shape.segment_bytes(), used)?, name, shape })
    }

    /// What a file says that it is. Read, not mapped: a map costs more than all of the rest.
    fn identify(file: &File, name: Name) -> Result<Shape, BadSegment> {
        let there = file.metadata()?;
        if !there.is_file() || there.len() < size_of::<Page>() as u64 {
            return Err(BadSegment::Foreign);
        }
        let mut first = [0; size_of::<Identity>()];
        file.read_exact_at(&mut first, 0)?;
        let identity = Identity::from_bytes(&first);
        if let Some(other) = identity.other_version() {
            return Err(BadSegment::Version(other));
        }
        let (found, shape) = identity.read().ok_or(BadSegment::Foreign)?;
        if found != name || there.len() < shape.segment_bytes() as u64 {
            return Err(BadSegment::Foreign);
        }
        Ok(shape)
    }

    pub(crate) fn page(&self) -> &Page {
        self.mapping.at(0)
    }

    pub(crate) fn slots(&self) -> Slots<'_> {
        let words = self.mapping.slice(crate::layout::PAGE, self.shape.words());
        Slots::new(&self.page().hot, words, self.shape.word_stride(), usize::from(self.shape.slots))
    }

    fn slot(&self, slot: usize) -> NonNull<u8> {
        assert!(slot < usize::from(self.shape.slots));
        let bytes = self.shape.slot_bytes();
        self.mapping.bytes_at(self.shape.slots_offset() + slot * bytes, bytes)
    }

    /// The body of a slot, to write.
    ///
    /// # Safety
    /// The caller holds the claim on this slot, and nothing else of this process reaches its bytes while the result lives.
    #[expect(clippy::mut_from_ref, reason = "exclusive by the claim, not by the borrow")]
    pub(crate) unsafe fn body_mut(&self, slot: usize) -> &mut [u8] {
        // SAFETY: `slot` gives room for prefix and body; the claim makes it ours alone (see `slots`); the borrow keeps the map.
        unsafe {
            std::slice::from_raw_parts_mut(
                self.slot(slot).add(SLOT_PREFIX).as_ptr(),
                usize::from(self.shape.body_bytes_max),
            )
        }
    }

    /// Writes a slot's prefix: the time (which is the result) and the head.
    ///
    /// # Safety
    /// As for [`Segment::body_mut`].
    pub(crate) unsafe fn write_head(&self, slot: usize, head: &Head) -> u64 {
        let (prefix, now_ns) = (self.slot(slot), monotonic_ns());
        // SAFETY: inside the slot and aligned (slots start at multiples of 64); the claim makes it ours alone.
        unsafe {
            prefix.cast::<u64>().write(now_ns);
            prefix.add(8).cast::<[u8; HEAD_BYTES]>().write(head.to_bytes());
        }
        now_ns
    }

    /// When a slot's package was published (monotonic ns), its head, and its body.
    ///
    /// # Safety
    /// The caller has taken this slot, and does not free it while the result lives.
    pub(crate) unsafe fn read(&self, slot: usize) -> (u64, Head, &[u8]) {
        let prefix = self.slot(slot);
        // SAFETY: inside the slot and aligned; taken, so nobody writes it.
        let (published_ns, head) =
            unsafe { (prefix.cast::<u64>().read(), prefix.add(8).cast::<[u8; HEAD_BYTES]>().read()) };
        // Sixteen bytes are always a head; its length is only believed as far as the slot goes.
        let head = Head::from_bytes(&head).unwrap_or_default();
        let len = head.len.min(self.shape.body_bytes_max);
        // SAFETY: as above; `len` stays inside the slot.
        let body = unsafe { std::slice::from_raw_parts(prefix.add(SLOT_PREFIX).as_ptr(), usize::from(len)) };
        (published_ns, Head { len, ..head }, body)
    }
}
