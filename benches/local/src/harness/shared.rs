//! Memory that the parent and its forked processes share.

use super::{Failure, OrFail};
use std::num::NonZeroUsize;
use std::ops::Deref;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// What may lie in [`Shared`] memory.
///
/// # Safety
/// Zeroes are a valid value; everything in it is an atomic or an `UnsafeCell`, so that other processes may write it; it
/// has no pointer and need not be dropped.
pub unsafe trait Zeroable: Sync {}

// SAFETY: made of such.
unsafe impl<T: Zeroable, const N: usize> Zeroable for [T; N] {}

/// One `T` in anonymous memory, zeroed and resident before any timing. Freed with the last process that has it.
pub struct Shared<T: Zeroable> {
    at: NonNull<T>,
}

impl<T: Zeroable> Shared<T> {
    /// Makes it; processes forked from now on see the same memory.
    ///
    /// # Errors
    /// When the kernel has no memory to give.
    pub fn new() -> Result<Self, Failure> {
        use nix::sys::mman::{MapFlags, ProtFlags, mmap_anonymous};
        let bytes = NonZeroUsize::new(size_of::<T>()).unwrap_or(NonZeroUsize::MIN);
        let access = ProtFlags::PROT_READ | ProtFlags::PROT_WRITE;
        // SAFETY: a new mapping wherever the kernel likes; it replaces nothing.
        let at = unsafe { mmap_anonymous(None, bytes, access, MapFlags::MAP_SHARED | MapFlags::MAP_POPULATE) };
        Ok(Self { at: at.or_fail("shared memory")?.cast() })
    }
}

impl<T: Zeroable> Deref for Shared<T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: mapped until drop, aligned to pages (no T asks for more), and a `Zeroable` is valid whatever others
        // write.
        unsafe { self.at.as_ref() }
    }
}

impl<T: Zeroable> Drop for Shared<T> {
    fn drop(&mut self) {
        // SAFETY: mapped in `new` with this length; the borrow checker saw the last use. It cannot fail for such a
        // mapping.
        let _ = unsafe { nix::sys::mman::munmap(self.at.cast(), size_of::<T>().max(1)) };
    }
}

// SAFETY: it owns its mapping, and what is in it is `Sync`.
unsafe impl<T: Zeroable> Send for Shared<T> {}
// SAFETY: it gives out `&T` alone, and T is `Sync`.
unsafe impl<T: Zeroable> Sync for Shared<T> {}

/// Opening a link takes milliseconds, on a busy computer a second.
const GATE_OPENS_WITHIN: Duration = Duration::from_secs(20);

/// A barrier for processes, for any number of rounds.
#[repr(transparent)]
pub struct Gate(AtomicU32);

// SAFETY: one atomic.
unsafe impl Zeroable for Gate {}

impl Gate {
    /// Sleeps until all processes together have called this so often.
    ///
    /// # Errors
    /// When the others do not come in time.
    pub fn meet(&self, calls: u32) -> Result<(), Failure> {
        // ORDERING: all that leave see what each did before it came.
        self.0.fetch_add(1, Ordering::AcqRel);
        let give_up = Instant::now() + GATE_OPENS_WITHIN;
        while self.0.load(Ordering::Acquire) < calls {
            if Instant::now() > give_up {
                return Err(Failure::Failed(format!(
                    "the other process did not get ready within {GATE_OPENS_WITHIN:?}"
                )));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }
}
