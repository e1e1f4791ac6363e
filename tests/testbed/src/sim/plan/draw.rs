//! The parts of a plan, each drawn by chance: the configuration, nodes, links, traffic, faults.

use super::{CallPlan, Flow, NodePlan, Plan, SYSTEM, Shape};
use crate::sim::chance::Chance;
use crate::sim::fault::{Fault, Planned};
use crate::sim::link::Quality;
use crate::sim::spans::{MS, S, US};
use rohrpost_mailbox::Name;
use rohrpost_routers::frame::NodeIndex;

/// Classes of the modules that may stand on a node; the first is not real time.
const CLASSES: [u8; 6] = [10, 40, 90, 140, 200, 254];

impl Plan {
    fn pair(&self, chance: &mut Chance) -> (usize, Name, Name) {
        let from = chance.below(self.nodes.len() as u64) as usize;
        let to = (from + 1 + chance.below(self.nodes.len() as u64 - 1) as usize) % self.nodes.len();
        (from, chance.pick(&self.nodes[from].modules), chance.pick(&self.nodes[to].modules))
    }

    pub(super) fn draw_flows(&mut self, chance: &mut Chance) {
        let count = self.nodes.len() as u64 + chance.below(5);
        // All that a node sends steadily is well below what it may send, and what one sender may have waiting.
        let share_bytes_s = self.shape.rate_bytes_s / (4 * count);
        for _ in 0..count {
            let (node, from, to) = self.pair(chance);
            let large = chance.percent(25);
            let most = if large { chance.between(2_000, 60_000) } else { chance.scale(16, 1400) };
            let least_period_ns = (most + 100) * S / share_bytes_s;
            let period_ns = least_period_ns.max(if large { 100 * MS } else { chance.scale(8 * MS, 200 * MS) });
            let flood = chance.percent(30);
            self.flows.push(Flow {
                node,
                from,
                to: to.with_local(rohrpost_mailbox::local::DATA),
                priority: if chance.percent(50) { from.class().0 } else { chance.below(256) as u8 },
                period_ns: if flood { chance.between(50 * MS, 700 * MS) } else { period_ns },
                is_mixed: chance.percent(20),
                bytes: (if large { most / 2 } else { 8 }, most),
                burst: if flood { chance.scale(16, 256) } else { 1 },
            });
        }
    }

    /// In every fourth network, beside all else.
    pub(super) fn draw_intruders(&mut self) {
        let mut chance = Chance::new(self.seed ^ 0x1d_e5);
        if self.seed % 4 != 2 {
            return;
        }
        for node in 0..self.nodes.len() {
            let from_ns = chance.between(S, self.fixed_ns - S / 2);
            let fault = Fault::Intruder { node, count: chance.scale(4, 60) };
            self.faults.push(Planned { from_ns, until_ns: from_ns, fault });
        }
    }

    pub(super) fn draw_calls(&mut self, chance: &mut Chance) {
        for _ in 0..1 + chance.below(self.nodes.len() as u64) {
            let (node, from, to) = self.pair(chance);
            let period_ns = chance.scale(20 * MS, 300 * MS);
            let valid_for_ns = chance.between(30, 2500) * MS;
            // All commands of a module, so that they overtake each other nowhere.
            let hurries = (from.raw() ^ self.seed as u32).is_multiple_of(5);
            let priority = if hurries { u8::MAX } else { from.class().0 };
            self.calls.push(CallPlan { node, from, to, period_ns, valid_for_ns, priority });
        }
    }

    pub(super) fn draw_faults(&mut self, chance: &mut Chance) {
        let count = if chance.percent(10) { 0 } else { chance.below(6 + 2 * self.nodes.len() as u64) };
        for _ in 0..count {
            let fault = self.fault(chance);
            let from_ns = chance.below(self.fixed_ns - S / 2);
            let longest_ns = self.fixed_ns - from_ns;
            let long_ns = chance.scale(5 * MS, 4 * S).min(longest_ns);
            self.faults.push(Planned { from_ns, until_ns: from_ns + long_ns, fault });
        }
    }

