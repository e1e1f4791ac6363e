//! How slots were kept: what the capture saw, held against the table by the master's time.

use super::capture::Crossed;
use super::stage::NODES;
use crate::statistics::median;
use rohrpost_mailbox::TimeRecord;
use rohrpost_routers::tdma::{Kind, Owner, Table};

/// What became of the frames of some cycles.
#[derive(Clone, Default, Debug)]
pub struct Kept {
    /// Of each slot's first frame: how long after the beginning, less the median of its node, µs; never less than 0.
    pub off_us: Vec<f64>,
    /// Frames, those of synchronisation and what routers say to each other included.
    pub frames: usize,
    /// Of these, in another's window.
    pub in_anothers: usize,
    /// How far into the guard of its slot the latest frame began, µs; 0 if none did.
    pub into_guard_us: f64,
}

impl Kept {
    /// A frame is its sender's if it begins in a window of it or in the guard behind, or so little before that the guard of who was there
    /// before still holds.
    pub fn of(frames: &[Crossed], table: &Table, time: &TimeRecord) -> Self {
        let mut kept = Self { frames: frames.len(), ..Self::default() };
        let mut starts_us: [Vec<f64>; NODES as usize] = Default::default();
        let mut last = None;
        for frame in frames {
            let at_ns = time.at(frame.at_ns).ns;
            let owners = [at_ns, at_ns + table.allowance_ns()].map(|ns| table.owner(ns));
            let Some(Owner { window, .. }) = owners.into_iter().flatten().find(|owner| owner.node == frame.from) else {
                kept.in_anothers += usize::from(owners[0].is_some());
                continue;
            };
            kept.into_guard_us = kept.into_guard_us.max(at_ns.saturating_sub(window.end_ns) as f64 / 1000.0);
            let is_first = last != Some((frame.from, window));
            last = Some((frame.from, window));
            if let (true, Kind::Slot { .. }, Some(starts_us)) =
                (is_first, window.kind, starts_us.get_mut(usize::from(frame.from)))
            {
                starts_us.push(at_ns.wrapping_sub(window.begin_ns).cast_signed() as f64 / 1000.0);
            }
        }
        for starts_us in starts_us {
            let middle_us = median(starts_us.iter().copied()).unwrap_or_default();
            kept.off_us.extend(starts_us.into_iter().map(|start_us| (start_us - middle_us).abs()));
        }
        kept
    }

    /// Slots whose first frame was further off than this.
    pub fn further_off(&self, than_us: f64) -> usize {
        self.off_us.iter().filter(|off_us| **off_us > than_us).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::tdma::plans;
    use crate::tdma::capture::What;
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
        all.iter().map(|(from, at_us)| Crossed { at_ns: at_us * 1000, from: *from, what: What::Packages }).collect()
    }

    #[test]
    fn first_frames_count_and_what_is_in_anothers_slot_is_told() {
        // Two windows of 500 us, then slots of 430 us, 150 of which are guard; a cycle is 5 ms.
        let table = plans::LOADED.table(0).unwrap();
        let cycles = [(0, 1_010), (0, 1_130), (1, 1_440), (0, 6_012), (1, 6_440), (0, 11_310), (1, 11_440)];
        let kept = Kept::of(&frames(&cycles), &table, &TIME);
        // Of node 0: 10, 12 and 310 us late, so 2, 0 and 298 us off the median.
        let mut off_us = kept.off_us.clone();
        off_us.sort_unstable_by(f64::total_cmp);
        assert_eq!(off_us, [0.0, 0.0, 0.0, 0.0, 2.0, 298.0]);
        assert_eq!((kept.frames, kept.in_anothers, kept.further_off(250.0)), (7, 0, 1));
        assert_eq!(kept.into_guard_us, 30.0, "310 us after the beginning of 280 us");
        // 80 us before its slot is in the slot of another, 70 us are in the guard and allowed for.
        let strangers = Kept::of(&frames(&[(1, 1_350), (1, 1_360), (2, 1_010), (2, 4_000)]), &table, &TIME);
        assert_eq!(strangers.in_anothers, 2);
    }
}
