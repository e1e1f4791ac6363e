//! A ring for one sender and one receiver: the best rate between two processors, in order and without duplicates.
//!
//! It has no priorities, no second sender and no recovery from death. [`BareRing`] spins when it is empty or full,
//! [`Futex`] sleeps.

use crate::one_way::{Sink, Source};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::Zeroable;
use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Messages that a ring holds.
pub const DEPTH: usize = 64;
/// Largest message.
pub const BYTES_MAX: usize = 4096;

/// A word with its cache line, and the next one, which processors fetch along.
#[repr(C, align(128))]
pub struct CacheLine<T>(pub T);

/// A ring's memory.
#[repr(C)]
pub struct RingMemory {
    produced: CacheLine<AtomicU64>,
    consumed: CacheLine<AtomicU64>,
    room: Bell,
    slots: CacheLine<UnsafeCell<[u8; DEPTH * BYTES_MAX]>>,
}

// SAFETY: the sender writes a slot's bytes before it advances `produced`, and the receiver reads them before it
// advances `consumed`.
unsafe impl Sync for RingMemory {}
// SAFETY: atomics and an `UnsafeCell` of bytes; zeroes are an empty ring.
unsafe impl Zeroable for RingMemory {}

/// A ring and the word that its receiver sleeps on.
#[repr(C)]
pub struct SharedRing {
    ring: RingMemory,
    bell: Bell,
}

// SAFETY: made of such.
unsafe impl Zeroable for SharedRing {}

/// A word that one process sleeps on: 1 while it does or is about to.
#[repr(C)]
pub struct Bell(CacheLine<AtomicU32>);

impl Bell {
    /// Sleeps unless `found` is true after the announcement of the sleep.
    pub fn sleep_unless(&self, found: impl Fn() -> bool) {
        let word = &self.0.0;
        // ORDERING: SeqCst, as are the sender's store of what `found` looks at and its load of the word: one side sees
        // the other's store.
        word.store(1, Ordering::SeqCst);
        if found() {
            word.store(0, Ordering::Relaxed);
            return;
        }
        // SAFETY: waits on a word that outlives the call, without a timeout.
        unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), libc::FUTEX_WAIT, 1, std::ptr::null::<()>()) };
    }

    /// Wakes a sleeping process; no system call if none sleeps. What it looks for has been stored by SeqCst before.
    pub fn ring(&self) {
        let word = &self.0.0;
        if word.load(Ordering::SeqCst) != 0 {
            word.store(0, Ordering::SeqCst);
            // SAFETY: only the word's address is used.
            unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), libc::FUTEX_WAKE, 1) };
        }
    }
}

impl RingMemory {
    fn slot(&self, number: u64) -> *mut u8 {
        let at = number as usize % DEPTH * BYTES_MAX;
        // SAFETY: inside the slots.
        unsafe { self.slots.0.get().cast::<u8>().add(at) }
    }
}

/// The sending side.
pub struct RingSender<'a> {
    memory: &'a RingMemory,
    produced: u64,
    /// As last seen.
    consumed: u64,
}

impl<'a> RingSender<'a> {
    /// There must be one only.
    pub fn new(memory: &'a RingMemory) -> Self {
        Self { memory, produced: 0, consumed: 0 }
    }

    fn has_room(&mut self, ordering: Ordering) -> bool {
        if self.produced - self.consumed >= DEPTH as u64 {
            self.consumed = self.memory.consumed.0.load(ordering);
        }
        self.produced - self.consumed < DEPTH as u64
    }

    /// Sleeps until there is room.
    pub fn await_room(&mut self) {
        while !self.has_room(Ordering::Acquire) {
            let (memory, produced) = (self.memory, self.produced);
            memory.room.sleep_unless(|| produced - memory.consumed.0.load(Ordering::SeqCst) < DEPTH as u64);
        }
    }

    /// There must be room.
    pub fn push(&mut self, message: &[u8], ordering: Ordering) {
        debug_assert!(message.len() <= BYTES_MAX);
        // SAFETY: the slot is free, so ours, and as large as any message.
        unsafe { std::ptr::copy_nonoverlapping(message.as_ptr(), self.memory.slot(self.produced), message.len()) };
        self.produced += 1;
        self.memory.produced.0.store(self.produced, ordering);
    }
}

/// The receiving side.
pub struct RingReceiver<'a> {
    memory: &'a RingMemory,
    consumed: u64,
    /// As last seen.
    produced: u64,
}

impl<'a> RingReceiver<'a> {
    /// There must be one only.
    pub fn new(memory: &'a RingMemory) -> Self {
        Self { memory, consumed: 0, produced: 0 }
    }

    /// Whether the ring has something, asked of the memory.
    pub fn may_have(&self) -> bool {
        self.memory.produced.0.load(Ordering::SeqCst) > self.consumed
    }

    fn has(&mut self) -> bool {
        if self.produced == self.consumed {
            self.produced = self.memory.produced.0.load(Ordering::Acquire);
        }
        self.produced > self.consumed
    }

    /// Copies the next message out, if there is one.
    pub fn pop(&mut self, message: &mut [u8], ordering: Ordering) -> bool {
        if !self.has() {
            return false;
        }
        debug_assert!(message.len() <= BYTES_MAX);
        // SAFETY: the slot was produced and is not consumed yet.
        unsafe {
            std::ptr::copy_nonoverlapping(self.memory.slot(self.consumed), message.as_mut_ptr(), message.len());
        }
        self.consumed += 1;
        self.memory.consumed.0.store(self.consumed, ordering);
        true
    }

    /// Wakes a sender that waits for room. The last `pop` was by SeqCst.
    pub fn tell_room(&self) {
        self.memory.room.ring();
    }
}

/// One side of a ring that never sleeps.
pub struct BareRing<T>(T);

impl<'a> BareRing<RingSender<'a>> {
    /// The one sender.
    pub fn sender(shared: &'a SharedRing) -> Self {
        Self(RingSender::new(&shared.ring))
    }
}

impl<'a> BareRing<RingReceiver<'a>> {
    /// The one receiver.
    pub fn receiver(shared: &'a SharedRing) -> Self {
        Self(RingReceiver::new(&shared.ring))
    }
}

impl Sink for BareRing<RingSender<'_>> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        while !self.0.has_room(Ordering::Acquire) {}
        self.0.push(message, Ordering::Release);
        Ok(())
    }
}

impl Source for BareRing<RingReceiver<'_>> {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        while !self.0.pop(message, Ordering::Release) {}
        Ok(())
    }
}

/// One side of a ring that sleeps: the receiver when it is empty, the sender when it is full.
pub struct Futex<'a, T> {
    side: T,
    bell: &'a Bell,
}

impl<'a> Futex<'a, RingSender<'a>> {
    /// The one sender.
    pub fn sender(shared: &'a SharedRing) -> Self {
        Self { side: RingSender::new(&shared.ring), bell: &shared.bell }
    }
}

impl<'a> Futex<'a, RingReceiver<'a>> {
    /// The one receiver.
    pub fn receiver(shared: &'a SharedRing) -> Self {
        Self { side: RingReceiver::new(&shared.ring), bell: &shared.bell }
    }
}

impl Sink for Futex<'_, RingSender<'_>> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.side.await_room();
        self.side.push(message, Ordering::SeqCst);
        self.bell.ring();
        Ok(())
    }
}

impl Source for Futex<'_, RingReceiver<'_>> {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        while !self.side.pop(message, Ordering::SeqCst) {
            self.bell.sleep_unless(|| self.side.may_have());
        }
        self.side.tell_room();
        Ok(())
    }
}
