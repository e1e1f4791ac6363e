//! Networks that seal and in which joining is hard: slots that come seldom, and many nodes of which one alone may be
//! master.

use super::chance::Chance;
use super::fault::{Fault, Planned};
use super::plan::Plan;
use super::slots::node_bytes_s;
use super::spans::{MS, S};
use rohrpost_network::TimeSlot;

/// From one slot of a node to its next.
const RARE_NS: u64 = 500 * MS;
/// Commands wait for a slot, and so do answers: a caller waits for both, and for repeats.
const ANSWERED_NS: u64 = 2 * S;
/// Six nodes.
const MANY: (u64, u64) = (6, 6);

/// Two times that a division brought about may both go on for so many rare slots after it: their masters say that they
/// are followed for four after they were asked last, and a node that is divided from one waits for four before it turns
/// to the other.
const DIVIDED_SLOTS: u64 = 8;

fn is_rare(seed: u64) -> bool {
    seed % 3 != 1
}

impl Plan {
    /// By turns: rare slots; one master of six; both.
    fn hard(seed: u64) -> Self {
        let (nodes, masters_max) = if seed.is_multiple_of(3) { ((2, 6), 3) } else { (MANY, 1) };
        let mut plan = Self::slotted_of(seed, nodes, masters_max);
        if is_rare(seed) {
            plan.thin_out();
        }
        plan
    }

    /// Sealed networks of rare slots, of six nodes with one master, and of both.
    pub fn rare(seed: u64) -> Self {
        let mut plan = Self::hard(seed).sealed();
        plan.give_time_to_join();
        plan
    }

    /// The same, and nothing goes wrong but that each router is killed once, long after the one before: each is back as
    /// soon as is promised.
    pub fn rare_joining(seed: u64) -> Self {
        let mut plan = Self::hard(seed).sealed();
        let mut chance = Chance::new(seed ^ 0x5e_1d);
        let joins_ns = plan.joins_ns();
        plan.calm_down();
        for node in 0..plan.nodes.len() {
            let from_ns = joins_ns * (1 + node as u64) + S + chance.below(S);
            let until_ns = from_ns + chance.scale(5 * MS, S / 4);
            plan.faults.push(Planned { from_ns, until_ns, fault: Fault::Restart { node } });
        }
        plan.fixed_ns = joins_ns * plan.nodes.len() as u64 + 3 * S;
        plan.give_time_to_join();
        if let Some(slots) = &mut plan.slots {
            slots.joins_ns = Some(joins_ns);
        }
        plan
    }

    /// Of each node one slot is left, and that comes seldom.
    fn thin_out(&mut self) {
        let mut chance = Chance::new(self.seed ^ 0x7a_4e);
        let Some(slots) = &mut self.slots else { return };
        let cycles = (RARE_NS / slots.table.cycle.as_nanos() as u64) as u32;
        let mut kept: Vec<TimeSlot> = Vec::new();
        for slot in slots.table.slots.drain(..) {
            if kept.iter().all(|other| other.node != slot.node) {
                let times = (cycles / slot.period).max(1);
                let phase = slot.phase + slot.period * chance.below(times.into()) as u32;
                kept.push(TimeSlot { period: slot.period * times, phase, ..slot });
            }
        }
        slots.table.slots = kept;
        let table = &slots.table;
        self.shape.rate_bytes_s = (0..self.nodes.len()).map(|node| node_bytes_s(table, node)).min().unwrap_or(0);
        self.draw_all(&mut chance);
        self.fit_traffic();
        let callers = self.calls.len() as u64;
        for calls in &mut self.calls {
            // All that wait for a slot come at once, and are no more than a mailbox has room for.
            calls.period_ns = calls.period_ns.max(callers * RARE_NS / 4);
            calls.valid_for_ns = calls.valid_for_ns.max(ANSWERED_NS);
        }
    }

    /// Longest time from a router's start to its first datagram, however rare its slots are: see
    /// `docs/src/security.md`.
    fn joins_ns(&self) -> u64 {
        let Some(slots) = &self.slots else { return 0 };
        let rarest = slots.table.slots.iter().map(|slot| slot.period).max().unwrap_or(1).max(4);
        let slot_ns = slots.table.cycle.as_nanos() as u64 * u64::from(rarest);
        2 * S + slot_ns * 4 * self.nodes.len() as u64
    }

    /// All is well only when the node that began last has joined; and a node that was divided from another joins it as
    /// if it began.
    fn give_time_to_join(&mut self) {
        let (joins_ns, is_rare) = (self.joins_ns(), is_rare(self.seed));
        self.fixed_ns += joins_ns;
        self.time_slots();
        self.divide();
        if let Some(slots) = &mut self.slots {
            slots.divisions.asks_ns = if is_rare { DIVIDED_SLOTS * RARE_NS } else { 0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn slots_are_rare_and_never_two_at_once() {
        for seed in [0, 2, 3, 5] {
            let slots = Plan::rare(seed).slots.unwrap();
            let cycle = slots.table.cycle;
            for slot in &slots.table.slots {
                let every = cycle * slot.period;
                assert!(every > Duration::from_millis(200) && every <= Duration::from_nanos(RARE_NS), "{every:?}");
            }
            let in_cycle = |slot: &TimeSlot, n: u32| (0..n).map(|n| n * slot.period + slot.phase).collect::<Vec<_>>();
            for (at, one) in slots.table.slots.iter().enumerate() {
                for other in &slots.table.slots[at + 1..] {
                    let meet = one.offset < other.offset + other.length && other.offset < one.offset + one.length;
                    let cycles = in_cycle(one, other.period);
                    let twice = in_cycle(other, one.period).iter().any(|cycle| cycles.contains(cycle));
                    assert!(!(meet && twice), "seed {seed}: {one:?} and {other:?}");
                }
            }
        }
    }
}
