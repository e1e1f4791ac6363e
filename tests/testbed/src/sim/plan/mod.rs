//! What happens in one simulated network, drawn from its seed before it begins: nodes, links, traffic and faults.
//!
//! ```text
//!  0 ────────────── faults and floods ───────────────┬ fixed ─── RECOVERY ───┬── all must be well ──┬ traffic ends ── DRAIN ──┬ accounts
//! ```

mod draw;
mod slots;

pub(super) use draw::{masters, node};

use super::chance::Chance;
use super::fault::{Fault, Planned};
use super::host::TRANSIT_AGE_MAX_NS;
use super::lease_plan::LeasePlan;
use super::link::Quality;
use super::replicas::StreamPlan;
use super::slots::Slots;
use super::spans::{DRAIN_NS, EPOCH_PAUSE_NS, RECOVERY_NS, S, TIMED_INTERVALS, WELL_NS};
use rohrpost_mailbox::Name;
use rohrpost_network::NODES_MAX;
use rohrpost_routers::frame::NodeIndex;

/// System of all nodes.
pub const SYSTEM: u8 = 1;
/// Nodes of a large network, from and to.
pub(super) const LARGE: (u64, u64) = (24, NODES_MAX as u64);
/// So many of them at most may be master.
pub(super) const LARGE_MASTERS_MAX: usize = 3;
/// When the faults of a large network are over.
const LARGE_FIXED_NS: u64 = 2 * S;
/// The seed of a large network in each hundred.
const LARGE_SEED: u64 = 22;

/// Whether this seed is that of a large network.
pub(super) fn is_large(seed: u64) -> bool {
    seed % 100 == LARGE_SEED
}

/// One computer.
#[derive(Clone, Debug)]
pub struct NodePlan {
    /// CLOCK_MONOTONIC at the beginning, ns.
    pub monotonic_ns: u64,
    /// CLOCK_REALTIME at the beginning, ns.
    pub realtime_ns: u64,
    /// How much its clocks run fast, ns a second.
    pub rate_ppb: i64,
    /// By how much that changes each second, at most.
    pub wander_ppb: i64,
    /// When its router starts first, ns.
    pub boot_ns: u64,
    /// Modules, with the node's index as instance.
    pub modules: Vec<Name>,
}

/// What the configuration says of the network.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Bytes of a datagram at most.
    pub datagram_bytes_max: usize,
    /// Pacing, bytes a second.
    pub rate_bytes_s: u64,
    /// What one sender may have waiting, bytes.
    pub quota_bytes: usize,
    /// Classes below are not real time.
    pub bulk_below: u8,
    /// How often the master says what time it is, ns.
    pub interval_ns: u64,
}

/// Data from one module to another, again and again.
#[derive(Clone, Copy, Debug)]
pub struct Flow {
    /// Node it comes from.
    pub node: usize,
    /// Module that sends.
    pub from: Name,
    /// Mailbox it goes to.
    pub to: Name,
    /// Of all its packages.
    pub priority: u8,
    /// From one to the next, ns.
    pub period_ns: u64,
    /// Shortest and longest body.
    pub bytes: (u64, u64),
    /// Each package has any priority and one of several mailboxes.
    pub is_mixed: bool,
    /// Packages at once; a flood has more than one, and ends with the faults.
    pub burst: u64,
}

/// A module that calls a function of another, again and again.
#[derive(Clone, Copy, Debug)]
pub struct CallPlan {
    /// Node of the caller.
    pub node: usize,
    /// The module that calls.
    pub from: Name,
    /// The module that it is a function of.
    pub to: Name,
    /// From one call to the next, ns.
    pub period_ns: u64,
    /// How long a command is valid, ns.
    pub valid_for_ns: u64,
    /// With what priority its commands are posted; they leave with the caller's class at most.
    pub priority: u8,
}

