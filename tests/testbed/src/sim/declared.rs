//! Networks with time slots in which nothing goes wrong, and flows are as they were declared: no package may be later
//! than was computed.

use super::chance::Chance;
use super::divided::Divisions;
use super::plan::{Flow, Plan};
use super::slots::{AROUND_BYTES, node_bytes_s};
use super::spans::{DRAIN_NS, MS, S};
use rohrpost_mailbox::{HEAD_BYTES, Name, local};
use rohrpost_network::HAND_OVER;

/// By then all nodes have system time.
const BEGIN_NS: u64 = 3 * S / 2;
const TRAFFIC_NS: u64 = 2 * S;
/// The least that lies between two packages of a flow, in percent of its period.
pub const PERIOD_MIN_PERCENT: u64 = 90;
/// The class of what nobody declares, and of which there may be any amount.
const FLOOD_CLASS: u8 = 10;
/// Some share a level.
const CLASSES: [u8; 8] = [40, 44, 90, 92, 140, 200, 206, 230];
/// Seldomer moments would meet slots in too few ways.
const MOMENTS_NS_MAX: u64 = 100 * MS;
/// A package that needs several datagrams.
const LARGE_BYTES_MAX: u64 = 12_000;
/// The router says its own to each package, and a datagram its: bytes.
const HEADS_BYTES: u64 = 100;

impl Plan {
    /// The declared flows come first; behind them one flood for each node, of the lowest level, and in every other
    /// network each has replicas of streams of all others, written faster than any slot carries.
    pub fn declared(seed: u64) -> Self {
        let mut plan = Self::small_slotted(seed);
        let mut chance = Chance::new(seed ^ 0xf10);
        plan.faults.clear();
        plan.calls.clear();
        plan.flows.clear();
        plan.quality = super::plan::fixed(plan.quality);
        for (index, node) in plan.nodes.iter_mut().enumerate() {
            let classes = CLASSES.iter().chain(&[FLOOD_CLASS]);
            node.modules = classes.map(|class| Name::new(super::plan::SYSTEM, *class, index as u8, 0)).collect();
        }
        plan.draw_declared(&mut chance);
        plan.draw_floods(&mut chance);
        plan.draw_moments(&mut chance);
        plan.traffic_begin_ns = BEGIN_NS;
        // Each flow publishes something.
        let longest_ns = plan.flows.iter().map(|flow| flow.period_ns).max().unwrap_or(0);
        plan.traffic_end_ns = BEGIN_NS + TRAFFIC_NS.max(longest_ns);
        (plan.fixed_ns, plan.timed_ns, plan.stepped_ns) = (plan.traffic_end_ns, BEGIN_NS, BEGIN_NS);
        plan.end_ns = plan.traffic_end_ns + DRAIN_NS;
        if let Some(slots) = &mut plan.slots {
            (slots.late_ppm, slots.still_ppm, slots.divisions) = (0, 0, Divisions::default());
            slots.oversleeps_percent = chance.pick(&[0, 20, 100]);
        }
        if seed % 2 == 1 {
            plan.draw_endless();
        }
        plan
    }

    fn draw_declared(&mut self, chance: &mut Chance) {
        let Some(slots) = &self.slots else { return };
        // A quick link carries no more small packages: the computer hands them over one by one.
        let bytes_min = slots.table.link_bytes_s * HAND_OVER.as_nanos() as u64 / S - AROUND_BYTES as u64;
        for node in 0..self.nodes.len() {
            let count = if chance.percent(50) { chance.between(1, 4) } else { chance.between(5, 40) };
            // All of them together ask for so much of what the node's slots carry.
            let share = chance.between(5, 60);
            let own_bytes_s = node_bytes_s(&slots.table, node) * share / (100 * count);
            let mut classes = CLASSES.to_vec();
            for _ in 0..count {
                let one_by_one = count <= 4 && !chance.percent(40);
                let class = if one_by_one { classes.pop().unwrap_or(CLASSES[0]) } else { chance.pick(&classes) };
                let from = Name::new(super::plan::SYSTEM, class, node as u8, 0);
                let other = (node as u64 + 1 + chance.below(self.nodes.len() as u64 - 1)) % self.nodes.len() as u64;
                let to = Name::new(super::plan::SYSTEM, chance.pick(&CLASSES), other as u8, local::DATA);
                // Often enough for the time that is simulated.
                let is_large = chance.percent(if count <= 4 { 20 } else { 3 }) && own_bytes_s > LARGE_BYTES_MAX;
                let most = if is_large { chance.scale(2000, LARGE_BYTES_MAX) } else { chance.scale(16, 1300) };
                let bytes = (most + HEAD_BYTES as u64 + HEADS_BYTES).max(bytes_min);
                let period_ns = (bytes * S / own_bytes_s).max(2 * MS);
                let flow =
                    Flow { node, from, to, priority: class, period_ns, bytes: (8, most), is_mixed: false, burst: 1 };
                if !self.flows.iter().any(|other| (other.from, other.to) == (from, to)) {
                    self.flows.push(flow);
                }
            }
        }
    }

    fn draw_floods(&mut self, chance: &mut Chance) {
        for node in 0..self.nodes.len() {
            let to = (node + 1 + chance.below(self.nodes.len() as u64 - 1) as usize) % self.nodes.len();
            let name = |node: usize| Name::new(super::plan::SYSTEM, FLOOD_CLASS, node as u8, 0);
            self.flows.push(Flow {
                node,
                from: name(node),
                to: name(to).with_local(local::DATA),
                priority: FLOOD_CLASS,
                period_ns: chance.scale(4 * MS, 50 * MS),
                bytes: (8, chance.scale(16, 4000)),
                is_mixed: false,
                burst: chance.scale(2, 8),
            });
        }
    }

    /// In most networks all declared flows come at once, as often as the slots of each node carry them. They drift
    /// against the cycle, so that they meet slots in all ways.
    fn draw_moments(&mut self, chance: &mut Chance) {
        let Some(slots) = self.slots.as_ref().filter(|_| chance.percent(70)) else { return };
        let cycle_ns = slots.table.cycle.as_nanos() as u64;
        let mean_ns = |node: usize| {
            let own = || self.flows.iter().filter(move |flow| flow.node == node && flow.burst == 1);
            own().map(|flow| flow.period_ns).sum::<u64>() / own().count().max(1) as u64
        };
        let every_ns = (0..self.nodes.len()).map(mean_ns).max().unwrap_or(0) + cycle_ns * chance.between(3, 17) / 100;
        if every_ns > MOMENTS_NS_MAX {
            return;
        }
        self.moments_ns = Some(every_ns);
        self.flows.iter_mut().filter(|flow| flow.burst == 1).for_each(|flow| flow.period_ns = every_ns);
    }
}
