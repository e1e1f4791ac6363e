//! Files mapped into memory that other processes map too. The only place that turns addresses into references.

use nix::errno::Errno;
use nix::sys::mman::{MapFlags, ProtFlags, mmap, munmap};
use std::fs::File;
use std::io;
use std::num::NonZeroUsize;
use std::ops::Deref;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, AtomicU64};
use std::sync::{Arc, Weak};

/// Types that may lie in memory which other processes write at any time.
///
/// # Safety
/// Every bit pattern is a valid value, and every field that anyone writes after creation is an atomic.
pub(crate) unsafe trait Shared {}

// SAFETY: an atomic; all bit patterns are numbers.
unsafe impl Shared for AtomicU32 {}
// SAFETY: an atomic; all bit patterns are numbers.
unsafe impl Shared for AtomicU64 {}

/// A shared mapping of a part of a file, or one of several users of it in this process. Truncating the file
/// afterwards is outside our contract: all processes of a user trust each other's memory.
#[derive(Clone)]
pub(crate) struct Mapping {
    /// As in the region, which it keeps: reached without another look.
    base: NonNull<u8>,
    bytes: usize,
    region: Arc<Region>,
}

/// What is mapped until its last user goes.
pub(crate) struct Region {
    base: NonNull<u8>,
    bytes: usize,
}

// SAFETY: the mapping belongs to no thread; what lies in it is reached as atomics or under the slot protocol.
unsafe impl Send for Mapping {}
// SAFETY: as above: shared references give access to atomics only, bodies come as raw pointers.
unsafe impl Sync for Mapping {}
// SAFETY: it is an address that nothing but its end uses.
unsafe impl Send for Region {}
// SAFETY: as above.
unsafe impl Sync for Region {}

/// What a mapping is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Use {
    /// To read.
    Look,
    /// To read and write.
    Share,
    /// The same, and the kernel is asked to keep the pages in memory. If the memlock limit does not allow it they are
    /// present all the same, as long as memory is not short.
    Keep,
}

/// When the pages of a mapping come.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Pages {
    /// All, before it is used.
    Present,
    /// Each when it is touched. The file has its memory, so none fails.
    WhenTouched,
}

impl Mapping {
    /// Maps the first `bytes` of a file that is at least so long, all pages present.
    pub(crate) fn new(file: &File, bytes: usize, used: Use) -> io::Result<Self> {
        Self::part(file, 0, bytes, used, Pages::Present)
    }

    /// Maps `bytes` from `offset` on, which begins a page, of a file that is long enough.
    pub(crate) fn part(file: &File, offset: usize, bytes: usize, used: Use, pages: Pages) -> io::Result<Self> {
        let length = NonZeroUsize::new(bytes).ok_or(io::ErrorKind::InvalidInput)?;
        let end = offset.checked_add(bytes).ok_or(io::ErrorKind::InvalidInput)?;
        if file.metadata()?.len() < end as u64 {
            return Err(io::Error::new(io::ErrorKind::UnexpectedEof, format!("file is shorter than {end} bytes")));
        }
        let offset = offset.try_into().map_err(|_| io::ErrorKind::InvalidInput)?;
        let pages = if pages == Pages::Present { MapFlags::MAP_POPULATE } else { MapFlags::empty() };
        let (write, keep) = match used {
            Use::Look => (ProtFlags::empty(), MapFlags::empty()),
            Use::Share => (ProtFlags::PROT_WRITE, MapFlags::empty()),
            Use::Keep => (ProtFlags::PROT_WRITE, MapFlags::MAP_LOCKED),
        };
        let map = |keep| {
            let flags = MapFlags::MAP_SHARED | pages | keep;
            // SAFETY: a new mapping at an address of the kernel's choice touches nothing that exists.
            unsafe { mmap(None, length, ProtFlags::PROT_READ | write, flags, file, offset) }
        };
        let base = match map(keep) {
            Err(Errno::EAGAIN | Errno::EPERM) if used == Use::Keep => map(MapFlags::empty())?,
            mapped => mapped?,
        };
        let base = base.cast();
        Ok(Self { base, bytes, region: Arc::new(Region { base, bytes }) })
    }

    /// By which it is found again while it has a user.
    pub(crate) fn downgrade(&self) -> Weak<Region> {
        Arc::downgrade(&self.region)
    }

    /// The mapping again, for another user.
    pub(crate) fn of(region: Arc<Region>) -> Self {
        Self { base: region.base, bytes: region.bytes, region }
    }