/// All of it.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Where it came from.
    pub seed: u64,
    /// The configuration.
    pub shape: Shape,
    /// The computers.
    pub nodes: Vec<NodePlan>,
    /// Of all links, unless a fault says otherwise; after the faults only its delay and jitter are left.
    pub quality: Quality,
    /// Which node may send when; none: each one, as packages come.
    pub slots: Option<Slots>,
    /// The same in files that somebody has edited; the first is edition 1.
    pub(crate) edited: Vec<Slots>,
    /// Data.
    pub flows: Vec<Flow>,
    /// Streams that other nodes have replicas of.
    pub(crate) streams: Vec<StreamPlan>,
    /// Commands.
    pub(crate) calls: Vec<CallPlan>,
    /// The module that several nodes may run, if there is one.
    pub(crate) leases: Option<LeasePlan>,
    /// What goes wrong.
    pub(crate) faults: Vec<Planned>,
    /// The nodes that may be master of time, in order.
    pub masters: Vec<NodeIndex>,
    /// Whether kernels stamp datagrams.
    pub(crate) has_stamps: bool,
    /// Whether routers seal what they send. Then replayed datagrams are altered, too.
    pub(crate) sealed: bool,
    /// Whether damaged datagrams are dropped by the kernel, as UDP's checksum has it; else the routers get them.
    pub(crate) checksum: bool,
    /// All steady flows publish at once, so often, ns; none: each as its period says.
    pub(crate) moments_ns: Option<u64>,
    /// No data before this, ns.
    pub(crate) traffic_begin_ns: u64,
    /// No fault and no flood after this, ns.
    pub(crate) fixed_ns: u64,
    /// From then on all nodes follow one master, ns.
    pub(crate) timed_ns: u64,
    /// From then on they also have its time, ns; may be after the end.
    pub(crate) stepped_ns: u64,
    /// No data and no call after this, ns.
    pub(crate) traffic_end_ns: u64,
    /// The end, ns.
    pub(crate) end_ns: u64,
}

impl Plan {
    /// Draws it. One of a hundred is large.
    pub fn new(seed: u64) -> Self {
        let mut plan = Self::small(seed);
        if is_large(seed) {
            plan.enlarge();
        }
        plan
    }

    /// One of up to 16 nodes.
    pub(super) fn small(seed: u64) -> Self {
        let mut chance = Chance::new(seed);
        let count = match chance.below(100) {
            0..4 => chance.between(9, 16),
            _ => chance.between(2, 8),
        } as usize;
        let shape = draw::shape(&mut chance);
        let nodes: Vec<NodePlan> = (0..count).map(|index| node(index, &mut chance)).collect();
        let quality = draw::quality(&mut chance);
        let fixed_ns = chance.between(2 * S, 6 * S);
        let masters = masters(count, &mut chance);
        let checksum = chance.percent(90);
        let waits_for_epochs = chance.percent(10);
        let mut plan = Self {
            seed,
            shape,
            quality,
            flows: Vec::new(),
            streams: Vec::new(),
            calls: Vec::new(),
            leases: None,
            faults: Vec::new(),
            checksum,
            moments_ns: None,
            traffic_begin_ns: 0,
            fixed_ns,
            traffic_end_ns: 0,
            end_ns: 0,
            timed_ns: 0,
            stepped_ns: 0,
            masters,
            has_stamps: chance.percent(80),
            sealed: false,
            slots: None,
            edited: Vec::new(),
            nodes,
        };
        plan.time();
        if waits_for_epochs {
            plan.end_ns = plan.end_ns.max(plan.stepped_ns + S);
        }
        plan.draw_all(&mut chance);
        plan.draw_intruders();
        plan
    }

    /// The slots of an edition of the configuration.
    pub(crate) fn slots_of(&self, edition: usize) -> Option<&Slots> {
        edition.checked_sub(1).map_or(self.slots.as_ref(), |edited| self.edited.get(edited))
    }

    pub(super) fn draw_all(&mut self, chance: &mut Chance) {
        (self.flows, self.calls, self.faults) = Default::default();
        self.draw_flows(&mut chance.fork());
        self.draw_calls(&mut chance.fork());
        self.draw_faults(&mut chance.fork());
    }

    /// The same with as many nodes as there may be, and shorter, since each sends to each.
    fn enlarge(&mut self) {
        let mut chance = Chance::new(self.seed ^ 0x1a_46e);
        let count = chance.between(LARGE.0, LARGE.1);
        self.nodes = (0..count as usize).map(|index| node(index, &mut chance)).collect();
        self.masters = masters(self.nodes.len(), &mut chance);
        self.masters.truncate(LARGE_MASTERS_MAX);
        self.shape.interval_ns = self.shape.interval_ns.min(S / 4);
        self.fixed_ns = LARGE_FIXED_NS;
        self.time();
        self.draw_all(&mut chance);
        self.draw_intruders();
    }

    /// When all must be well, and when it ends, from when the last fault is over.
    pub(super) fn time(&mut self) {
        let intervals = TIMED_INTERVALS + self.masters.len() as u64;
        self.timed_ns = self.fixed_ns + intervals * self.shape.interval_ns;
        self.stepped_ns = self.timed_ns + EPOCH_PAUSE_NS;
        self.traffic_end_ns = self.well_ns() + WELL_NS;
        self.end_ns = (self.traffic_end_ns + DRAIN_NS).max(self.timed_ns + S);
    }

    /// From then on all must be well, true ns.
    pub(super) fn well_ns(&self) -> u64 {
        let leases_ns = self.leases.as_ref().map_or(0, LeasePlan::well_after_ns);
        self.fixed_ns + RECOVERY_NS.max(leases_ns)
    }

