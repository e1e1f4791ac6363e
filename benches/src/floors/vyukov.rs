//! Vyukov's bounded queue for any number of senders: a sender takes a number, and each slot shows the number that has
//! its turn.
//!
//! [`Vyukov`] never wakes anybody. A queue with a sleeping receiver needs a fence after each message and a check
//! whether it sleeps; with `FENCED` that is done too, though here the receiver never sleeps. It has no priorities. A
//! sender that dies with a number blocks it for ever.

use super::ring::{BYTES_MAX, CacheLine, DEPTH};
use crate::one_way::{Sink, Source};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::Zeroable;
use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

/// Bytes of a slot's number, in front of the message.
const TURN_BYTES: usize = size_of::<AtomicU64>();

/// The queue's memory.
#[repr(C)]
pub struct QueueMemory {
    next: CacheLine<AtomicU64>,
    sleeping: CacheLine<AtomicU32>,
    /// Each slot's number, and the message behind it; how far apart they are depends on the message.
    slots: CacheLine<UnsafeCell<[u8; DEPTH * (BYTES_MAX + 128)]>>,
}

// SAFETY: a slot's bytes belong to the sender of the slot's number, or to the receiver when the number is one more.
unsafe impl Sync for QueueMemory {}
// SAFETY: atomics and an `UnsafeCell` of bytes; zeroes are made a queue by `Vyukov::format`.
unsafe impl Zeroable for QueueMemory {}

/// Either side.
pub struct Vyukov<'a, const FENCED: bool> {
    memory: &'a QueueMemory,
    /// Bytes from one slot to the next.
    stride: usize,
    /// The receiver's own.
    received: u64,
}

impl<'a, const FENCED: bool> Vyukov<'a, FENCED> {
    /// Messages of this size; all sides must say the same.
    pub fn new(memory: &'a QueueMemory, bytes: usize) -> Self {
        Self { memory, stride: (TURN_BYTES + bytes).next_multiple_of(64), received: 0 }
    }

    /// Makes it an empty queue. Call it before any other use.
    pub fn format(&self) {
        (0..DEPTH as u64).for_each(|number| self.turn(number).store(number, Ordering::Release));
    }

    fn slot(&self, number: u64) -> *mut u8 {
        let at = number as usize % DEPTH * self.stride;
        // SAFETY: inside the slots, for messages up to `BYTES_MAX`.
        unsafe { self.memory.slots.0.get().cast::<u8>().add(at) }
    }

    fn turn(&self, number: u64) -> &AtomicU64 {
        // SAFETY: aligned (slots are multiples of 64 B apart), and these bytes are only used as this atomic.
        unsafe { AtomicU64::from_ptr(self.slot(number).cast()) }
    }

    fn take_number(&self) -> u64 {
        let mut number = self.memory.next.0.load(Ordering::Relaxed);
        loop {
            if self.turn(number).load(Ordering::Acquire) != number {
                number = self.memory.next.0.load(Ordering::Relaxed);
                continue;
            }
            let next = &self.memory.next.0;
            match next.compare_exchange_weak(number, number + 1, Ordering::Relaxed, Ordering::Relaxed) {
                Ok(_) => return number,
                Err(other) => number = other,
            }
        }
    }
}

impl<const FENCED: bool> Sink for Vyukov<'_, FENCED> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        let number = self.take_number();
        // SAFETY: the number is ours, and so is the slot until its turn is the receiver's.
        unsafe { std::ptr::copy_nonoverlapping(message.as_ptr(), self.slot(number).add(TURN_BYTES), message.len()) };
        self.turn(number).store(number + 1, Ordering::Release);
        if FENCED {
            // ORDERING: as in a queue that wakes: the message before the check for a sleeping receiver.
            fence(Ordering::SeqCst);
            if self.memory.sleeping.0.load(Ordering::Relaxed) != 0 {
                return Err(Failure::Failed("the queue's receiver sleeps, which it never does".into()));
            }
        }
        Ok(())
    }
}

impl<const FENCED: bool> Source for Vyukov<'_, FENCED> {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        let number = self.received;
        while self.turn(number).load(Ordering::Acquire) != number + 1 {}
        // SAFETY: the slot's turn is ours.
        unsafe {
            std::ptr::copy_nonoverlapping(self.slot(number).add(TURN_BYTES), message.as_mut_ptr(), message.len())
        };
        self.turn(number).store(number + DEPTH as u64, Ordering::Release);
        self.received += 1;
        Ok(())
    }
}
