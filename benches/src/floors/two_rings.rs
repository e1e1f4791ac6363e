//! A ring for each of two priorities, the urgent one looked at first, and one word to sleep on: the least that gets
//! something urgent past a flood. It has exactly two priorities, and one sender for each.

use super::ring::{Bell, RingMemory, RingReceiver, RingSender};
use crate::one_way::{Sink, Source};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::Zeroable;
use std::sync::atomic::Ordering;

/// Both rings' memory.
#[repr(C)]
pub struct TwoRings {
    urgent: RingMemory,
    ordinary: RingMemory,
    bell: Bell,
}

// SAFETY: made of such.
unsafe impl Zeroable for TwoRings {}

/// The sender of one priority.
pub struct TwoRingsSender<'a> {
    side: RingSender<'a>,
    bell: &'a Bell,
}

impl<'a> TwoRingsSender<'a> {
    /// The one sender of its priority.
    pub fn new(rings: &'a TwoRings, urgent: bool) -> Self {
        let ring = if urgent { &rings.urgent } else { &rings.ordinary };
        Self { side: RingSender::new(ring), bell: &rings.bell }
    }
}

impl Sink for TwoRingsSender<'_> {
    fn send(&mut self, message: &[u8]) -> Result<(), Failure> {
        self.side.await_room();
        self.side.push(message, Ordering::SeqCst);
        self.bell.ring();
        Ok(())
    }
}

/// The receiver of both.
pub struct TwoRingsReceiver<'a> {
    /// The urgent one first.
    sides: [RingReceiver<'a>; 2],
    bell: &'a Bell,
}

impl<'a> TwoRingsReceiver<'a> {
    /// The one receiver.
    pub fn new(rings: &'a TwoRings) -> Self {
        Self { sides: [&rings.urgent, &rings.ordinary].map(RingReceiver::new), bell: &rings.bell }
    }
}

impl Source for TwoRingsReceiver<'_> {
    fn receive(&mut self, message: &mut [u8]) -> Result<(), Failure> {
        loop {
            for side in &mut self.sides {
                if side.pop(message, Ordering::SeqCst) {
                    side.tell_room();
                    return Ok(());
                }
            }
            self.bell.sleep_unless(|| self.sides.iter().any(RingReceiver::may_have));
        }
    }
}
