//! What system time is, by the simulation's own clock: the time of each term, and what every node's page says of it.
//!
//! The time of a term is its master's line, as it stood when its term began, shifted so that it goes on from the time
//! that this node had followed before. A page's bound must contain its distance from the time of the term that it
//! follows.

use super::clock::{Clock, Now};
use super::promise::{Problem, Promise};
use rohrpost_mailbox::{ERROR_UNKNOWN_NS, TimeRecord, Watched};
use rohrpost_routers::time::{Clock as Core, Role, Term};
use std::collections::BTreeMap;

/// After so long a node knows that its clock does what bounds exclude: it looks once a cycle, or ten times a second,
/// and its thread may wake late.
const NOTICED_NS: u64 = 120_000_000;

/// The line of a term.
#[derive(Clone, Copy, Debug)]
struct TermTimeline {
    node: usize,
    record: TimeRecord,
    /// None: it goes on from one that nobody knows.
    shift_ns: Option<i128>,
    /// Its master's clock did meanwhile what bounds exclude: nobody knows any more what it would say.
    is_void: bool,
}

/// A node's page of system time; it outlives a router.
#[derive(Clone, Copy, Default, Debug)]
struct Page {
    record: Option<TimeRecord>,
    /// The term that it follows, of which configuration.
    digest: u64,
    term: Term,
    /// Its clock did what bounds exclude: since when its router can have noticed, true ns; none: it has not run since.
    is_changed: bool,
    noticed_ns: Option<u64>,
    /// When its router looked last, true ns: a router that stands still notices nothing.
    looked_ns: u64,
    /// For how long the computer had slept when that was written.
    slept_ns: u64,
    watched: Option<Watched>,
    /// Epoch and time that it was last seen to say.
    last: Option<(u64, u64)>,
}

/// What the routers of a node leave to the next one.
#[derive(Clone, Copy, Default, Debug)]
pub(crate) struct Left {
    /// What the page says.
    pub(crate) record: Option<TimeRecord>,
    /// What was seen last of the clocks.
    pub(crate) watched: Option<Watched>,
}

#[derive(Default)]
pub(crate) struct Times {
    pub(crate) clocks: Vec<Clock>,
    /// By the digest of the configuration, and the term.
    lines: BTreeMap<(u64, Term), TermTimeline>,
    pages: Vec<Page>,
    /// Largest bound of a node that follows a master, and largest error, ns.
    pub(crate) worst_ns: (u64, u64),
}

impl Times {
    pub(crate) fn new(clocks: Vec<Clock>) -> Self {
        Self { pages: vec![Page::default(); clocks.len()], clocks, ..Self::default() }
    }

    /// What a node's page says, for its next router.
    ///
    /// As a reader of the page has it: of a computer that has slept since, nobody knows how far off it is.
    pub(crate) fn page(&self, now: Now, node: usize) -> Option<TimeRecord> {
        let page = self.pages.get(node)?;
        page.record.map(|record| record.after_sleep(now.slept_ns.saturating_sub(page.slept_ns)))
    }

    /// What a node's next router goes on from.
    pub(crate) fn left(&self, now: Now, node: usize) -> Left {
        Left { record: self.page(now, node), watched: self.pages.get(node).and_then(|page| page.watched) }
    }

    /// How far a node's page is off what the master of a term of a configuration says, ns; none if nobody began that.
    pub(crate) fn off_ns(&self, now: Now, node: usize, (digest, term): (u64, Term)) -> Option<u64> {
        let (line, record) = (self.lines.get(&(digest, term))?, self.pages[node].record?);
        Some(record.at(now.monotonic_ns).ns.abs_diff(self.of_line_ns(line, now.true_ns)))
    }

    /// What time it is by the master of a term of a configuration, ns; none if nobody began that.
    pub(crate) fn of_term_ns(&self, now: Now, (digest, term): (u64, Term)) -> Option<u64> {
        let line = self.lines.get(&(digest, term)).filter(|line| !line.is_void)?;
        Some(self.of_line_ns(line, now.true_ns))
    }

    /// A node's clock does what bounds exclude. What time it is by those terms in which it is master, nobody can say
    /// any more.
    pub(crate) fn changes(&mut self, clock: &Clock, node: usize) {
        self.clocks[node] = clock.clone();
        let page = &mut self.pages[node];
        (page.is_changed, page.noticed_ns) = (true, None);
        self.lines.values_mut().filter(|line| line.node == node).for_each(|line| line.is_void = true);
    }

