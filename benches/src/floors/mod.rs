//! What the computer gives at best: bare shared memory, and the kernel's own queue.

mod hand_over;

pub use hand_over::{HandOver, Lanes, Wake};
