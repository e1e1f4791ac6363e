//! The open records of a replica, of one life, by their sequence, the oldest first. Their room is there from the start.

use super::super::gathering::Gathering;
use super::super::settings::ReplicaSettings;
use std::ops::{Deref, DerefMut};

pub(super) struct OpenRecords {
    /// The first of them are open.
    places: Box<[Gathering]>,
    len: usize,
}

impl OpenRecords {
    pub(super) fn new(replica: &ReplicaSettings, part_bytes: usize) -> Self {
        let places = (0..replica.shape.begun_max()).map(|_| Gathering::new(replica, part_bytes)).collect();
        Self { places, len: 0 }
    }

    /// Whether one more may be open.
    pub(super) fn has_room(&self) -> bool {
        self.len < self.places.len()
    }

    /// A place for a record of this sequence, which the caller opens; there must be room.
    pub(super) fn insert(&mut self, sequence: u64) -> &mut Gathering {
        let at = self.partition_point(|open| open.sequence < sequence);
        self.len += 1;
        self.places[at..self.len].rotate_right(1);
        &mut self.places[at]
    }

    /// Closes the oldest one, and says what it was.
    pub(super) fn pop_oldest(&mut self) -> Option<&Gathering> {
        let last = self.len.checked_sub(1)?;
        self.places[0].close();
        self.places[..self.len].rotate_left(1);
        self.len = last;
        Some(&self.places[last])
    }
}

impl Deref for OpenRecords {
    type Target = [Gathering];

    fn deref(&self) -> &[Gathering] {
        &self.places[..self.len]
    }
}

impl DerefMut for OpenRecords {
    fn deref_mut(&mut self) -> &mut [Gathering] {
        &mut self.places[..self.len]
    }
}