    /// Looks at a node after its layer of time did anything: whether it is master.
    pub(crate) fn look(&mut self, now: Now, node: usize, core: &Core, problems: &mut Vec<Problem>) {
        if core.role() == Role::Master {
            self.leads(now, node, core, problems);
        }
    }

    /// A node's layer of time lets others see how it stands; its page says `record` from now on.
    pub(crate) fn publish(
        &mut self,
        now: Now,
        node: usize,
        core: &Core,
        record: Option<TimeRecord>,
        problems: &mut Vec<Problem>,
    ) {
        let term = core.reading(now.monotonic_ns).term;
        let page = &mut self.pages[node];
        page.noticed_ns.get_or_insert(now.true_ns);
        page.looked_ns = now.true_ns;
        (page.slept_ns, page.watched) = (now.slept_ns, core.watched());
        page.record = record;
        if !term.is_none() {
            (page.digest, page.term) = (core.digest(), term);
        }
        self.read(now, node, problems);
    }

    /// A module reads its node's page, whether its router lives or not.
    pub(crate) fn read(&mut self, now: Now, node: usize, problems: &mut Vec<Problem>) {
        let Some(record) = self.page(now, node) else { return };
        let page = &mut self.pages[node];
        // What the page said before a thread that is busy wrote it, nobody knows any more.
        if now.true_ns < page.looked_ns {
            return;
        }
        let time = record.at(now.monotonic_ns);
        let broken = |promise, text| Problem { promise, at_ns: now.true_ns, text };
        if let Some((epoch, ns)) = page.last.replace((time.epoch, time.ns))
            && (time.epoch < epoch || (time.epoch == epoch && time.ns < ns))
        {
            let text = format!("node {node} goes back from {ns} ns of epoch {epoch} to {time:?}");
            problems.push(broken(Promise::TimeForward, text));
        }
        let (digest, term) = (page.digest, page.term);
        let is_slewed = self.clocks[node].is_slewed();
        if page.is_changed && page.noticed_ns.is_none_or(|noticed_ns| page.looked_ns < noticed_ns + NOTICED_NS) {
            return;
        }
        if is_slewed && record.error_ns < ERROR_UNKNOWN_NS {
            let text = format!("node {node} is slewed, and says {time:?}");
            return problems.push(broken(Promise::TimeBound, text));
        }
        let line = self.lines.get(&(digest, term)).filter(|line| !line.is_void && record.error_ns < ERROR_UNKNOWN_NS);
        let Some(line_ns) = line.and_then(|line| self.at(line, now.true_ns)) else { return };
        let off_ns = (i128::from(time.ns) - line_ns).unsigned_abs();
        if off_ns > time.error.as_nanos() {
            let text = format!("node {node} is {off_ns} ns off the time of {term:?}, and says {time:?}");
            problems.push(broken(Promise::TimeBound, text));
        }
        self.worst_ns = (self.worst_ns.0.max(record.error_ns), self.worst_ns.1.max(off_ns as u64));
    }

    fn at(&self, line: &TermTimeline, true_ns: u64) -> Option<i128> {
        Some(i128::from(self.of_line_ns(line, true_ns)) + line.shift_ns?)
    }

    /// What its master says.
    fn of_line_ns(&self, line: &TermTimeline, true_ns: u64) -> u64 {
        line.record.at(self.clocks[line.node].at(true_ns).monotonic_ns).ns
    }

    /// A master that was none before begins a term, which goes on from the time before unless an epoch began.
    fn leads(&mut self, now: Now, node: usize, core: &Core, problems: &mut Vec<Problem>) {
        let (digest, term, record) = (core.digest(), core.term(), *core.record());
        if let Some(known) = self.lines.get(&(digest, term)) {
            if known.node != node {
                let text = format!("nodes {node} and {} are masters of {term:?}", known.node);
                problems.push(Problem { promise: Promise::OneMaster, at_ns: now.true_ns, text });
            }
            return;
        }
        let mut line = TermTimeline { node, record, shift_ns: Some(0), is_void: self.clocks[node].is_slewed() };
        let page = self.pages[node];
        if let (Some(before), Some(old)) = (self.lines.get(&(page.digest, page.term)), page.record)
            && old.epoch == record.epoch
        {
            let before_ns = self.at(before, now.true_ns).filter(|_| !before.is_void);
            line.shift_ns = before_ns.map(|before_ns| before_ns - i128::from(self.of_line_ns(&line, now.true_ns)));
        }
        self.lines.insert((digest, term), line);
    }
}
