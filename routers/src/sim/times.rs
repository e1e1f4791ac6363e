//! What system time is, by the simulation's own clock: the time of each term, and what every node's page says of it.
//!
//! The time of a term is its master's line, as it stood when the master began to reign, shifted so that it goes on from the time that
//! this node had followed before. A page's bound must contain its distance from the time of the term that it follows.

use super::book::{Problem, Promise};
use super::clock::{Clock, Now};
use crate::time::{Clock as Core, Role, Term};
use rohrpost_mailbox::{ERROR_UNKNOWN_NS, TimeRecord};
use std::collections::BTreeMap;

/// The line of a term.
#[derive(Clone, Copy, Debug)]
struct Line {
    node: usize,
    record: TimeRecord,
    shift_ns: i128,
}

/// A node's page of system time; it outlives a router.
#[derive(Clone, Copy, Default, Debug)]
struct Page {
    record: Option<TimeRecord>,
    /// The term that it follows.
    term: Term,
    /// Epoch and time that it was last seen to say.
    last: Option<(u64, u64)>,
}

/// All pages and terms.
#[derive(Default)]
pub struct Times {
    /// The clocks of all nodes.
    pub clocks: Vec<Clock>,
    lines: BTreeMap<u64, Line>,
    pages: Vec<Page>,
    /// Largest bound of a node that follows a master, and largest error, ns.
    pub worst_ns: (u64, u64),
}

impl Times {
    /// Of these nodes.
    pub fn new(clocks: Vec<Clock>) -> Self {
        Self { pages: vec![Page::default(); clocks.len()], clocks, ..Self::default() }
    }

    /// What a node's page says, for its next router.
    pub fn page(&self, node: usize) -> Option<TimeRecord> {
        self.pages.get(node)?.record
    }

    /// How far a node's page is off the time of a term, ns; none if nobody began that.
    pub fn off_ns(&self, now: Now, node: usize, term: Term) -> Option<u64> {
        let (line, record) = (self.lines.get(&term.0)?, self.pages[node].record?);
        let off_ns = i128::from(record.at(now.monotonic_ns).ns) - self.at(line, now.true_ns);
        u64::try_from(off_ns.unsigned_abs()).ok()
    }

    /// What time it is by the master of a term, ns; none if nobody began that.
    pub fn of_term_ns(&self, now: Now, term: Term) -> Option<u64> {
        let line = self.lines.get(&term.0)?;
        Some(line.record.at(self.clocks[line.node].at(now.true_ns).monotonic_ns).ns)
    }

    /// Looks at a node after its layer of time did anything: its reign, and what its page says from now on.
    pub fn look(&mut self, now: Now, node: usize, core: &Core, problems: &mut Vec<Problem>) {
        if core.role() == Role::Master {
            self.reigns(now, node, core, problems);
        }
        let term = core.reading(now.monotonic_ns).term;
        let page = &mut self.pages[node];
        page.record = Some(*core.record());
        page.term = if term.is_none() { page.term } else { term };
        self.read(now, node, problems);
    }

    /// A module reads its node's page, whether its router lives or not.
    pub fn read(&mut self, now: Now, node: usize, problems: &mut Vec<Problem>) {
        let page = &mut self.pages[node];
        let Some(record) = page.record else { return };
        let time = record.at(now.monotonic_ns);
        let broken = |promise, text| Problem { promise, at_ns: now.true_ns, text };
        if let Some((epoch, ns)) = page.last.replace((time.epoch, time.ns))
            && (time.epoch < epoch || (time.epoch == epoch && time.ns < ns))
        {
            let text = format!("node {node} goes back from {ns} ns of epoch {epoch} to {time:?}");
            problems.push(broken(Promise::TimeForward, text));
        }
        let term = page.term;
        let Some(line) = self.lines.get(&term.0).filter(|_| record.error_ns < ERROR_UNKNOWN_NS) else { return };
        let off_ns = (i128::from(time.ns) - self.at(line, now.true_ns)).unsigned_abs();
        if off_ns > time.error.as_nanos() {
            let text = format!("node {node} is {off_ns} ns off the time of {term:?}, and says {time:?}");
            problems.push(broken(Promise::TimeBound, text));
        }
        self.worst_ns = (self.worst_ns.0.max(record.error_ns), self.worst_ns.1.max(off_ns as u64));
    }

    fn at(&self, line: &Line, true_ns: u64) -> i128 {
        i128::from(line.record.at(self.clocks[line.node].at(true_ns).monotonic_ns).ns) + line.shift_ns
    }

    /// A master that was none before begins a term, which goes on from the time before unless an epoch began.
    fn reigns(&mut self, now: Now, node: usize, core: &Core, problems: &mut Vec<Problem>) {
        let (term, record) = (core.term(), *core.record());
        if let Some(known) = self.lines.get(&term.0) {
            if known.node != node {
                let text = format!("nodes {node} and {} are masters of {term:?}", known.node);
                problems.push(Problem { promise: Promise::OneMaster, at_ns: now.true_ns, text });
            }
            return;
        }
        let mut line = Line { node, record, shift_ns: 0 };
        let page = self.pages[node];
        if let (Some(before), Some(old)) = (self.lines.get(&page.term.0), page.record)
            && old.epoch == record.epoch
        {
            line.shift_ns = self.at(before, now.true_ns) - self.at(&line, now.true_ns);
        }
        self.lines.insert(term.0, line);
    }
}
