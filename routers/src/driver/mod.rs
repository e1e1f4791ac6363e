//! The whole logic of the threads that send, receive and keep time, without thread, clock, mailbox and socket.
//!
//! ```text
//!            platform: clocks, mailbox, sockets                  driver: when to wake, what to take, make, hand over
//!  shell ──▶ real ones, one thread: poll, sleep, poll …     ──▶  the same code
//!  sim   ──▶ virtual ones, events: poll, plan a wake-up …   ──▶
//! ```
//!
//! [`SlotDriver`] sends in time slots, parts of replicas too. Without them [`FreeDriver`] sends what is real time,
//! and [`ReplicaDriver`] parts of replicas; a thread of the shell sends the rest. [`RxDriver`] receives, and
//! [`ClockDriver`] keeps time.
//!
//! They are compiled for each platform, and take nothing from the heap once they run.

mod answer;
mod answer_queue;
mod clock;
mod cpu_budget;
mod free;
mod held;
mod log;
mod outlet;
mod parts;
mod platform;
mod replicas;
mod rx;
mod slots;
#[cfg(test)]
mod tests;
mod time_platform;
mod timing;

pub use answer::{ANSWER_BYTES, ANSWERS, Answer};
pub use clock::{ClockDriver, ClockStep, TimeStart};
pub use free::{FreeDriver, FreeStep, Inlet, Wakes};
pub use held::HELD_NS_MAX;
pub use log::{Used, WINDOWS, WindowLog};
pub(crate) use outlet::Transmitter;
pub use outlet::{Handover, Outlet, OutletStep};
pub use parts::part_for_slot;
pub use platform::{NotSent, Platform, SlotEvent};
pub use replicas::{ReplicaDriver, part_queue};
pub use rx::{RxDriver, RxPlatform};
pub use slots::SlotDriver;
pub use time_platform::{TIME_DATAGRAM_BYTES, TimeArrival, TimeEvent, TimeInput, TimePlatform, TimeSource};
pub use timing::{SlotStep, spin_ns};
