//! Each mistake: what it does wrong, how the routers' sources change for it, and where it shows.

mod carrying;
mod lan;
mod line;
pub mod planted;
mod rejecting;
mod replicas;
mod session;
mod slots;
mod time;

use planted::{Group, Planted};

/// All mistakes.
pub const GROUPS: &[Group] = &[
    carrying::CARRYING,
    lan::ADMISSION,
    lan::CROWDED,
    lan::FORGED,
    lan::LAN,
    line::LINE,
    rejecting::REJECTING,
    replicas::REPLICAS,
    replicas::RECORDS,
    session::SESSION,
    slots::IN_SLOT,
    slots::SLOTS,
    slots::JOINING,
    slots::UNPROVEN,
    slots::UNSTEADY,
    slots::TABLES,
    time::TIME,
    time::FOLLOWER,
];

/// Each of them.
pub fn all() -> impl Iterator<Item = &'static Planted> {
    GROUPS.iter().flat_map(|group| group.mistakes)
}
