//! Networks with a module that several nodes may run, one at a time.

use super::chance::Chance;
use super::fault::{Fault, Planned};
use super::lease_plan::LeasePlan;
use super::plan::{Plan, SYSTEM};
use super::slots::Slots;
use super::spans::{MS, S};
use rohrpost_config::LeaseTimes;
use rohrpost_mailbox::Name;
use rohrpost_supervision::lease::{LEASE_MAX_NS, Terms};

/// Of the module that moves.
const MOVES: Name = Name::new(SYSTEM, 150, 0, 0);
/// Of launches, as of all tools.
const LAUNCH_CLASS: u8 = 16;
/// Most nodes that may run it.
const CANDIDATES_MAX: u64 = 4;
/// Longest package of a flow in time slots: launches are not important, and longer ones fill many cycles.
const SLOTTED_BYTES_MAX: u64 = 200;
/// Flows beside, floods among them: these networks are about few packages, for a long time.
const FLOWS_MAX: usize = 6;
/// Deaths of a network in which nothing else goes wrong.
const DEATHS: usize = 3;
/// Nodes of one with time slots, and how many of them may be master.
const SLOTTED: (u64, u64) = (3, 6);
const MASTERS_MAX: usize = 3;
/// So long a question and its answer may wait in routers, besides their way, ns; and in time slots so many cycles.
const WAIT_NS: u64 = 150 * MS;
const WAIT_CYCLES: u64 = 4;

/// The launch of a node.
pub(super) fn launch(node: usize) -> Name {
    Name::new(SYSTEM, LAUNCH_CLASS, node as u8, 0)
}

/// Times of a lease without time slots, ns: how long it lasts, and how long a process needs to be off.
fn free_times_ns(chance: &mut Chance) -> (u64, u64) {
    (chance.between(400, 900) * MS, chance.below(100 * MS))
}

/// How often a turn comes in the slots' table at least, in cycles.
fn turn_cycles(slots: &Slots) -> u64 {
    slots.table.slots.iter().map(|slot| slot.period.into()).max().unwrap_or(1)
}

/// Draws a lease for nodes of a plan. In time slots it has the times of the product.
fn draw(plan: &Plan, chance: &mut Chance) -> LeasePlan {
    let nodes = plan.nodes.len();
    let times = plan.slots.as_ref().map(|slots| LeaseTimes::of(Some(slots.table.cycle)));
    let ns = |time: std::time::Duration| time.as_nanos() as u64;
    let (lease_ns, off_ns) =
        times.map_or_else(|| free_times_ns(chance), |LeaseTimes { lease, off, .. }| (ns(lease), ns(off)));
    let rate_error_ppm = chance.pick(&[0, 1_000, 10_000, 100_000]);
    let terms = |ask_every_ns| Terms::new(lease_ns, ask_every_ns, off_ns, rate_error_ppm);
    let held_ns = terms(1).map_or(0, |terms| terms.held_ns(lease_ns));
    let ask_every_ns = times.map_or_else(|| held_ns / chance.between(4, 8), |times| ns(times.ask_every));
    let terms = terms(ask_every_ns).expect("times that fit");
    // Without its only master a network with time slots soon is silent.
    let sole = plan.slots.as_ref().and(plan.masters.first()).filter(|_| plan.masters.len() == 1);
    let mut all: Vec<usize> = (0..nodes).filter(|node| sole.is_none_or(|sole| usize::from(*sole) != *node)).collect();
    let mut candidates = Vec::new();
    for _ in 0..chance.between(2, CANDIDATES_MAX).min(all.len() as u64) {
        candidates.push(all.remove(chance.below(all.len() as u64) as usize));
    }
    let witness = chance.below(nodes as u64) as usize;
    let limit_ppb = i64::from(rate_error_ppm) * 1_000;
    // The worst cases are those at the limits.
    let rate = |_| chance.pick(&[-limit_ppb, limit_ppb, limit_ppb / 3]);
    let rates_ppb = (0..nodes).map(rate).collect();
    let wire_ns = 2 * (plan.quality.delay_ns + plan.quality.jitter_ns);
    let waits_ns = |slots: &Slots| (2 * turn_cycles(slots) + WAIT_CYCLES) * plan.shape.interval_ns;
    LeasePlan {
        seed: plan.seed,
        name: MOVES,
        terms,
        off_ns,
        witness,
        hearers: [witness, (witness + 1) % nodes].into(),
        candidates,
        rates_ppb,
        way_ns: wire_ns + plan.slots.as_ref().map_or(WAIT_NS, waits_ns),
        joins_ns: plan.slots.as_ref().map_or(0, |_| plan.joining_ns()),
        moving: Vec::new(),
    }
}

