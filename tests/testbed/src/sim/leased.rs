//! Networks with a module that several nodes may run, one at a time.

use super::chance::Chance;
use super::fault::{Fault, Planned};
use super::lease_plan::LeasePlan;
use super::plan::{Plan, SYSTEM};
use super::spans::{MS, S};
use rohrpost_mailbox::Name;
use rohrpost_supervision::lease::{LEASE_MAX_NS, Terms};

/// Of the module that moves.
const MOVES: Name = Name::new(SYSTEM, 150, 0, 0);
/// Of launches, as of all tools.
const LAUNCH_CLASS: u8 = 16;
/// Most nodes that may run it.
const CANDIDATES_MAX: u64 = 4;
/// Flows beside, floods among them: these networks are about few packages, for a long time.
const FLOWS_MAX: usize = 6;
/// Deaths of a network in which nothing else goes wrong.
const DEATHS: usize = 3;

/// The launch of a node.
pub(super) fn launch(node: usize) -> Name {
    Name::new(SYSTEM, LAUNCH_CLASS, node as u8, 0)
}

/// Draws a lease for nodes of a plan.
fn draw(plan: &Plan, chance: &mut Chance) -> LeasePlan {
    let nodes = plan.nodes.len();
    let lease_ns = chance.between(400, 900) * MS;
    let off_ns = chance.below(100 * MS);
    let rate_error_ppm = chance.pick(&[0, 1_000, 10_000, 100_000]);
    let terms = |ask_every_ns| Terms::new(lease_ns, ask_every_ns, off_ns, rate_error_ppm);
    let held_ns = terms(1).map_or(0, |terms| terms.held_ns(lease_ns));
    let terms = terms(held_ns / chance.between(4, 8)).expect("times that fit");
    let mut all: Vec<usize> = (0..nodes).collect();
    let mut candidates = Vec::new();
    for _ in 0..chance.between(2, CANDIDATES_MAX).min(nodes as u64) {
        candidates.push(all.remove(chance.below(all.len() as u64) as usize));
    }
    let witness = chance.below(nodes as u64) as usize;
    let limit_ppb = i64::from(rate_error_ppm) * 1_000;
    // The worst cases are those at the limits.
    let rate = |_| chance.pick(&[-limit_ppb, limit_ppb, limit_ppb / 3]);
    let rates_ppb = (0..nodes).map(rate).collect();
    LeasePlan {
        seed: plan.seed,
        name: MOVES,
        terms,
        off_ns,
        witness,
        hearers: [witness, (witness + 1) % nodes].into(),
        candidates,
        rates_ppb,
        way_ns: 2 * (plan.quality.delay_ns + plan.quality.jitter_ns),
        moving: Vec::new(),
    }
}

impl Plan {
    /// A network in which computers with the module die and stand still, and its launches' clocks drift, beside all
    /// that goes wrong in any.
    pub fn leased(seed: u64) -> Self {
        let mut plan = Self::small(seed);
        plan.flows.truncate(FLOWS_MAX);
        let mut chance = Chance::new(seed ^ 0x1e_a5e);
        let leases = draw(&plan, &mut chance);
        plan.fixed_ns += 3 * S;
        for _ in 0..chance.between(4, 8) {
            let any = chance.below(plan.nodes.len() as u64) as usize;
            // The first choice has it most of the time.
            let some = chance.pick(&leases.candidates);
            let candidate = if chance.percent(50) { leases.candidates[0] } else { some };
            let fault = match chance.below(10) {
                0..4 => Fault::Death { node: candidate },
                4 => Fault::Death { node: leases.witness },
                5 => Fault::Unready { node: candidate },
                6 => Fault::Cut { from: any, to: (any + 1) % plan.nodes.len() },
                _ => Fault::Freeze { node: candidate, whole: true },
            };
            let from_ns = chance.between(S, plan.fixed_ns - S);
            let until_ns = (from_ns + chance.scale(100 * MS, 3 * S)).min(plan.fixed_ns);
            plan.faults.push(Planned { from_ns, until_ns, fault });
        }
        plan.lease(leases);
        plan
    }

    /// A network in which nothing goes wrong but that the computers with the module die, one after the other.
    pub fn leased_calm(seed: u64) -> Self {
        let mut plan = Self::calm(seed);
        plan.flows.truncate(2);
        plan.calls.truncate(1);
        let mut chance = Chance::new(seed ^ 0x1e_ca1);
        let leases = draw(&plan, &mut chance);
        let apart_ns = LEASE_MAX_NS * 5 / 4 + leases.settling_ns() + S;
        let mut from_ns = apart_ns;
        for node in leases.candidates.iter().cycle().take(DEATHS) {
            // It is back, and well, before the next one dies.
            let until_ns = from_ns + chance.scale(100 * MS, apart_ns / 2);
            plan.faults.push(Planned { from_ns, until_ns, fault: Fault::Death { node: *node } });
            from_ns += 3 * apart_ns / 2;
        }
        plan.fixed_ns = from_ns;
        plan.lease(leases);
        plan
    }

    fn lease(&mut self, leases: LeasePlan) {
        self.nodes.iter_mut().enumerate().for_each(|(node, its)| its.modules.push(launch(node)));
        self.leases = Some(leases);
        self.time();
    }
}
