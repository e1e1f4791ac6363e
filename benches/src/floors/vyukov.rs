//! Vyukov's bounded queue, which any number may send to: a sender takes a number, and each slot says whose turn it is.
//!
//! [`Vyukov`] never wakes anybody. A queue whose receiver may sleep has to fence after each message and to look whether it does;
//! with `FENCED` that is done too, though here the receiver never sleeps. It knows no priorities, and a sender that dies with a
//! number closes it for ever.

use super::ring::{BYTES_MAX, CacheLine, DEPTH};
use crate::Failure;
use crate::harness::Zeroable;
use crate::one_way::{Sink, Source};
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

// SAFETY: a slot's bytes belong to the sender whose number it shows, or to the receiver when that is one more.
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

    /// Makes it an empty queue. Before anybody else uses it.
    pub fn format(&self) {
        (0..DEPTH as u64).for_each(|number| self.turn(number).store(number, Ordering::Release));
    }

    fn slot(&self, number: u64) -> *mut u8 {
        let at = number as usize % DEPTH * self.stride;
        // SAFETY: inside the slots, for messages up to `BYTES_MAX`.
        unsafe { self.memory.slots.0.get().cast::<u8>().add(at) }
    }

    fn turn(&self, number: u64) -> &AtomicU64 {
        // SAFETY: aligned (slots are multiples of 64 B apart), and nobody reaches these bytes but as this atomic.
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
            // ORDERING: as a queue must that wakes: the message before the look at who sleeps.
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