impl Plan {
    /// A network in which computers with the module die and stand still, and its launches' clocks drift, beside all
    /// that goes wrong in any.
    pub fn leased(seed: u64) -> Self {
        Self::small(seed).with_leases()
    }

    /// A network with time slots, in which a lease is counted in cycles.
    pub fn leased_slotted(seed: u64) -> Self {
        Self::with_room(seed).with_leases()
    }

    /// Time slots that have room for launches.
    fn with_room(seed: u64) -> Self {
        let mut plan = Self::slotted_of(seed, SLOTTED, MASTERS_MAX);
        for flow in &mut plan.flows {
            flow.bytes = (flow.bytes.0.min(SLOTTED_BYTES_MAX), flow.bytes.1.min(SLOTTED_BYTES_MAX));
        }
        plan
    }

    fn with_leases(mut self) -> Self {
        self.flows.truncate(FLOWS_MAX);
        let mut chance = Chance::new(self.seed ^ 0x1e_a5e);
        let leases = draw(&self, &mut chance);
        self.fixed_ns += 3 * S;
        for _ in 0..chance.between(4, 8) {
            let any = chance.below(self.nodes.len() as u64) as usize;
            // The first choice has it most of the time.
            let some = chance.pick(&leases.candidates);
            let candidate = if chance.percent(50) { leases.candidates[0] } else { some };
            let fault = match chance.below(10) {
                0..4 => Fault::Death { node: candidate },
                4 => Fault::Death { node: leases.witness },
                5 => Fault::Unready { node: candidate },
                6 => Fault::Cut { from: any, to: (any + 1) % self.nodes.len() },
                _ => Fault::Freeze { node: candidate, whole: true },
            };
            let from_ns = chance.between(S, self.fixed_ns - S);
            let until_ns = (from_ns + chance.scale(100 * MS, 3 * S)).min(self.fixed_ns);
            self.faults.push(Planned { from_ns, until_ns, fault });
        }
        self.lease(leases);
        self
    }

    /// A network in which nothing goes wrong but that the computers with the module die, one after the other.
    pub fn leased_calm(seed: u64) -> Self {
        Self::calm(seed).with_deaths()
    }

    /// A calm network with time slots, of computers that keep up.
    pub fn leased_slotted_calm(seed: u64) -> Self {
        let mut plan = Self::with_room(seed);
        plan.calm_down();
        plan.slots.iter_mut().for_each(|slots| (slots.late_ppm, slots.still_ppm) = (0, 0));
        plan.with_deaths()
    }

    fn with_deaths(mut self) -> Self {
        self.flows.truncate(2);
        self.calls.truncate(1);
        let mut chance = Chance::new(self.seed ^ 0x1e_ca1);
        let leases = draw(&self, &mut chance);
        let apart_ns = LEASE_MAX_NS * 5 / 4 + leases.settling_ns() + S;
        let mut from_ns = apart_ns;
        for node in leases.candidates.iter().cycle().take(DEATHS) {
            // It is back, and well, before the next one dies.
            let until_ns = from_ns + chance.scale(100 * MS, apart_ns / 2);
            self.faults.push(Planned { from_ns, until_ns, fault: Fault::Death { node: *node } });
            from_ns += 3 * apart_ns / 2;
        }
        self.fixed_ns = from_ns;
        self.lease(leases);
        self
    }

    fn lease(&mut self, leases: LeasePlan) {
        self.nodes.iter_mut().enumerate().for_each(|(node, its)| its.modules.push(launch(node)));
        self.leases = Some(leases);
        self.time();
        if self.slots.is_some() {
            // A node that needs an epoch does not get it before the end: until then nobody need hold the lease.
            self.timed_ns += self.joining_ns();
            self.divide();
        }
    }
}
