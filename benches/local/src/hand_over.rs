//! One slot of shared memory in each direction, copied in and out; the receiver spins, or sleeps on a futex.

use crate::harness::{End, Failure, Link, Shared, Zeroable};
use std::cell::UnsafeCell;
use std::ptr;
use std::sync::atomic::{AtomicU32, Ordering};

/// Largest message.
const BYTES_MAX: usize = 65_536;

/// How the receiver learns of a message.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Wake {
    /// It looks again and again.
    Spin,
    /// It sleeps; each message wakes it by a system call.
    Futex,
}

/// One direction: the number of the newest message, then the message. Its own cache lines.
#[repr(C, align(64))]
struct Lane {
    newest: AtomicU32,
    _line: [AtomicU32; 15],
    message: UnsafeCell<[u8; BYTES_MAX]>,
}

// SAFETY: one end writes the message while the other waits for `newest`: in ping-pong they never both touch it.
unsafe impl Sync for Lane {}

/// Both directions.
#[repr(C)]
pub struct Lanes([Lane; 2]);

// SAFETY: atomics and bytes in an UnsafeCell.
unsafe impl Zeroable for Lanes {}

/// One end of it.
pub struct HandOver<'a> {
    out: &'a Lane,
    sent: u32,
    back: &'a Lane,
    received: u32,
    wake: Wake,
}

impl<'a> HandOver<'a> {
    /// Opens an end.
    pub fn new(lanes: &'a Shared<Lanes>, end: End, wake: Wake) -> Self {
        let [there, back] = &lanes.0;
        let (out, back) = if end == End::Ping { (there, back) } else { (back, there) };
        Self { out, sent: 0, back, received: 0, wake }
    }
}

impl Link for HandOver<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        assert!(message.len() <= BYTES_MAX, "larger than the lane");
        // SAFETY: it fits; the other end reads it only after `newest` has changed, and answers before the next one.
        unsafe { ptr::copy_nonoverlapping(message.as_ptr(), self.out.message.get().cast(), message.len()) };
        self.sent = self.sent.wrapping_add(1);
        // ORDERING: publishes the message; pairs with the load in `receive`.
        self.out.newest.store(self.sent, Ordering::Release);
        if self.wake == Wake::Futex {
            futex(&self.out.newest, libc::FUTEX_WAKE, 1);
        }
        Ok(())
    }

    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        assert!(message.len() <= BYTES_MAX, "larger than the lane");
        while self.back.newest.load(Ordering::Acquire) == self.received {
            match self.wake {
                Wake::Spin => std::hint::spin_loop(),
                Wake::Futex => futex(&self.back.newest, libc::FUTEX_WAIT, self.received),
            }
        }
        self.received = self.received.wrapping_add(1);
        // SAFETY: it fits; the other end writes the next one only after our answer.
        unsafe { ptr::copy_nonoverlapping(self.back.message.get().cast(), message.as_mut_ptr(), message.len()) };
        Ok(())
    }
}

/// Sleeps while the word has this value, or wakes so many sleepers. Both are looked at again by the caller.
fn futex(word: &AtomicU32, operation: libc::c_int, value: u32) {
    // SAFETY: the word outlives the call; no timeout, no second word.
    unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), operation, value, ptr::null::<libc::timespec>()) };
}
