//! Streams that belong to one thread, wherever the garbage collector meets them.

use rohrpost_native::NativeStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, ThreadId};

/// A stream, and the thread that opened it.
pub(crate) struct Owned {
    stream: NativeStream,
    thread: ThreadId,
}

// SAFETY: the thread that opened it alone uses and drops the stream (`Owned::stream`, `Owned::end`, `drop_left`); in
// others it is moved at most.
unsafe impl Send for Owned {}
// SAFETY: as above; nothing is read of it by a shared borrow but the thread.
unsafe impl Sync for Owned {}

/// Streams that the garbage collector met in another thread than theirs.
static LEFT: Mutex<Vec<Owned>> = Mutex::new(Vec::new());
/// Whether there may be any.
static HAS_LEFT: AtomicBool = AtomicBool::new(false);

impl Owned {
    /// Of this thread.
    pub(crate) fn new(stream: NativeStream) -> Self {
        Self { stream, thread: thread::current().id() }
    }

    /// For the thread that opened it.
    pub(crate) fn stream(&mut self) -> Option<&mut NativeStream> {
        (self.thread == thread::current().id()).then_some(&mut self.stream)
    }

    /// Nobody uses it any more: its seat is free, now or when its thread comes by.
    pub(crate) fn end(self) {
        if self.thread != thread::current().id() {
            LEFT.lock().unwrap_or_else(PoisonError::into_inner).push(self);
            // ORDERING: Relaxed; the mutex orders what is behind it, and a stream that is seen later is dropped later.
            HAS_LEFT.store(true, Ordering::Relaxed);
        }
    }
}

/// Drops the streams of this thread, a module's, that were left elsewhere.
pub(crate) fn drop_left() {
    // ORDERING: Relaxed; as above.
    if HAS_LEFT.load(Ordering::Relaxed) && HAS_LEFT.swap(false, Ordering::Relaxed) {
        let here = thread::current().id();
        LEFT.lock().unwrap_or_else(PoisonError::into_inner).retain(|left| left.thread != here);
    }
}
