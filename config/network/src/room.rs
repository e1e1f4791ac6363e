//! Room in a slot table.

use crate::link::Link;
use crate::sizes::RATE_MAX_PER;
use crate::table::{LATE, Tdma, TimeSlot, common};
use std::time::Duration;

/// A joining node assumes that frames of time arrive within half of the guard: this part of it for the links, as much
/// for the computers. Its error is as much at most, in both directions.
pub const ARRIVES_WITHIN: u32 = 4;

/// Up to ten microseconds, as people write.
pub fn round_up(duration: Duration) -> Duration {
    Duration::from_micros(duration.as_nanos().div_ceil(10_000) as u64 * 10)
}

impl Tdma {
    /// Shortest slot: its guard, the routers' own messages, and a largest datagram.
    pub fn length_min(&self, link: &Link) -> Duration {
        round_up(self.guard + LATE + Duration::from_nanos(link.said_ns(self) + link.largest_ns()))
    }

    /// When the synchronisation windows end.
    pub fn windows_end(&self, masters: usize) -> Duration {
        self.synchronisation * masters as u32
    }

    /// Latest end of a slot. A joining node knows the time by a Sync alone: it may be off by a quarter of the guard,
    /// and by the drift of its clock since. Its error must stay within half of the guard until its slot ends, or it can
    /// never ask for more.
    pub fn joined_end_max(&self) -> Duration {
        self.guard * (RATE_MAX_PER / ARRIVES_WITHIN)
    }

    fn end_max(&self) -> Duration {
        self.cycle.min(self.joined_end_max())
    }

    /// The same table with another slot in place of one.
    pub fn with(&self, index: usize, slot: TimeSlot) -> Self {
        let mut tdma = self.clone();
        tdma.slots[index] = slot;
        tdma
    }

    /// The same table without one of its slots.
    pub fn without(&self, index: usize) -> Self {
        let mut tdma = self.clone();
        tdma.slots.remove(index);
        tdma
    }

    /// Slots that overlap, the one that begins first before the other.
    pub fn collisions(&self) -> Vec<(usize, usize)> {
        let slots = self.slots.iter().enumerate();
        let pairs = slots.flat_map(|(first, a)| {
            let later = self.slots.iter().enumerate().skip(first + 1);
            later.filter(|(_, b)| a.collides(b)).map(move |(second, _)| (first, second))
        });
        pairs.collect()
    }

    /// How long a slot may be, at most.
    pub fn free_behind(&self, slot: &TimeSlot) -> Duration {
        let next = self.slots.iter().filter(|next| next.offset > slot.offset && next.meets(slot));
        let end = next.map(|next| next.offset).chain([self.end_max()]).min().unwrap_or_default();
        end.saturating_sub(slot.offset)
    }

    /// Gaps that are free in every cycle: where each begins, and its length.
    pub fn gaps(&self, masters: usize) -> Vec<(Duration, Duration)> {
        let mut free_from = self.windows_end(masters);
        let mut gaps = Vec::new();
        let end_max = self.end_max();
        let ends = self.slots.iter().map(|slot| (slot.offset.min(end_max), slot.offset + slot.length));
        for (begin, end) in ends.chain([(end_max, end_max)]) {
            if begin > free_from {
                gaps.push((free_from, begin - free_from));
            }
            free_from = free_from.max(end);
        }
        gaps
    }

    /// Whether an additional slot is behind synchronisation, within the cycle, early enough for joining nodes, and
    /// without overlap.
    pub fn has_room(&self, slot: &TimeSlot, masters: usize) -> bool {
        let is_inside = slot.offset >= self.windows_end(masters) && slot.end() <= self.end_max();
        is_inside && !self.slots.iter().any(|other| other.collides(slot))
    }

    /// Where an additional slot has room, as near as possible to its wanted place: right behind another, or right
    /// before it.
    pub fn nearest_room(&self, slot: &TimeSlot, masters: usize) -> Option<Duration> {
        let behind = self.slots.iter().map(TimeSlot::end).chain([self.windows_end(masters)]);
        let before = self.slots.iter().map(|other| other.offset).chain([self.end_max()]);
        let before = before.filter_map(|begin| begin.checked_sub(slot.length));
        let has_room = |offset: &Duration| self.has_room(&TimeSlot { offset: *offset, ..*slot }, masters);
        behind.chain(before).filter(has_room).min_by_key(|offset| offset.abs_diff(slot.offset))
    }
}

impl TimeSlot {
    /// Where its guard ends.
    pub fn end(&self) -> Duration {
        self.offset + self.length
    }

    /// The same slot with another period.
    pub fn with_period(&self, period: u32) -> Self {
        Self { period, phase: self.phase % period, ..*self }
    }

    /// Whether there are cycles with both.
    fn meets(&self, other: &Self) -> bool {
        let apart = u64::from(self.phase.abs_diff(other.phase));
        apart.is_multiple_of(common(self.period.into(), other.period.into()))
    }

    /// Whether both overlap.
    pub fn collides(&self, other: &Self) -> bool {
        self.meets(other) && self.offset < other.end() && other.offset < self.end()
    }
}
