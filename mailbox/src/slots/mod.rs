//! The slot core: how senders and one receiver share the slots of a mailbox, with atomics alone.
//!
//! Reading order: `word`, `protocol`, `hot` are the protocol, `bodies` says where the bytes lie. `queue`: what the
//! receiver knows. `full`, `latest`: what happens without a free slot, and what replaces what. Nothing here maps memory
//! or asks the kernel.

pub(crate) mod bodies;
pub(crate) mod full;
pub(crate) mod hot;
pub(crate) mod latest;
pub(crate) mod protocol;
pub(crate) mod queue;
pub(crate) mod word;
