//! Time slots: how well they are kept, how well time is, what happens when the master dies, and whether bounds hold.

mod brisk;
mod clock;
mod contest;
mod flows;
mod goals;
mod junk;
mod observed;
mod pitch;
pub mod plans;
mod slots;
mod takeover;

use super::Case;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Box<dyn Case>> {
    [slots::cases(), brisk::cases(), pitch::cases(), clock::cases(), takeover::cases(), flows::cases(), junk::cases()]
        .into_iter()
        .flatten()
        .collect()
}
