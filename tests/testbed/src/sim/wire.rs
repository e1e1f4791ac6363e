//! The wire of a network with time slots, by true time: when each node transmits, and that no two do at once.

use super::clock::Now;
use super::promise::{Problem, Promise};
use super::slots::Slots;
use super::spans::US;
use super::transmission::{Basis, SendBasis, Transmission};
use rohrpost_routers::time::Term;
use std::collections::{BTreeMap, VecDeque};

/// From the call to the first bit, ns: usually the shorter, and by chance up to the longer.
pub(crate) const LEAD_NS: (u64, u64) = (8 * US, 20 * US);
/// Clocks change their rate a little meanwhile, and stamps are a little off, ns.
const SLACK_NS: u64 = US;
/// Transmissions that one which begins now may still meet.
const RECENT_MAX: usize = 64;

/// All that was transmitted lately.
#[derive(Default, Debug)]
pub(crate) struct Wire {
    /// When each node's interface is free again, true ns.
    free_ns: Vec<u64>,
    /// By what each sends.
    says: Vec<SendBasis>,
    /// When each began the window in which it sends, on its clock, ns.
    called_ns: Vec<u64>,
    /// When somebody first sent by a term, true ns.
    first_ns: BTreeMap<(u64, Term), u64>,
    recent: VecDeque<Transmission>,
}

impl Wire {
    pub(crate) fn new(nodes: usize) -> Self {
        Self {
            free_ns: vec![0; nodes],
            says: vec![SendBasis::default(); nodes],
            called_ns: vec![0; nodes],
            first_ns: BTreeMap::new(),
            recent: VecDeque::with_capacity(RECENT_MAX),
        }
    }

    /// From now on a node sends by this. It may have begun a time before.
    pub(crate) fn goes_by(&mut self, now: Now, node: usize, says: SendBasis) {
        self.first_ns.entry((says.digest, says.term)).or_insert(now.true_ns);
        self.called_ns[node] = now.monotonic_ns;
        let before = self.says[node].basis;
        let goes_on = matches!((before, says.basis), (Basis::Begins { .. }, Basis::Begins { .. }));
        self.says[node] = SendBasis { basis: if goes_on { before } else { says.basis }, ..says };
    }

    /// What is wrong with a datagram that was handed over, and was on the wire from then to then, on the clock of its
    /// node.
    pub(crate) fn window(&self, node: usize, bytes: usize, slots: &Slots, local_ns: [u64; 2]) -> Option<String> {
        let Some(estimate) = self.says[node].estimate else {
            return Some(format!("node {node}, {bytes} bytes, by no time"));
        };
        let [begin_ns, end_ns] = local_ns.map(|local_ns| estimate.system_ns(local_ns));
        let called_ns = estimate.system_ns(self.called_ns[node]);
        let window = slots.window(node, called_ns + LEAD_NS.1);
        let is_well = window.as_ref().is_some_and(|(window, late_ns)| {
            // A node that does not know its lead yet may end later by as much, others by what it varies.
            let ends = end_ns <= window.end + LEAD_NS.1 + SLACK_NS;
            begin_ns + SLACK_NS >= window.start && ends && called_ns <= window.start + late_ns + SLACK_NS
        });
        let told =
            || format!("node {node}, {bytes} bytes, called at {called_ns}, from {begin_ns} to {end_ns} in {window:?}");
        (!is_well).then(told)
    }

    /// A node hands over a datagram that will reach its interface then; `bytes` with all heads. What comes of it, and
    /// whether it meets another.
    pub(crate) fn transmit(
        &mut self,
        node: usize,
        at_ns: u64,
        bytes: usize,
        slots: &Slots,
        problems: &mut Vec<Problem>,
    ) -> Transmission {
        let begin_ns = at_ns.max(self.free_ns[node]);
        let end_ns = begin_ns + slots.takes_ns(bytes);
        self.free_ns[node] = end_ns;
        let SendBasis { basis, digest, term, .. } = self.says[node];
        let master = slots.master(term);
        let own = Transmission { node, basis, digest, term, master, begin_ns, end_ns };
        let mut meets = self.recent.iter().filter(|other| other.node != node && own.meets(other));
        let began_ns = |sends: &Transmission| self.first_ns.get(&(sends.digest, sends.term)).copied().unwrap_or(0);
        let is_blamed =
            |other: &&Transmission| !slots.divisions.excuse(&own, other, began_ns(&own).min(began_ns(other)));
        if let Some(other) = meets.find(is_blamed) {
            let text = format!("{own:?} and {other:?} at once");
            problems.push(Problem { promise: Promise::Exclusive, at_ns: begin_ns, text });
        }
        if self.recent.len() == RECENT_MAX {
            self.recent.pop_front();
        }
        self.recent.push_back(own);
        own
    }
}
