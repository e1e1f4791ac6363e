//! The lease of a module with several nodes, as a plan has it.

use super::host::TRANSIT_AGE_MAX_NS;
use rohrpost_mailbox::Name;
use rohrpost_routers::moving::MovingNames;
use rohrpost_supervision::lease::Terms;
use std::sync::Arc;

/// The lease of a network's module.
#[derive(Clone, Debug)]
pub(crate) struct LeasePlan {
    pub(crate) seed: u64,
    /// The module.
    pub(crate) name: Name,
    pub(crate) terms: Terms,
    /// So long a process needs to be off, ns.
    pub(crate) off_ns: u64,
    /// Node of which the launch grants it.
    pub(crate) witness: usize,
    /// Nodes that may run it, first choice first.
    pub(crate) candidates: Vec<usize>,
    /// Nodes that hear what it publishes.
    pub(crate) hearers: Vec<usize>,
    /// How much the clocks of the launches run fast, ns a second.
    pub(crate) rates_ppb: Vec<i64>,
    /// The longest way of a question after the faults, with that of its answer and the time that both wait in routers,
    /// ns.
    pub(crate) way_ns: u64,
    /// So long a router needs to join a network with time slots, ns; without them 0.
    pub(crate) joins_ns: u64,
    /// What the router of each node knows of where it is.
    pub(crate) moving: Vec<Arc<MovingNames>>,
}

impl LeasePlan {
    /// Nothing is known of where the module is.
    pub(crate) fn begin(&mut self) {
        let of_node = |_: &i64| Arc::new(MovingNames::new(vec![self.name], self.rates_ppb.len()));
        self.moving = self.rates_ppb.iter().map(of_node).collect();
    }

    /// Place of a node in the order of choice.
    pub(crate) fn place_of(&self, node: usize) -> Option<u8> {
        self.candidates.iter().position(|candidate| *candidate == node).map(|place| place as u8)
    }

    /// So long after the last fault somebody holds it, ns: a lease that nobody knows of, the time in which a better
    /// choice that has died is waited for, and questions.
    pub(crate) fn settling_ns(&self) -> u64 {
        let settling_ns = 2 * self.terms.lease_ns() + 4 * (self.terms.ask_every_ns() + self.way_ns);
        settling_ns + settling_ns * 3 * u64::from(self.terms.rate_error_ppm()) / 1_000_000
    }

    /// So long after all faults are over, packages that waited are gone, and somebody holds it, ns.
    pub(crate) fn well_after_ns(&self) -> u64 {
        TRANSIT_AGE_MAX_NS + self.settling_ns()
    }
}
