//! Other systems that do a part of what mailboxes do, by their own public interfaces.

mod channel;
mod iceoryx;
mod iceoryx_one_way;

pub use channel::{Channel, pair};
pub use iceoryx::{Iceoryx, Waits};
pub use iceoryx_one_way::{IceoryxReceiver, IceoryxSender};