    /// When the last package that has waited since the faults is gone, and each node may send again, true ns.
    pub(super) fn clear_ns(&self) -> u64 {
        let joined_ns = self.slots.as_ref().map_or(0, |_| self.stepped_ns);
        joined_ns.max(self.fixed_ns + TRANSIT_AGE_MAX_NS)
    }

    /// Whether links lose, copy or reorder datagrams before all is fixed.
    pub(super) fn is_lossy(&self) -> bool {
        self.quality != fixed(self.quality)
    }

    /// How often a flow publishes with all others at once, ns.
    pub(crate) fn moment_of(&self, flow: &Flow) -> Option<u64> {
        self.moments_ns.filter(|_| flow.burst == 1)
    }

    /// The same network with datagrams that are sealed.
    #[must_use]
    pub fn sealed(self) -> Self {
        let mut plan = Self { sealed: true, ..self };
        plan.seal_slots();
        plan
    }

    /// Whether each datagram comes behind all that its sender sent before it.
    pub(crate) fn is_in_order(&self) -> bool {
        let is_deceit = |its: &Planned| matches!(its.fault, Fault::Forged { .. } | Fault::Stray { .. });
        self.quality.reorder_ppm == 0 && self.faults.iter().all(is_deceit)
    }

    /// A network in which nothing goes wrong but that somebody sends what a router could have sent.
    pub fn forged(seed: u64) -> Self {
        Self::deceived(seed, |(from, to), count| Fault::Forged { from, to, count })
    }

    /// A network in which nothing goes wrong but that what routers send to one port comes to another.
    pub fn strayed(seed: u64) -> Self {
        Self::deceived(seed, |(from, to), count| Fault::Stray { from, to, count: 1 + count })
    }

    /// A network in which nothing goes wrong but such faults, of a sender and a receiver.
    fn deceived(seed: u64, fault: impl Fn((usize, usize), u64) -> Fault) -> Self {
        let mut plan = Self::calm(seed);
        let mut chance = Chance::new(seed ^ 0xf0_9ed);
        for _ in 0..chance.between(10, 100) {
            let from = chance.below(plan.nodes.len() as u64) as usize;
            let to = (from + 1 + chance.below(plan.nodes.len() as u64 - 1) as usize) % plan.nodes.len();
            // When all have heard each other.
            let (at_ns, count) = (chance.between(S, plan.traffic_end_ns), chance.scale(1, 20));
            plan.faults.push(Planned { from_ns: at_ns, until_ns: at_ns, fault: fault((from, to), count) });
        }
        plan
    }

    /// A network in which nothing goes wrong: from one node to another hundreds of flows pass a package in many parts,
    /// which is less urgent.
    pub fn crowded(seed: u64) -> Self {
        let mut plan = Self::calm(seed);
        let mut chance = Chance::new(seed ^ 0xc_04d);
        plan.nodes.truncate(2);
        plan.masters = vec![0, 1];
        plan.calls.clear();
        plan.flows.clear();
        (plan.shape.datagram_bytes_max, plan.shape.rate_bytes_s) = (1472, chance.between(1 << 20, 4 << 20));
        let (all, small_bytes) = (plan.shape.rate_bytes_s, 60);
        // Both small ones take half of the rate, the large ones a quarter.
        let small = (small_bytes, 4 * (small_bytes + 100) * S / all, true);
        let large_bytes = chance.between(20_000, 60_000);
        let large = (large_bytes, 4 * large_bytes * S / all, false);
        for (most, period_ns, is_mixed) in [small, small, large] {
            let [from, to] = [0, 1].map(|node| chance.pick(&plan.nodes[node].modules));
            let (to, bytes) = (to.with_local(rohrpost_mailbox::local::DATA), (most / 2, most));
            plan.flows.push(Flow { node: 0, from, to, priority: 0, period_ns, bytes, is_mixed, burst: 1 });
        }
        plan.fixed_ns = S;
        plan.time();
        plan
    }

    /// A network in which nothing goes wrong.
    pub fn calm(seed: u64) -> Self {
        let mut plan = Self::small(seed);
        plan.calm_down();
        plan
    }

    /// Nothing goes wrong any more.
    pub(super) fn calm_down(&mut self) {
        self.faults.clear();
        self.flows.retain(|flow| flow.burst == 1);
        self.quality = fixed(self.quality);
        self.checksum = true;
    }
}

/// What is left of a link's quality after the faults.
pub(crate) fn fixed(quality: Quality) -> Quality {
    Quality { loss_ppm: 0, copy_ppm: 0, reorder_ppm: 0, damage_ppm: 0, rate_bytes_s: 0, ..quality }
}

/// Of an incarnation of a router: never the same again, and in no order.
pub(super) fn incarnation(seed: u64, life: u32) -> u64 {
    (seed << 20 | u64::from(life)).wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1
}
