//! What is wrong with a file: all of it is counted, and the first of it is told. One chunk may have half a million
//! messages that are of no channel.

use crate::error::Damage;

/// So many damages are listed.
const LISTED_MAX: usize = 100;

/// Damages of one file.
#[derive(Default)]
pub(crate) struct Damages {
    /// Where, and what; the same at one place is listed once.
    pub(crate) listed: Vec<(u64, Damage)>,
    /// All of them.
    pub(crate) count: u64,
}

impl Damages {
    pub(crate) fn note(&mut self, at: u64, damage: Damage) {
        self.count += 1;
        let is_new = self.listed.last().is_none_or(|(place, last)| (*place, last) != (at, &damage));
        if is_new && self.listed.len() < LISTED_MAX {
            self.listed.push((at, damage));
        }
    }
}
