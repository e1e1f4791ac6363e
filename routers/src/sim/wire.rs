//! The wire of a network with time slots, by true time: when each node transmits, and that no two do at once.

use super::book::{Problem, Promise};
use super::clock::Now;
use super::plan::US;
use super::slots::Slots;
use crate::tdma::LATE_NS;
use crate::time::{Reckoning, Term};
use std::collections::{BTreeMap, VecDeque};

/// From the call to the first bit, ns: usually the shorter, and by chance up to the longer.
pub const LEAD_NS: (u64, u64) = (8 * US, 20 * US);
/// Clocks change their rate a little meanwhile, and stamps are a little off, ns.
const SLACK_NS: u64 = US;
/// Transmissions that one which begins now may still meet.
const RECENT_MAX: usize = 64;

/// A datagram that is being transmitted.
#[derive(Clone, Copy, Debug)]
pub struct Transmission {
    /// Who does.
    pub node: usize,
    /// The term whose time it keeps; none: it asks what time it is.
    pub term: Term,
    /// It only says that it began a time.
    pub begins: bool,
    /// First and last bit, true ns.
    pub begin_ns: u64,
    /// See `begin_ns`.
    pub end_ns: u64,
}

/// All that was transmitted lately.
#[derive(Default, Debug)]
pub struct Wire {
    /// When each node's interface is free again, true ns.
    free_ns: Vec<u64>,
    /// When the router of each began, true ns.
    began_ns: Vec<u64>,
    /// The term that each goes by.
    terms: Vec<Term>,
    /// When somebody first sent by a term, true ns.
    first_ns: BTreeMap<Term, u64>,
    /// Whether each only says that it began a time.
    begins: Vec<bool>,
    /// What each reckons by.
    reckonings: Vec<Option<Reckoning>>,
    recent: VecDeque<Transmission>,
}

impl Wire {
    /// Of so many nodes.
    pub fn new(nodes: usize) -> Self {
        Self {
            free_ns: vec![0; nodes],
            began_ns: vec![0; nodes],
            terms: vec![Term::NONE; nodes],
            first_ns: BTreeMap::new(),
            begins: vec![false; nodes],
            reckonings: vec![None; nodes],
            recent: VecDeque::with_capacity(RECENT_MAX),
        }
    }

    /// The router of a node begins.
    pub fn begins(&mut self, node: usize, true_ns: u64) {
        (self.began_ns[node], self.terms[node]) = (true_ns, Term::NONE);
    }

    /// From now on a node sends by the time of this term; none: by what it has heard only. `begins`: it sends only to say that it began one.
    pub fn goes_by(&mut self, now: Now, node: usize, term: Term, reckoning: Option<Reckoning>, begins: bool) {
        self.first_ns.entry(term).or_insert(now.true_ns);
        (self.terms[node], self.reckonings[node], self.begins[node]) = (term, reckoning, begins);
    }

    /// What is wrong with a datagram that was handed over, and was on the wire from then to then, on the clock of its node.
    pub fn window(&self, node: usize, bytes: usize, slots: &Slots, local_ns: [u64; 3]) -> Option<String> {
        let reckoning = self.reckonings[node]?;
        let [called_ns, begin_ns, end_ns] = local_ns.map(|local_ns| reckoning.system_ns(local_ns));
        let window = slots.window(node, called_ns + LEAD_NS.1);
        let is_well = window.as_ref().is_some_and(|window| {
            // Who does not know its lead yet may end later by as much, who does by what it varies.
            let ends = end_ns <= window.end + LEAD_NS.1 + SLACK_NS;
            begin_ns + SLACK_NS >= window.start && ends && called_ns <= window.start + LATE_NS + SLACK_NS
        });
        let told =
            || format!("node {node}, {bytes} bytes, called at {called_ns}, from {begin_ns} to {end_ns} in {window:?}");
        (!is_well).then(told)
    }

    /// A node hands over a datagram that will reach its interface then; `bytes` with all heads. What comes of it, and whether it meets
    /// another.
    pub fn transmit(
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
        let term = self.terms[node];
        let own = Transmission { node, term, begins: self.begins[node], begin_ns, end_ns };
        // Of two that begin a time neither can know of the other before it has heard its first frame.
        let counts = |other: &&Transmission| other.node != node && !(own.begins && other.begins);
        let meets = self.recent.iter().filter(counts).find(|other| own.meets(other));
        if let Some(other) = meets {
            // Who goes by what it hears relies on links that are as good as they should be.
            let is_coarse = term.is_none() || other.term.is_none();
            let began_ns = self.began_ns[node].max(self.began_ns[other.node]);
            let began_ns = if is_coarse { begin_ns } else { began_ns };
            let same = term == other.term && !term.is_none();
            // Of two that begin a time in parts of a divided network neither can ever hear.
            let first_ns = |term| self.first_ns.get(&term).copied().unwrap_or(0);
            let elder_ns = first_ns(term).min(first_ns(other.term));
            if same || !(slots.is_excused(begin_ns, began_ns) || slots.is_excused(begin_ns, elder_ns)) {
                let text = format!("{own:?} and {other:?} at once");
                problems.push(Problem { promise: Promise::Exclusive, at_ns: begin_ns, text });
            }
        }
        if self.recent.len() == RECENT_MAX {
            self.recent.pop_front();
        }
        self.recent.push_back(own);
        own
    }
}

impl Transmission {
    fn meets(&self, other: &Self) -> bool {
        self.begin_ns < other.end_ns && other.begin_ns < self.end_ns
    }
}
