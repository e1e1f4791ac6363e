//! Small networks in which all goes wrong that can, so that a mistake shows soon.

use super::chance::Chance;
use super::fault::{Fault, Planned};
use super::link::Quality;
use super::plan::{CallPlan, Flow, Plan, Shape};
use super::spans::{DRAIN_NS, MS, RECOVERY_NS, S, US, WELL_NS};
use rohrpost_mailbox::local;

/// When all faults are over.
const FIXED_NS: u64 = 7 * S;
/// A frame that is late on one of the two ways only: the worst that may happen to clocks.
const SLOW: Quality = Quality { delay_ns: 8 * MS, reorder_ppm: 200_000, ..QUALITY };
/// Ten times as many wake-ups as usual are too late, of a million.
const LATE_PPM: u32 = 20_000;
const QUALITY: Quality = Quality {
    delay_ns: 50 * US,
    jitter_ns: 100 * US,
    loss_ppm: 20_000,
    copy_ppm: 20_000,
    reorder_ppm: 100_000,
    damage_ppm: 20_000,
    rate_bytes_s: 0,
};

impl Plan {
    /// Three nodes. The first is master until it dies; the third does not hear the second for longer than that stays
    /// unnoticed.
    pub fn rough(seed: u64) -> Self {
        let mut chance = Chance::new(seed);
        let mut plan = Self::small(seed);
        plan.nodes = (0..3).map(|index| super::plan::node(index, &mut chance)).collect();
        plan.shape = Shape {
            datagram_bytes_max: chance.pick(&[1472, 4000]),
            rate_bytes_s: chance.between(4, 12) << 20,
            interval_ns: 100 * MS,
            ..plan.shape
        };
        plan.quality = QUALITY;
        (plan.masters, plan.has_stamps, plan.checksum) = (vec![0, 1, 2], true, false);
        plan.fixed_ns = FIXED_NS;
        plan.timed_ns = FIXED_NS + 2 * S;
        plan.traffic_end_ns = FIXED_NS + RECOVERY_NS + WELL_NS;
        plan.end_ns = plan.traffic_end_ns + DRAIN_NS;
        plan.stepped_ns = plan.timed_ns + super::spans::EPOCH_PAUSE_NS;
        plan.rough_traffic(&mut chance);
        plan.rough_faults(&mut chance);
        plan
    }

    fn rough_traffic(&mut self, chance: &mut Chance) {
        (self.flows, self.calls) = (Vec::new(), Vec::new());
        for (node, other) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
            let (from, to) = (chance.pick(&self.nodes[node].modules), chance.pick(&self.nodes[other].modules));
            let to_data = to.with_local(local::DATA);
            let steady = Flow {
                node,
                from,
                to: to_data,
                priority: 100,
                period_ns: 40 * MS,
                bytes: (8, 300),
                is_mixed: false,
                burst: 1,
            };
            let mixed = Flow { period_ns: 150 * MS, bytes: (8, 4000), is_mixed: true, burst: 60, ..steady };
            let large = Flow { period_ns: 600 * MS, bytes: (20_000, 50_000), burst: 12, ..mixed };
            self.flows.extend([steady, mixed, large]);
            let valid_for_ns = chance.between(100, 2000) * MS;
            self.calls.push(CallPlan { node, from, to, period_ns: 50 * MS, valid_for_ns, priority: u8::MAX });
        }
    }

    fn rough_faults(&mut self, chance: &mut Chance) {
        self.faults.clear();
        let mut fault = |from_ms: u64, until_ms: u64, fault| {
            self.faults.push(Planned { from_ns: from_ms * MS, until_ns: until_ms * MS, fault });
        };
        fault(0, 6900, Fault::Bad { from: 0, to: 1, quality: SLOW });
        fault(0, 6900, Fault::Bad { from: 0, to: 2, quality: SLOW });
        fault(1000, 5700, Fault::Cut { from: 1, to: 2 });
        fault(5750, 6900, Fault::Restart { node: 0 });
        for n in 0..4 {
            let at_ms = 1100 + 1000 * n + chance.below(200);
            fault(at_ms, at_ms + 5, Fault::Restart { node: 2 });
            fault(at_ms + 10, at_ms + 110, Fault::Replay { to: 0, count: 60 });
            fault(at_ms + 300, at_ms + 400, Fault::Foreign { to: 1, count: 40 });
        }
        let at_ms = 2600 + chance.below(600);
        fault(at_ms, at_ms + 800, Fault::Freeze { node: 1, whole: false });
        fault(at_ms + 1700, at_ms + 3400, Fault::Freeze { node: 1, whole: false });
    }

    /// With time slots: frames are lost, copied and reordered all the time, threads wake too late again and again,
    /// every router stands still and dies, and what the first master says comes too late. After so much two nodes may
    /// transmit at once only where the plan says that the network is divided; all else that is promised holds at any
    /// time.
    pub fn rough_slotted(seed: u64) -> Self {
        let mut plan = Self::small_slotted(seed);
        let mut chance = Chance::new(seed ^ 0x10_06);
        let Quality { delay_ns, jitter_ns, .. } = plan.quality;
        plan.quality = Quality { delay_ns, jitter_ns, reorder_ppm: 20_000, ..QUALITY };
        plan.checksum = false;
        if let Some(slots) = &mut plan.slots {
            (slots.late_ppm, slots.still_ppm) = (LATE_PPM, LATE_PPM);
        }
        plan.rough_slotted_faults(&mut chance);
        plan.divide();
        plan
    }

    fn rough_slotted_faults(&mut self, chance: &mut Chance) {
        self.faults.clear();
        let nodes = self.nodes.len();
        let last_ns = self.fixed_ns - S / 2;
        let mut fault = |longest_ns: u64, chance: &mut Chance, fault| {
            let from_ns = chance.between(S / 2, last_ns);
            let until_ns = from_ns + chance.between(3 * MS, longest_ns);
            self.faults.push(Planned { from_ns, until_ns, fault });
        };
        for node in 0..nodes {
            let (other, far) = ((node + 1) % nodes, (node + nodes - 1) % nodes);
            fault(S / 4, chance, Fault::Restart { node });
            let whole = chance.percent(30);
            fault(S / 4, chance, Fault::Freeze { node, whole });
            fault(50 * MS, chance, Fault::Freeze { node, whole: false });
            // Shorter than what divides a network.
            fault(40 * MS, chance, Fault::Cut { from: node, to: other });
            fault(MS * 4, chance, Fault::Replay { to: far, count: 40 });
            fault(MS * 4, chance, Fault::Foreign { to: other, count: 40 });
        }
        let master = usize::from(self.masters[0]);
        fault(S / 2, chance, Fault::Bad { from: master, to: (master + 1) % nodes, quality: SLOW });
    }
}
