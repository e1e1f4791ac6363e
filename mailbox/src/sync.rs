//! The atomics that the slot core is written with: the processor's, or loom's when the model checker compiles this
//! very source (see `mailbox/proof/loom`).

pub(crate) use core::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};
