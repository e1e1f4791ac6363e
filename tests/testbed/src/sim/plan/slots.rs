//! Networks with time slots, and their tables, drawn from a seed.

use super::{LARGE, Plan, is_large};
use crate::sim::chance::Chance;
use crate::sim::divided::Divisions;
use crate::sim::fault::{Fault, Planned};
use crate::sim::host::COMMAND_SLOTS;
use crate::sim::link::Quality;
use crate::sim::slots::{AROUND_BYTES, LATE_PPM, Slots, node_bytes_s, takes_ns};
use crate::sim::spans::{DRAIN_NS, EPOCH_PAUSE_NS, MS, RECOVERY_NS, S, US, WELL_NS};
use rohrpost_network::{HAND_OVER, Tdma, TimeSlot};
use rohrpost_routers::security::TAG_BYTES;
use rohrpost_routers::time::{JOINING_SYNCS, TIME_BYTES};
use std::time::Duration;

/// Nodes of most networks, from and to.
const SMALL: (u64, u64) = (2, 6);
/// A cycle is so long at most, unless the slots of many nodes need more.
const CYCLE_NS_MAX: u64 = 20 * MS;
/// A master is given so long at least to answer.
const DEAF_NS: u64 = 200 * MS;
/// Where datagrams are sealed, a joining node needs so much longer: it hears some Syncs more, and hellos pass to and
/// fro.
const SEALED_JOINS_NS: u64 = 400 * MS;
/// Bytes of the largest datagram there may be, with all around it.
const TIME_WIRE_BYTES: usize = TIME_BYTES + AROUND_BYTES;
const SEALED_JOINS_CYCLES: u64 = 48;

impl Plan {
    /// A network with time slots.
    pub fn slotted(seed: u64) -> Self {
        Self::slotted_of(seed, if is_large(seed) { LARGE } else { SMALL }, 3)
    }

    /// One of up to six nodes.
    pub fn small_slotted(seed: u64) -> Self {
        Self::slotted_of(seed, SMALL, 3)
    }

    /// One of so many nodes, from and to, of which so many at most may be master.
    pub(in crate::sim) fn slotted_of(seed: u64, nodes: (u64, u64), masters_max: usize) -> Self {
        let mut plan = Self::small(seed);
        let mut chance = Chance::new(seed ^ 0x51_07);
        let chance = &mut chance;
        plan.nodes = (0..chance.between(nodes.0, nodes.1) as usize).map(|index| super::node(index, chance)).collect();
        plan.masters = super::masters(plan.nodes.len(), chance);
        plan.masters.truncate(masters_max);
        let link_bytes_s = chance.pick(&[100, 100, 1000]) * 1_000_000 / 8;
        plan.shape.datagram_bytes_max = chance.pick(&[548, 1472, 1472]);
        plan.has_stamps = true;
        // What the cable and the switch take; what they take more, clocks are unsure of.
        let delay_ns = chance.between(US, 10 * US);
        plan.quality = Quality { delay_ns, jitter_ns: chance.below(delay_ns), ..plan.quality };
        let table = table(&plan, link_bytes_s, chance);
        plan.shape.interval_ns = table.cycle.as_nanos() as u64;
        plan.shape.rate_bytes_s = (0..plan.nodes.len()).map(|node| node_bytes_s(&table, node)).min().unwrap_or(0);
        plan.fixed_ns = chance.between(2 * S, 4 * S);
        plan.slots = Some(Slots {
            table,
            masters: plan.masters.clone(),
            late_ppm: LATE_PPM,
            still_ppm: LATE_PPM,
            oversleeps_percent: 0,
            divisions: Divisions::default(),
            joins_ns: None,
        });
        plan.time_slots();
        plan.draw_all(chance);
        plan.fit_traffic();
        plan.divide();
        plan
    }

    /// A network with time slots in which nothing goes wrong but that datagrams are lost and threads wake late, for so
    /// many cycles.
    pub fn lossy_slotted(seed: u64, cycles: u64) -> Self {
        let mut plan = Self::small_slotted(seed);
        plan.faults.clear();
        plan.flows.clear();
        plan.calls.clear();
        plan.divide();
        plan.fixed_ns = S + cycles * plan.shape.interval_ns;
        plan.slots.iter_mut().for_each(|slots| slots.still_ppm = 0);
        plan.time_slots();
        plan
    }

    /// When all must be well, and when it ends. Nobody is let off: the run goes on until each node that needs an epoch
    /// has had it, and then all must be well.
    pub(in crate::sim) fn time_slots(&mut self) {
        self.time();
        let joins_ns = self.joining_ns();
        self.timed_ns += joins_ns;
        self.stepped_ns = self.timed_ns + EPOCH_PAUSE_NS + joins_ns;
        self.traffic_end_ns = self.stepped_ns + RECOVERY_NS + WELL_NS;
        self.end_ns = self.traffic_end_ns + DRAIN_NS;
    }

    /// Longest time from a router's start to its first datagram, ns: a joining node hears some Syncs before it asks,
    /// and a master is given time to answer.
    pub(in crate::sim) fn joining_ns(&self) -> u64 {
        let joins_ns = 2 * u64::from(JOINING_SYNCS) * self.shape.interval_ns + DEAF_NS;
        joins_ns + if self.sealed { SEALED_JOINS_NS + SEALED_JOINS_CYCLES * self.shape.interval_ns } else { 0 }
    }

