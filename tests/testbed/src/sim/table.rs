//! Tables for the books of a simulation: quick to hash.

use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};

pub(super) type Table<K, V> = HashMap<K, V, BuildHasherDefault<Mix>>;
pub(super) type Group<K> = HashSet<K, BuildHasherDefault<Mix>>;

/// Hashes what nobody chooses in order to do harm: numbers, a few at a time. The usual one takes a sixth of a
/// simulation's time.
#[derive(Default)]
pub(super) struct Mix(u64);

impl Hasher for Mix {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_u64((*byte).into()));
    }

    fn write_u8(&mut self, value: u8) {
        self.write_u64(value.into());
    }

    fn write_u16(&mut self, value: u16) {
        self.write_u64(value.into());
    }

    fn write_u32(&mut self, value: u32) {
        self.write_u64(value.into());
    }

    fn write_u64(&mut self, value: u64) {
        self.0 = (self.0.rotate_left(23) ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn write_i16(&mut self, value: i16) {
        self.write_u64(value.cast_unsigned().into());
    }

    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }
}
