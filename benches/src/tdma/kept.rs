//! How well slots were kept: the captured frames compared with the table by the master's time.

use super::capture::{Crossed, FrameKind};
use super::stage::NODES;
use rohrpost_bench_local::statistics::median;
use rohrpost_mailbox::TimeRecord;
use rohrpost_routers::tdma::{SlotTable, Window, WindowKind};

/// What became of the frames of some cycles.
#[derive(Clone, Default, Debug)]
pub struct Kept {
    /// Offset of each slot's first frame from the slot's beginning, µs; in its window minus the median of its node.
    pub off_us: Vec<f64>,
    /// Frames, including synchronisation and other messages between routers.
    pub frames: usize,
    /// Of these, outside any window of their sender.
    pub outside: usize,
    /// Of those outside, in another's window.
    pub in_anothers: usize,
    /// How far into the guard of its slot the latest frame began, µs; 0 if none did.
    pub into_guard_us: f64,
}

impl Kept {
    /// A frame is its sender's if it begins in a window of the sender or in the guard behind, or so little before that
    /// the guard of the slot before still covers it. Any other is outside. Its offset is that from the nearest slot of
    /// its sender, if it could be the first of that. `tables`: as each node reads them.
    pub fn of(frames: &[Crossed], tables: &[SlotTable], time: &TimeRecord) -> Self {
        let mut kept = Self { frames: frames.len(), ..Self::default() };
        let mut nodes: [Sender; NODES as usize] = Default::default();
        for frame in frames {
            let from = usize::from(frame.from);
            let (Some(table), Some(node)) = (tables.get(from), nodes.get_mut(from)) else {
                kept.outside += 1;
                continue;
            };
            let at_ns = time.at(frame.at_ns).ns;
            let owners = [at_ns, at_ns + table.allowance_ns()].map(|ns| table.owner(ns));
            if let Some(owner) = owners.into_iter().flatten().find(|owner| owner.node == frame.from) {
                kept.into_guard_us = kept.into_guard_us.max(at_ns.saturating_sub(owner.window.end_ns) as f64 / 1000.0);
                let start_us = node.first_in(owner.window, at_ns);
                node.starts_us.extend(start_us);
            } else {
                kept.outside += 1;
                kept.in_anothers += usize::from(owners[0].is_some());
                let nearest =
                    nearest_slot(table, at_ns).filter(|_| matches!(frame.what, FrameKind::Packages | FrameKind::Said));
                kept.off_us.extend(nearest.and_then(|window| node.first_in(window, at_ns)).map(f64::abs));
            }
        }
        for Sender { starts_us, .. } in nodes {
            let middle_us = median(starts_us.iter().copied()).unwrap_or_default();
            kept.off_us.extend(starts_us.into_iter().map(|start_us| (start_us - middle_us).abs()));
        }
        kept
    }

    /// Slots with a first frame further off than this.
    pub fn further_off(&self, than_us: f64) -> usize {
        self.off_us.iter().filter(|off_us| **off_us > than_us).count()
    }
}

/// State of a node while frames are examined.
#[derive(Default)]
struct Sender {
    /// Of the first frame of each of its slots: how long after the beginning, µs.
    starts_us: Vec<f64>,
    /// Where its last frame belonged.
    last: Option<Window>,
}

impl Sender {
    /// Offset of a frame from the beginning of its slot, µs; negative if before. None if it is not the first, or is in
    /// no slot.
    fn first_in(&mut self, window: Window, at_ns: u64) -> Option<f64> {
        let is_first = self.last.replace(window) != Some(window) && matches!(window.kind, WindowKind::Slot { .. });
        is_first.then(|| at_ns.wrapping_sub(window.begin_ns).cast_signed() as f64 / 1000.0)
    }
}

/// The slot of a table's node that begins closest to a moment; it has one in each cycle.
fn nearest_slot(table: &SlotTable, at_ns: u64) -> Option<Window> {
    let around = [at_ns.saturating_sub(table.cycle_ns()), at_ns].map(|from_ns| table.next_slot(from_ns));
    around.into_iter().flatten().min_by_key(|slot| slot.begin_ns.abs_diff(at_ns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::tdma::plans;
    use rohrpost_mailbox::TimeSource;

    /// System time and the monotonic clock are one.
    const TIME: TimeRecord = TimeRecord {
        epoch: 1,
        source: TimeSource::Master,
        monotonic_ns: 0,
        system_ns: 0,
        pace_ppb: 1_000_000_000,
        error_ns: 0,
        drift_ns_s: 0,
    };

    fn frames(all: &[(u8, u64)]) -> Vec<Crossed> {
        all.iter()
            .map(|(from, at_us)| Crossed { at_ns: at_us * 1000, from: *from, what: FrameKind::Packages })
            .collect()
    }

    #[test]
    fn first_frames_count_and_what_is_in_anothers_slot_is_told() {
        // Two windows of 500 us, then slots of 430 us, 150 of which are guard; a cycle is 5 ms.
        let tables = plans::LOADED.tables().unwrap();
        let cycles = [(0, 1_010), (0, 1_130), (1, 1_440), (0, 6_012), (1, 6_440), (0, 11_310), (1, 11_440)];
        let kept = Kept::of(&frames(&cycles), &tables, &TIME);
        // Of node 0: 10, 12 and 310 us late, so 2, 0 and 298 us off the median.
        let mut off_us = kept.off_us.clone();
        off_us.sort_unstable_by(f64::total_cmp);
        assert_eq!(off_us, [0.0, 0.0, 0.0, 0.0, 2.0, 298.0]);
        assert_eq!((kept.frames, kept.outside, kept.in_anothers, kept.further_off(250.0)), (7, 0, 0, 1));
        assert_eq!(kept.into_guard_us, 30.0, "310 us after the beginning of 280 us");
        // 80 us before its slot is in another's slot; 70 us are in the guard and allowed.
        let strangers = Kept::of(&frames(&[(1, 1_350), (1, 1_360), (2, 1_010), (2, 4_000)]), &tables, &TIME);
        assert_eq!((strangers.outside, strangers.in_anothers), (3, 2));
        // Node 2's slot is at 1860 us, and has one first frame.
        assert_eq!(strangers.off_us, [80.0, 850.0]);
    }

    #[test]
    fn what_is_in_nobodys_time_is_far_off_and_its_slot_has_no_other_first_frame() {
        let tables = plans::LOADED.tables().unwrap();
        // Behind the last slot, which ends at 2290 us: 1000 us and more behind node 2's beginning; and before the next
        // cycle's.
        let late = Kept::of(&frames(&[(2, 2_860), (2, 2_900), (2, 6_400), (2, 6_860)]), &tables, &TIME);
        assert_eq!((late.outside, late.in_anothers), (3, 1));
        assert_eq!(late.off_us, [1_000.0, 460.0]);
        // A frame in no slot only counts as outside.
        let sync = [Crossed { what: FrameKind::Sync, ..frames(&[(0, 3_000)])[0] }];
        let sync = Kept::of(&sync, &tables, &TIME);
        assert_eq!((sync.outside, sync.off_us.len()), (1, 0));
    }
}
