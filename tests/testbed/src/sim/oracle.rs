//! The books of a simulated network: every package with its fate, and what must hold of them. Cores never see it.
//!
//! ```text
//!  posted ─▶ in the transit mailbox ─▶ accepted ─▶ left, in datagrams ─▶ handed in ─▶ delivered
//!               │ displaced, stale        │ counted: quota, stale, silent…   │ lost     │ counted: late, full, copy…
//! ```

use super::clock::Now;
use super::lives::{Receiving, Sending};
use super::package::{Package, Role, SendStage, admitted};
use super::promise::{Problem, Promise};
use super::replicas::RecordBooks;
use super::table::Table;
use super::times::Times;
use super::wire::Wire;
use rohrpost_mailbox::{Head, Name};
use rohrpost_network::LEVELS;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::time::Term;
use std::collections::BTreeMap;
use std::rc::Rc;

#[derive(Default)]
pub(crate) struct Oracle {
    pub(crate) packages: Vec<Package>,
    places: Table<(Name, Name, u8), u32>,
    ids: Table<(Name, Name, i16), u16>,
    /// Packages by what their heads tell them apart by.
    by_head: Table<(Name, Name, i16, u16), u32>,
    /// Large packages by their first part: incarnation of the sender, receiver, sequence.
    pub(super) by_part: Table<(u64, NodeIndex, u64), u32>,
    /// What each incarnation of a router sent.
    pub(super) sending: BTreeMap<u32, Sending>,
    /// What each took.
    pub(super) receiving: BTreeMap<u32, Receiving>,
    /// When a router last took something of another, true ns, and the incarnations of both: receiver, sender.
    pub(super) heard: Table<(usize, usize), (u64, u32, u32)>,
    /// From posting to delivery at most, ns, by sender, mailbox and priority.
    pub(crate) slowest_ns: BTreeMap<(Name, Name, u8), u64>,
    pub(crate) records: RecordBooks,
    /// From writing to reading of a replica at most, ns.
    pub(crate) slowest_record_ns: u64,
    pub(crate) problems: Vec<Problem>,
    /// What was seen, so that a test knows that it saw enough.
    pub(crate) seen: BTreeMap<&'static str, u64>,
    /// Bodies are cut from it.
    pattern: Vec<u8>,
    /// Level of a priority.
    bulk_below: u8,
    pub(crate) is_sealed: bool,
    /// From then on all must be well, true ns.
    pub(crate) well_ns: u64,
    pub(crate) times: Times,
    /// Which node transmits when, with time slots.
    pub(crate) wire: Wire,
    /// The master, and its term, that all nodes must agree on by now.
    pub(crate) master: Option<(Option<NodeIndex>, Term)>,
}

const PATTERN_PRIME: usize = 251;

impl Oracle {
    pub(crate) fn new(bulk_below: u8) -> Self {
        let pattern = (0..u16::MAX as usize + PATTERN_PRIME).map(|n| (n % PATTERN_PRIME) as u8).collect();
        Self { pattern, bulk_below, ..Self::default() }
    }

    pub(crate) fn broken(&mut self, now: Now, promise: Promise, text: String) {
        self.problems.push(Problem { promise, at_ns: now.true_ns, text });
    }

    /// Counts something that was seen.
    pub(crate) fn saw(&mut self, what: &'static str) {
        *self.seen.entry(what).or_default() += 1;
    }

    /// Level of a package, 0 goes first.
    pub(crate) fn level(&self, priority: u8) -> usize {
        if priority < self.bulk_below { LEVELS - 1 } else { (15 - usize::from(priority >> 4)) * 2 }
    }

    /// A new package, from a node to a node: its number, its head with an id of its own, its body.
    pub(crate) fn post(
        &mut self,
        now: Now,
        mut head: Head,
        nodes: (usize, usize),
        role: Role,
    ) -> (u32, Head, Rc<[u8]>) {
        let number = self.packages.len() as u32;
        let id = self.ids.entry((head.from, head.to, head.kind.0)).or_default();
        *id = id.wrapping_add(1);
        head.id = *id;
        // As it is to leave.
        let leaving = if role == Role::Intruder { head } else { admitted(&head) };
        self.by_head.insert(key(&head), number);
        let place = self.places.entry((head.from, head.to, leaving.priority.0)).or_default();
        *place += u32::from(role.has_place());
        self.packages.push(Package {
            head: leaving,
            from_node: nodes.0 as NodeIndex,
            to_node: nodes.1 as NodeIndex,
            role,
            posted_ns: now.true_ns,
            place: *place,
            way: SendStage::Transit,
            life: 0,
            published_ns: 0,
            ticket: 0,
            lower: 0,
            held: false,
            redelivered: false,
            deliveries: Vec::new(),
        });
        let start = number as usize % PATTERN_PRIME;
        let mut body: Rc<[u8]> = Rc::from(&self.pattern[start..start + usize::from(head.len)]);
        if let Some(bytes) = Rc::get_mut(&mut body) {
            bytes[..4].copy_from_slice(&number.to_le_bytes());
            bytes[4..8].copy_from_slice(&(!number).to_le_bytes());
        }
        (number, head, body)
    }

    /// The number of the package with this head.
    pub(crate) fn number(&self, head: &Head) -> Option<u32> {
        self.by_head.get(&key(head)).copied()
    }

    /// Whether a body is that of a package.
    pub(super) fn is_body(&self, number: u32, body: &[u8]) -> bool {
        let start = number as usize % PATTERN_PRIME;
        number_of(body) == Some(number) && body[8..] == self.pattern[start + 8..start + body.len()]
    }
}

fn key(head: &Head) -> (Name, Name, i16, u16) {
    (head.from, head.to, head.kind.0, head.id)
}

/// The number in a body of ours.
pub(crate) fn number_of(body: &[u8]) -> Option<u32> {
    let number = u32::from_le_bytes(*body.first_chunk()?);
    let check = u32::from_le_bytes(*body.get(4..)?.first_chunk()?);
    (check == !number).then_some(number)
}