    /// What seals takes its part of each slot; and a joining node must begin its peer sessions first.
    pub(in crate::sim) fn seal_slots(&mut self) {
        let Some(slots) = &mut self.slots else { return };
        // As the table was made: over two links a frame of time is on its way for a quarter of the guard at most.
        let least_ns = 8 * takes_ns(TIME_WIRE_BYTES + TAG_BYTES, slots.table.link_bytes_s);
        let longer = |slots: &mut Slots| slots.table.guard = slots.table.guard.max(Duration::from_nanos(least_ns));
        longer(slots);
        self.edited.iter_mut().for_each(longer);
        self.time_slots();
        self.echo();
    }

    /// Somebody repeats what a node is told, to its next lives too; one of them begins meanwhile.
    fn echo(&mut self) {
        let mut chance = Chance::new(self.seed ^ 0xec_40);
        for _ in 0..chance.between(1, 3) {
            let to = chance.below(self.nodes.len() as u64) as usize;
            let (from_ns, delay_ns) = (chance.below(self.fixed_ns / 2), chance.scale(10 * MS, S / 2));
            let until_ns = chance.between(from_ns, self.fixed_ns - S / 2);
            self.faults.push(Planned { from_ns, until_ns, fault: Fault::Echo { to, delay_ns } });
            let dies_ns = chance.between(from_ns, until_ns);
            let until_ns = dies_ns + chance.scale(5 * MS, S / 4);
            self.faults.push(Planned { from_ns: dies_ns, until_ns, fault: Fault::Restart { node: to } });
        }
    }

    /// What slots carry well: a large package is through long before it is too old. Commands that wait behind it come
    /// all at once: no more of them than fit in a mailbox, else some are lost though all is well.
    pub(in crate::sim) fn fit_traffic(&mut self) {
        let most_bytes = self.shape.rate_bytes_s / 4;
        for flow in &mut self.flows {
            flow.bytes = (flow.bytes.0.min(most_bytes), flow.bytes.1.min(most_bytes));
        }
        let large = |node: usize| {
            let flows = self.flows.iter().filter(move |flow| flow.node == node && flow.burst == 1);
            flows.map(|flow| flow.bytes.1).sum::<u64>()
        };
        let most_bytes = (0..self.nodes.len()).map(large).max().unwrap_or(0);
        let behind_ns = most_bytes * S / self.shape.rate_bytes_s.max(1);
        let callers = self.calls.len() as u64;
        for calls in &mut self.calls {
            calls.period_ns = calls.period_ns.max(4 * callers * behind_ns / COMMAND_SLOTS as u64);
        }
    }

    pub(in crate::sim) fn divide(&mut self) {
        let divisions = Divisions::of(&self.faults, self.shape.interval_ns);
        if let Some(slots) = &mut self.slots {
            slots.divisions = divisions;
        }
    }
}

/// A table in which every node has a slot, in any order and with gaps; its cycle is as short as drawn, or as long as
/// the slots need.
fn table(plan: &Plan, link_bytes_s: u64, chance: &mut Chance) -> Tdma {
    let others = plan.nodes.len() as u64 - 1;
    let datagram_ns = takes_ns(plan.shape.datagram_bytes_max + AROUND_BYTES, link_bytes_s);
    let time_ns = takes_ns(TIME_WIRE_BYTES, link_bytes_s).max(HAND_OVER.as_nanos() as u64);
    // What `check` accepts: over two links a frame of time is on its way for a quarter of the guard at most.
    let guard_ns = (chance.between(100, 250) * US).max(8 * takes_ns(TIME_WIRE_BYTES, link_bytes_s));
    // For each slave a synchronisation; or a warm-up, too; or a reply, too. Without it replies go in the slots of the
    // master.
    let frames = chance.pick(&[1, 2, 3, 3]) * others;
    let frames_in_slot = others.max(2).max(plan.masters.len() as u64);
    let synchronisation_ns = guard_ns + frames * time_ns + chance.between(60, 120) * US;
    let mut end_ns = plan.masters.len() as u64 * synchronisation_ns;
    let mut slots = Vec::new();
    for turns in owners(plan.nodes.len() as u8, chance) {
        let begin_ns = end_ns + if chance.percent(30) { chance.below(300 * US) } else { 0 };
        let sends_ns = frames_in_slot * time_ns + datagram_ns * chance.between(1, 4) + chance.between(60, 120) * US;
        let (offset, length) = (Duration::from_nanos(begin_ns), Duration::from_nanos(guard_ns + sends_ns));
        let period = turns.len() as u32;
        let slot = |(phase, node): (u32, &u8)| TimeSlot { node: *node, offset, length, period, phase };
        slots.extend((0..).zip(&turns).map(slot));
        end_ns = begin_ns + guard_ns + sends_ns;
    }
    let cycle_ns = chance.scale(MS, CYCLE_NS_MAX).max(end_ns.next_multiple_of(100 * US));
    Tdma {
        cycle: Duration::from_nanos(cycle_ns),
        synchronisation: Duration::from_nanos(synchronisation_ns),
        guard: Duration::from_nanos(guard_ns),
        link_bytes_s,
        slots,
        tunnel: None,
    }
}

/// For each place in the cycle the nodes that take turns there.
fn owners(nodes: u8, chance: &mut Chance) -> Vec<Vec<u8>> {
    let mut places: Vec<Vec<u8>> = Vec::new();
    for node in 0..nodes {
        match places.last_mut().filter(|place| place.len() < 3 && chance.percent(20)) {
            Some(place) => place.push(node),
            None => places.push(vec![node]),
        }
    }
    for _ in 0..chance.below(3) {
        places.push(vec![chance.below(nodes.into()) as u8]);
    }
    // In any order.
    for at in (1..places.len()).rev() {
        places.swap(at, chance.below(at as u64 + 1) as usize);
    }
    places
}
