//! Other systems that do a part of what mailboxes do, by their own public interfaces.

mod channel;
mod iceoryx;

pub use channel::{Channel, pair};
pub use iceoryx::{Iceoryx, Waits};
