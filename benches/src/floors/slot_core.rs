//! The least that slots with priorities cost: a sender claims a slot, writes, publishes and hints; the receiver takes
//! the most important, then earliest. What a mailbox does besides is what it costs more.
//!
//! There is no clock, head, counter or table of traffic, nothing replaces or displaces, and no death is survived: words
//! are published and freed by plain stores. The receiver looks again and again; the flag of one that sleeps is read by
//! senders, as a queue must that wakes, and never set.

use super::ring::CacheLine;
use crate::one_way::{Sink, Source};
use rohrpost_bench_local::harness::{Failure, Zeroable};
use std::cell::UnsafeCell;
use std::collections::BinaryHeap;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

const SLOTS: usize = 64;
/// Largest message.
const BYTES_MAX: usize = 65_536;
const FREE: u64 = 0;
const FILLING: u64 = 1;
/// Words of ready slots are greater. Below it are the priority, and how long before the end of time it was sent: the
/// greatest word goes first.
const READY: u64 = 1 << 63;
const PRIORITY: u32 = 55;
const TICKET: u64 = (1 << PRIORITY) - 1;

/// A word of a slot, and the rest of its cache line.
#[repr(C, align(64))]
struct SlotWord(AtomicU64);

/// The memory of one direction; zeroes are free slots.
#[repr(C)]
pub struct SlotMemory {
    words: [SlotWord; SLOTS],
    ready: CacheLine<AtomicU64>,
    receiver: CacheLine<ReceiverWords>,
    alert: CacheLine<AtomicU32>,
    bodies: CacheLine<UnsafeCell<[u8; SLOTS * BYTES_MAX]>>,
}

/// What the receiver says.
#[repr(C)]
struct ReceiverWords {
    sleeping: AtomicU32,
    /// Senders of something above this alert.
    level: AtomicU32,
}

// SAFETY: a slot's bytes are of the one that claimed its word until it is ready, and then of the receiver until it is
// free.
unsafe impl Sync for SlotMemory {}
// SAFETY: atomics and an `UnsafeCell` of bytes.
unsafe impl Zeroable for SlotMemory {}

impl SlotMemory {
    fn body(&self, slot: usize, stride: usize) -> *mut u8 {
        // SAFETY: inside the bodies: the stride is at most `BYTES_MAX`.
        unsafe { self.bodies.0.get().cast::<u8>().add(slot * stride) }
    }
}

/// A sender.
pub struct SlotSender<'a> {
    memory: &'a SlotMemory,
    stride: usize,
    next: usize,
    ticket: u64,
    priority: u8,
}

impl<'a> SlotSender<'a> {
    /// For messages of this many bytes.
    pub fn new(memory: &'a SlotMemory, bytes: usize, priority: u8) -> Self {
        Self { memory, stride: bytes.next_multiple_of(64).min(BYTES_MAX), next: 0, ticket: 0, priority }
    }

    fn claim(&mut self) -> usize {
        loop {
            let slot = self.next;
            self.next = (slot + 1) % SLOTS;
            let word = &self.memory.words[slot].0;
            if word.compare_exchange(FREE, FILLING, Ordering::Acquire, Ordering::Relaxed).is_ok() {
                return slot;
            }
        }
    }

    fn publish(&mut self, slot: usize) {
        let memory = self.memory;
        // Numbers of one sender rise, those of several are as the time.
        self.ticket = (self.ticket + 1).max(ticks());
        let word = READY | u64::from(self.priority) << PRIORITY | (TICKET - self.ticket);
        memory.words[slot].0.store(word, Ordering::Release);
        memory.ready.0.fetch_or(1 << slot, Ordering::SeqCst);
        let receiver = &memory.receiver.0;
        assert_eq!(receiver.sleeping.load(Ordering::SeqCst), 0, "the receiver never sleeps");
        if u32::from(self.priority) > receiver.level.load(Ordering::SeqCst) {
            memory.alert.0.store(1, Ordering::Release);
        }
        prefetch_to_write(&raw const memory.words[self.next]);
        prefetch_to_write(memory.body(self.next, self.stride));
    }
}

/// The receiver.
pub struct SlotReceiver<'a> {
    memory: &'a SlotMemory,
    stride: usize,
    /// Known ready slots, the greatest word first.
    heap: BinaryHeap<(u64, usize)>,
    level: u32,
}

impl<'a> SlotReceiver<'a> {
    /// The one receiver, of messages of this many bytes.
    pub fn new(memory: &'a SlotMemory, bytes: usize) -> Self {
        let stride = bytes.next_multiple_of(64).min(BYTES_MAX);
        Self { memory, stride, heap: BinaryHeap::with_capacity(SLOTS), level: 0 }
    }

    fn look(&mut self) {
        let mut hints = match self.memory.ready.0.load(Ordering::Relaxed) {
            0 => 0,
            _ => self.memory.ready.0.swap(0, Ordering::AcqRel),
        };
        while hints != 0 {
            let slot = hints.trailing_zeros() as usize;
            hints &= hints - 1;
            let word = self.memory.words[slot].0.load(Ordering::Acquire);
            if word & READY != 0 {
                self.heap.push((word, slot));
            }
        }
    }

    /// Priority of the first that is known.
    fn first(&self) -> Option<u32> {
        self.heap.peek().map(|(word, _)| ((word & !READY) >> PRIORITY) as u32)
    }

    /// The most important slot; looks at the hints if it may not be the first that is known.
    fn take(&mut self) -> Option<usize> {
        let alerted = self.memory.alert.0.load(Ordering::Acquire) != 0;
        if alerted || self.first() != Some(self.level) {
            if alerted {
                self.memory.alert.0.swap(0, Ordering::AcqRel);
            }
            self.look();
            let first = self.first()?;
            if first != self.level {
                self.level = first;
                self.memory.receiver.0.level.store(first, Ordering::SeqCst);
                // ORDERING: the level before the second look: a sender that read the old one is seen by it.
                fence(Ordering::SeqCst);
                self.look();
            }
        }
        self.heap.pop().map(|(_, slot)| slot)
    }
}

impl Sink for SlotSender<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        assert!(message.len() <= self.stride, "larger than a slot");
        let slot = self.claim();
        // SAFETY: claimed, and the message fits.
        unsafe {
            std::ptr::copy_nonoverlapping(message.as_ptr(), self.memory.body(slot, self.stride), message.len());
        }
        self.publish(slot);
        Ok(())
    }
}

impl Source for SlotReceiver<'_> {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let slot = loop {
            if let Some(slot) = self.take() {
                break slot;
            }
        };
        assert!(message.len() <= self.stride, "larger than a slot");
        // SAFETY: ready, so the receiver's, and the slot is at least as large.
        unsafe {
            std::ptr::copy_nonoverlapping(self.memory.body(slot, self.stride), message.as_mut_ptr(), message.len())
        };
        self.memory.words[slot].0.store(FREE, Ordering::Release);
        Ok(())
    }
}

/// A clock without a unit, the same for all processors.
fn ticks() -> u64 {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: any x86-64 has it; it touches no memory.
    let ticks = unsafe { std::arch::x86_64::_rdtsc() };
    #[cfg(not(target_arch = "x86_64"))]
    let ticks = rohrpost_mailbox::monotonic_ns();
    ticks
}

fn prefetch_to_write<T>(at: *const T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: the instruction never faults and writes nothing.
    unsafe {
        std::arch::asm!("prefetchw [{0}]", in(reg) at, options(nostack, preserves_flags, readonly));
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}
