//! What the computer gives at best: bare shared memory, and the kernel's own queue.

mod queue;
pub mod ring;
mod slot_core;
mod two_rings;
pub mod vyukov;

pub use queue::{Queue, QueueEnd, Queues};
pub use slot_core::{SlotEnd, SlotMemory, SlotPair, SlotReceiver, SlotSender};
pub use two_rings::{TwoRings, TwoRingsReceiver, TwoRingsSender};
