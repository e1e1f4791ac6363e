//! The masters of time, as seen on the bridge: from when to when, as master or as backup.

use super::sealed_capture::SealedCapture;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::lab::Crossing;
use rohrpost_routers::time::Term;
use rohrpost_routers::time::message::{Message, Sync};
use std::collections::VecDeque;

/// The oldest are dropped first. On a busy computer, a backup master stands in for about one cycle in some hundred.
const REIGNS_MAX: usize = 10_000;

/// Consecutive cycles of one node.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct MasterTerm {
    pub(super) node: NodeIndex,
    /// It stood in for a master that was not heard.
    pub(super) replacement: bool,
    pub(super) term: Term,
    /// When its first frame crossed the bridge, monotonic ns.
    pub(super) first_ns: u64,
    pub(super) first_cycle: u64,
    /// When its last frame did.
    pub(super) last_ns: u64,
    pub(super) last_cycle: u64,
}

impl MasterTerm {
    /// Number of its cycles.
    pub(super) fn cycles(&self) -> u64 {
        self.last_cycle - self.first_cycle + 1
    }
}

/// All terms, in order.
#[derive(Default)]
pub(super) struct Masters {
    capture: SealedCapture,
    list: VecDeque<MasterTerm>,
}

impl Masters {
    /// No node has sent the time yet.
    pub(super) fn heard_with(capture: SealedCapture) -> Self {
        Self { capture, ..Self::default() }
    }

    /// Records a datagram, if it is one of time.
    pub(super) fn note(&mut self, crossing: &Crossing<'_>) {
        if let Some((head, Message::Sync(sync))) = self.capture.hear(crossing.datagram) {
            self.told(head.from, crossing.at_ns, &sync);
        }
    }

    fn told(&mut self, node: NodeIndex, at_ns: u64, sync: &Sync) {
        let Sync { cycle, term, replacement, .. } = *sync;
        let goes_on = |last: &&mut MasterTerm| {
            let same = (last.node, last.replacement, last.term) == (node, replacement, term);
            same && (last.last_cycle..=last.last_cycle + 1).contains(&cycle)
        };
        if let Some(last) = self.list.back_mut().filter(goes_on) {
            (last.last_ns, last.last_cycle) = (at_ns, cycle);
            return;
        }
        if self.list.len() == REIGNS_MAX {
            self.list.pop_front();
        }
        let (first_ns, last_ns, first_cycle, last_cycle) = (at_ns, at_ns, cycle, cycle);
        self.list.push_back(MasterTerm { node, replacement, term, first_ns, first_cycle, last_ns, last_cycle });
    }

    /// The last term as master before this moment.
    pub(super) fn master_at(&self, at_ns: u64) -> Option<&MasterTerm> {
        self.list.iter().rev().find(|term| !term.replacement && term.first_ns <= at_ns)
    }

    /// This node's last term as master that began before this moment.
    pub(super) fn last_of(&self, node: usize, at_ns: u64) -> Option<&MasterTerm> {
        let is_it = |term: &&MasterTerm| usize::from(term.node) == node && !term.replacement && term.first_ns <= at_ns;
        self.list.iter().rev().find(is_it)
    }

    /// Terms that began after this moment, in order.
    pub(super) fn since(&self, at_ns: u64) -> impl Iterator<Item = &MasterTerm> {
        self.list.iter().filter(move |term| term.first_ns > at_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn masters(told: &[(NodeIndex, u64, bool)]) -> Masters {
        let mut masters = Masters::default();
        for (node, cycle, replacement) in told {
            let sync = Sync { cycle: *cycle, replacement: *replacement, term: Term::new(1, 0), ..Sync::default() };
            masters.told(*node, cycle * 1000, &sync);
        }
        masters
    }

    #[test]
    fn a_term_ends_with_another_node_another_role_or_a_missing_cycle() {
        let told =
            [(0, 1, false), (0, 1, false), (0, 2, false), (1, 3, true), (1, 4, true), (1, 5, false), (1, 7, false)];
        let masters = masters(&told);
        let seen: Vec<_> = masters.since(0).map(|term| (term.node, term.replacement, term.cycles())).collect();
        assert_eq!(seen, [(0, false, 2), (1, true, 2), (1, false, 1), (1, false, 1)]);
        assert_eq!(masters.master_at(4000).map(|term| term.node), Some(0), "a backup is no master");
        assert_eq!(masters.master_at(5000).map(|term| term.node), Some(1));
        assert_eq!(masters.master_at(999), None);
        assert_eq!(masters.last_of(0, 9000).map(|term| term.last_cycle), Some(2));
        assert_eq!(masters.last_of(1, 4999), None);
        assert_eq!(masters.since(2000).next().map(|term| term.first_cycle), Some(3));
    }
}
