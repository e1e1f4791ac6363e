//! Sends in time slots: the whole logic of the thread that does, without thread, clock, mailbox and socket.
//!
//! ```text
//!            Platform: clocks, mailbox, sockets, Clock             SlotDriver: when to wake, take, make, hand over
//!  shell ──▶ real ones, one thread: poll, sleep, poll …     ──▶    the same code
//!  sim   ──▶ virtual ones, events: poll, plan a wake-up …   ──▶
//! ```
//!
//! It is compiled for each platform, and takes nothing from the heap once it runs.

mod held;
mod log;
mod platform;
mod slots;
mod timing;

pub use held::HELD_NS_MAX;
pub use log::{Used, WINDOWS, WindowLog};
pub use platform::{NotSent, Platform, SlotEvent};
pub use slots::{SlotDriver, SlotStep};
pub use timing::spin_ns;
