//! What the computer gives at best: bare shared memory, and the kernel's own queue.

mod queue;
pub mod ring;
mod slot_core;
mod two_rings;
pub mod vyukov;

pub use queue::{Queue, QueueSink};
pub use slot_core::{SlotMemory, SlotReceiver, SlotSender};
pub use two_rings::{TwoRings, TwoRingsReceiver, TwoRingsSender};
