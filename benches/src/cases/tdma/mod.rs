//! Time slots: how well they are kept, how well time is, what happens when the master dies, and whether bounds hold.

mod brisk;
mod clock;
mod contest;
mod goals;
mod observed;
mod pitch;
pub mod plans;
mod slots;

use super::Case;

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Box<dyn Case>> {
    [slots::cases(), brisk::cases(), pitch::cases(), clock::cases()].into_iter().flatten().collect()
}