    fn fault(&self, chance: &mut Chance) -> Fault {
        let node = chance.below(self.nodes.len() as u64) as usize;
        let to = (node + 1 + chance.below(self.nodes.len() as u64 - 1) as usize) % self.nodes.len();
        let module = chance.pick(&self.nodes[node].modules);
        match chance.below(20) {
            0 | 1 | 18 => Fault::Freeze { node, whole: chance.percent(30) },
            2..5 => Fault::Restart { node },
            5 | 19 => Fault::Cut { from: node, to },
            6 => Fault::Split { side: chance.bits() },
            7..9 => Fault::Bad { from: node, to, quality: bad(chance) },
            9 => Fault::Absent { node, module },
            10 => Fault::Full { node, module },
            11..13 => Fault::ModuleRestart { node, module },
            13 | 14 => Fault::Step { node, by_ns: chance.around(5 * S as i64) },
            15 => Fault::Foreign { to, count: chance.scale(1, 200) },
            16 => Fault::Unsendable { node },
            _ => Fault::Replay { to, count: chance.scale(1, 64) },
        }
    }
}

pub(super) fn shape(chance: &mut Chance) -> Shape {
    let datagram_bytes_max = match chance.below(10) {
        0 => 548,
        1 => chance.between(548, 65_507),
        2 | 3 => 8972,
        4 => 65_507,
        _ => 1472,
    } as usize;
    Shape {
        datagram_bytes_max,
        rate_bytes_s: chance.scale(1 << 20, 100 << 20),
        quota_bytes: chance.between(128, 256) as usize * 1024,
        bulk_below: 16,
        interval_ns: if chance.percent(5) { S } else { chance.pick(&[100 * MS, 250 * MS, 250 * MS, 500 * MS]) },
    }
}

pub(in crate::sim) fn node(index: usize, chance: &mut Chance) -> NodePlan {
    let mut classes = CLASSES.to_vec();
    let kept = 1 + chance.below(4) as usize;
    while classes.len() > kept {
        classes.remove(chance.below(classes.len() as u64) as usize);
    }
    NodePlan {
        monotonic_ns: chance.scale(S, 1_000_000 * S),
        realtime_ns: (1_790_000_000 * S).saturating_add_signed(chance.around(100 * S as i64)),
        rate_ppb: chance.around(100_000),
        wander_ppb: chance.below(200) as i64,
        boot_ns: chance.below(300 * MS),
        modules: classes.into_iter().map(|class| Name::new(SYSTEM, class, index as u8, 0)).collect(),
    }
}

pub(in crate::sim) fn masters(nodes: usize, chance: &mut Chance) -> Vec<NodeIndex> {
    let mut masters: Vec<NodeIndex> = (0..nodes as NodeIndex).collect();
    if chance.percent(60) {
        let kept = chance.between(1, 4) as usize;
        while masters.len() > kept {
            masters.remove(chance.below(masters.len() as u64) as usize);
        }
    }
    masters
}

pub(super) fn quality(chance: &mut Chance) -> Quality {
    let delay_ns = chance.scale(5 * US, 5 * MS);
    let some = |chance: &mut Chance, most: u64| if chance.percent(40) { chance.scale(10, most) as u32 } else { 0 };
    Quality {
        delay_ns,
        jitter_ns: chance.below(delay_ns),
        loss_ppm: some(chance, 50_000),
        copy_ppm: some(chance, 20_000),
        reorder_ppm: some(chance, 50_000),
        damage_ppm: some(chance, 10_000),
        rate_bytes_s: 0,
    }
}

fn bad(chance: &mut Chance) -> Quality {
    let most = 300_000;
    Quality {
        delay_ns: chance.scale(5 * US, 40 * MS),
        jitter_ns: chance.scale(5 * US, 20 * MS),
        loss_ppm: chance.below(most) as u32,
        copy_ppm: chance.below(most) as u32,
        reorder_ppm: chance.below(most) as u32,
        damage_ppm: chance.below(most / 3) as u32,
        rate_bytes_s: if chance.percent(30) { chance.scale(64 << 10, 4 << 20) } else { 0 },
    }
}
