//! Networks in which computers sleep, and time daemons slew clocks.

use super::chance::Chance;
use super::fault::{Fault, Planned};
use super::plan::Plan;
use super::spans::{MS, S};

/// What daemons slew by, ns a second: what the kernel does by itself, and what chrony may.
const SLEWED_PPB: [i64; 6] = [500_000, -500_000, 300_000, -1_000_000, 20_000_000, -83_000_000];
/// A node with a clock that was not steady joins so much later, ns.
const STEADY_NS: u64 = S;
/// How far off a computer is that counts how long it slept, ns: some read that from a clock that counts seconds.
const WRONG_NS: u64 = 400_000_000;

impl Plan {
    /// A network of which some computers sleep for a while, and some clocks are slewed.
    pub fn unsteady(seed: u64) -> Self {
        let mut plan = Self::small(seed);
        plan.disturb_clocks();
        plan.time();
        // A node that is too far off waits for an epoch.
        plan.end_ns = plan.end_ns.max(plan.stepped_ns + S);
        plan
    }

    /// The same with time slots.
    pub fn unsteady_slotted(seed: u64) -> Self {
        let mut plan = Self::small_slotted(seed);
        plan.disturb_clocks();
        plan.time_slots();
        plan.divide();
        plan
    }

    fn disturb_clocks(&mut self) {
        let mut chance = Chance::new(self.seed ^ 0x51_ee);
        let last_ns = self.fixed_ns - S / 2;
        for _ in 0..chance.between(1, 3) {
            let node = chance.below(self.nodes.len() as u64) as usize;
            let from_ns = chance.between(S / 2, last_ns);
            let until_ns = chance.between(from_ns + 100 * MS, self.fixed_ns);
            // One thing after the other: a computer that sleeps is not slewed meanwhile.
            if self.faults.iter().all(|other| node_of(&other.fault) != Some(node)) {
                let fault = match chance.percent(50) {
                    true => Fault::Sleep { node, wrong_ns: chance.below(WRONG_NS) as i64 },
                    false => Fault::Slew { node, slewed_ppb: chance.pick(&SLEWED_PPB) },
                };
                let until_ns = if let Fault::Sleep { .. } = fault { until_ns.max(from_ns + S / 2) } else { until_ns };
                let until_ns = until_ns.min(self.fixed_ns);
                if let Fault::Sleep { .. } = fault {
                    // On a computer that sleeps nothing starts, and nobody ends it.
                    self.faults
                        .retain(|other| !starts(other, node) || other.until_ns < from_ns || other.from_ns > until_ns);
                }
                self.faults.push(Planned { from_ns, until_ns, fault });
            }
        }
        self.fixed_ns += STEADY_NS;
    }
}

/// Whether it starts a router of this node.
fn starts(planned: &Planned, of: usize) -> bool {
    matches!(planned.fault, Fault::Restart { node } | Fault::Edited { node, .. } if node == of)
}

fn node_of(fault: &Fault) -> Option<usize> {
    match *fault {
        Fault::Sleep { node, .. } | Fault::Slew { node, .. } => Some(node),
        _ => None,
    }
}