    /// The value at `offset`.
    ///
    /// # Panics
    /// When it does not lie inside the mapping or is not aligned: offsets come from checked layouts.
    #[inline]
    pub(crate) fn at<T: Shared>(&self, offset: usize) -> &T {
        &self.slice(offset, 1)[0]
    }

    /// `count` values from `offset` on. Panics as [`Mapping::at`] does.
    #[inline]
    pub(crate) fn slice<T: Shared>(&self, offset: usize, count: usize) -> &[T] {
        let first = self.bytes_at(offset, count * size_of::<T>()).cast::<T>();
        assert!(first.is_aligned());
        // SAFETY: inside the mapping and aligned (both asserted); any bits are a `T` and others write only atomics of
        // it (`Shared`); the borrow of `self` keeps the mapping.
        unsafe { std::slice::from_raw_parts(first.as_ptr(), count) }
    }

    /// The address of `count` bytes from `offset` on. Panics as [`Mapping::at`] does.
    #[inline]
    pub(crate) fn bytes_at(&self, offset: usize, count: usize) -> NonNull<u8> {
        assert!(offset.checked_add(count).is_some_and(|end| end <= self.bytes));
        // SAFETY: stays inside the mapping, as just asserted.
        unsafe { self.base.add(offset) }
    }
}

/// A part of a mapping that was checked when it was made, and is reached without another look. Keeps the mapping.
pub(crate) struct Located<T: ?Sized> {
    at: NonNull<T>,
    _mapping: Mapping,
}

// SAFETY: made of `Shared` values alone (`Mapping::locate`), which any thread may reach; it may go wherever the mapping
// may.
unsafe impl<T: ?Sized> Send for Located<T> {}
// SAFETY: as above.
unsafe impl<T: ?Sized> Sync for Located<T> {}

impl Mapping {
    /// [`Mapping::at`], to keep.
    pub(crate) fn locate<T: Shared>(&self, offset: usize) -> Located<T> {
        Located { at: NonNull::from(self.at::<T>(offset)), _mapping: self.clone() }
    }

    /// [`Mapping::slice`], to keep.
    pub(crate) fn locate_slice<T: Shared>(&self, offset: usize, count: usize) -> Located<[T]> {
        Located { at: NonNull::from(self.slice::<T>(offset, count)), _mapping: self.clone() }
    }
}

/// Rooms of one size, one after the other, to be reached by their number. Keeps the mapping.
pub(crate) struct Rooms {
    first: NonNull<u8>,
    bytes_each: usize,
    count: usize,
    mapping: Mapping,
}

// SAFETY: as of `Mapping`: bodies come as raw pointers.
unsafe impl Send for Rooms {}
// SAFETY: as above.
unsafe impl Sync for Rooms {}

impl Rooms {
    /// The address of a room.
    ///
    /// # Panics
    /// When there is none of this number.
    #[inline]
    pub(crate) fn room(&self, number: usize) -> NonNull<u8> {
        assert!(number < self.count);
        // SAFETY: inside the mapping: all rooms are (`Mapping::rooms`).
        unsafe { self.first.add(number * self.bytes_each) }
    }

    /// What they are in.
    pub(crate) fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// Where they begin: an address to prefetch from, also when there is no room.
    #[inline]
    pub(crate) fn first(&self) -> *const u8 {
        self.first.as_ptr()
    }

    /// From one to the next.
    #[inline]
    pub(crate) fn bytes_each(&self) -> usize {
        self.bytes_each
    }
}

impl Mapping {
    /// Panics as [`Mapping::at`] does.
    pub(crate) fn rooms(&self, offset: usize, bytes_each: usize, count: usize) -> Rooms {
        let first = self.bytes_at(offset, bytes_each * count);
        Rooms { first, bytes_each, count, mapping: self.clone() }
    }
}

impl<T: ?Sized> Deref for Located<T> {
    type Target = T;

    #[inline]
    fn deref(&self) -> &T {
        // SAFETY: it was a reference into the mapping, which lives as long as this.
        unsafe { self.at.as_ref() }
    }
}

impl Drop for Region {
    fn drop(&mut self) {
        // SAFETY: our own mapping; every reference into it borrowed a `Mapping`, and the last of them is gone.
        let unmapped = unsafe { munmap(self.base.cast(), self.bytes) };
        debug_assert!(unmapped.is_ok());
    }
}
