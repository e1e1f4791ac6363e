//! Counts how often a thread asks the heap for something or gives it back. Tests of hot paths in other crates are
//! compiled with this very file.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static USES: Cell<u64> = const { Cell::new(0) };
}

/// The system's heap, and a count of its uses by each thread. A program that wants the count makes it its
/// `#[global_allocator]`.
pub struct CountingHeap;

/// How often this thread has used the heap. Stays 0 in a program without [`CountingHeap`].
pub fn heap_uses() -> u64 {
    USES.with(Cell::get)
}

fn count() {
    USES.with(|uses| uses.set(uses.get() + 1));
}

// SAFETY: hands everything on to the system's; counting neither allocates nor ends with the thread.
unsafe impl GlobalAlloc for CountingHeap {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as our caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as our caller promises.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
        count();
        // SAFETY: as our caller promises.
        unsafe { System.realloc(pointer, layout, bytes) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as our caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}
