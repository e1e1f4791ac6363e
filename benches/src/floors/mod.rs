//! What the computer gives at best: bare shared memory, the kernel's own queue, and a search in C++.

mod queue;
pub mod ring;
mod slot_core;
mod two_rings;
pub mod vyukov;
mod wave;

pub use queue::{Queue, QueueSink};
pub use slot_core::{SlotMemory, SlotReceiver, SlotSender};
pub use two_rings::{TwoRings, TwoRingsReceiver, TwoRingsSender};
pub use wave::WaveFloor;
