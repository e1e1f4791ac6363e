//! The true state of a world against its nodes' claims: the time of each term, and what must hold at any moment.

use super::{Oscillator, World};
use crate::frame::NodeIndex;
use crate::time::Role;
use rohrpost_mailbox::TimeRecord;

/// The time of a term: its master's line at the beginning, shifted so that it continues the time before.
#[derive(Clone, Copy)]
pub(super) struct TermTime {
    node: NodeIndex,
    oscillator: Oscillator,
    record: TimeRecord,
    shift_ns: i128,
}

impl TermTime {
    fn at(&self, true_ns: u64) -> i128 {
        i128::from(self.record.at(self.oscillator.local_ns(true_ns)).ns) + self.shift_ns
    }
}

impl World {
    /// The clock of the master's computer is set, and a new epoch begins at it.
    pub(in crate::time::tests) fn set_clock(&mut self, node: NodeIndex, wall_ns: u64) {
        let local_ns = self.local_ns(node);
        let one = &mut self.nodes[usize::from(node)];
        let Some(clock) = &mut one.clock else { return };
        assert!(clock.begin_time(local_ns, wall_ns), "{}", self.replay);
        self.check(node);
    }

    /// Everything that must hold of a node at any moment.
    pub(super) fn check(&mut self, node: NodeIndex) {
        let (now, local_ns) = (self.now, self.local_ns(node));
        self.check_term(node);
        let one = &mut self.nodes[usize::from(node)];
        let is_slave = one.clock.as_ref().is_some_and(|clock| clock.role() == Role::Slave);
        if let Some(clock) = &one.clock {
            let term = clock.reading(local_ns).term;
            one.page = Some(*clock.record());
            one.page_term = if term.is_none() { one.page_term } else { term };
        }
        let Some(page) = one.page else { return };
        let (time, term) = (page.at(local_ns), one.page_term);
        let last = one.last.replace((time.epoch, time.ns));
        if let Some((epoch, ns)) = last
            && (time.epoch < epoch || (time.epoch == epoch && time.ns < ns))
        {
            self.fail(&format!(
                "node {node} goes back: epoch {epoch} to {}, by {} ns",
                time.epoch,
                ns.wrapping_sub(time.ns)
            ));
        }
        let truth = self.terms.get(&term.0).filter(|_| page.error_ns < rohrpost_mailbox::ERROR_UNKNOWN_NS);
        let Some(truth) = truth else { return };
        let off_ns = (i128::from(time.ns) - truth.at(now)).unsigned_abs();
        if off_ns > time.error.as_nanos() {
            let tell = format!("node {node} is off by {off_ns} ns, and says {:?}\n{}", time.error, self.tell());
            self.fail(&tell);
        }
        if is_slave {
            self.errors.push((off_ns as u64, time.error.as_nanos() as u64));
        }
    }

    /// A new master begins a term, which continues the time before unless an epoch began.
    fn check_term(&mut self, node: NodeIndex) {
        let one = &self.nodes[usize::from(node)];
        let Some(clock) = one.clock.as_ref().filter(|clock| clock.role() == Role::Master) else { return };
        let (term, record, oscillator) = (clock.term(), *clock.record(), one.oscillator);
        if let Some(known) = self.terms.get(&term.0) {
            if known.node != node {
                self.fail(&format!("nodes {node} and {} are masters of {term:?}", known.node));
            }
            return;
        }
        let mut begun = TermTime { node, oscillator, record, shift_ns: 0 };
        let before = self.terms.get(&one.page_term.0);
        if let (Some(before), Some(page)) = (before, one.page)
            && page.epoch == record.epoch
        {
            begun.shift_ns = before.at(self.now) - begun.at(self.now);
        }
        self.terms.insert(term.0, begun);
        self.begun.push((self.now, node));
    }
}
