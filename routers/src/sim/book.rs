//! The books of a simulated network: every package with its fate, and what must hold of them. Cores never see it.
//!
//! ```text
//!  posted ─▶ in the transit mailbox ─▶ accepted ─▶ left, in datagrams ─▶ handed in ─▶ delivered
//!               │ displaced, stale        │ counted: quota, stale, silent…   │ lost     │ counted: late, full, copy…
//! ```

use super::clock::Now;
use super::receiving::Receiving;
use super::sending::Sending;
use super::table::Table;
use super::times::Times;
use super::wire::Wire;
use crate::frame::NodeIndex;
use crate::time::Term;
use rohrpost_mailbox::{Head, Name, Priority, local};
use rohrpost_network::LEVELS;
use std::collections::BTreeMap;
use std::rc::Rc;

/// A promise that was broken.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Problem {
    /// Name of the promise.
    pub promise: Promise,
    /// When, true ns.
    pub at_ns: u64,
    /// What was seen.
    pub text: String,
}

/// What must hold whatever the network does.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Promise {
    /// Every accepted package is delivered, or counted with a cause, or was in a datagram that the network lost.
    Accounts,
    /// No command runs twice, and one that is said not to have run has not.
    AtMostOnce,
    /// A router delivers no package twice within one life of both ends.
    NoCopies,
    /// Of one sender and priority, packages come in their order.
    Order,
    /// Nothing is delivered that was not sent, unchanged, to that mailbox.
    Unchanged,
    /// An urgent package is behind at most one datagram of lower levels.
    Urgency,
    /// What gives way to what has no room is the sender's own newest of its lowest level.
    Displacing,
    /// Nothing leaves or is delivered that waited for too long, and a command hurries no more than its sender.
    Fresh,
    /// No more bytes a second than allowed.
    Pace,
    /// Queue, quotas and reassembly stay within their limits.
    Bounded,
    /// What a router says of its peers and of losses on the wire is so.
    Links,
    /// Nothing is delivered that is not admitted: where datagrams are sealed, in the name of another node; to a router's own mailbox; with more
    /// priority than its sender, or who asked for it, may have.
    Admission,
    /// A while after the last fault all is well.
    Recovery,
    /// System time is within its stated bound.
    TimeBound,
    /// System time never goes back within an epoch.
    TimeForward,
    /// One master in a term, and one master a while after the last fault; who sends in its place does so only when it was not heard, and
    /// nobody goes by it.
    OneMaster,
    /// With time slots no two nodes transmit at once, unless a fault parts them: see [`Divisions::excuse`].
    ///
    /// [`Divisions::excuse`]: super::divided::Divisions::excuse
    Exclusive,
    /// With time slots each datagram is on the wire in a window of its sender, before its guard, as the sender reckons, and none is sent
    /// in a window whose wake-up came too late.
    InWindow,
    /// With time slots nobody sends while its own bound is greater than what is allowed, or while it is further off in truth.
    SilentWhenUnsure,
}

/// What a package is for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Role {
    /// Data of a flow.
    Data,
    /// A try of a call, so many ns after the first.
    Command {
        /// Which call.
        call: usize,
        /// Its age when it was posted, ns on the caller's clock.
        age_ns: u64,
    },
    /// An answer to a call.
    Answer {
        /// Which call.
        call: usize,
        /// What it says.
        answer: super::calls::Answer,
    },
    /// A router's answer to a command that it could not deliver. It has no place among those of the module for which it speaks.
    Report {
        /// Which call.
        call: usize,
    },
    /// What nobody needs, from who wants to do harm: a program that writes what it likes in its heads, and whose router caps no priority.
    Intruder,
}

/// How far a package has come at its sender's side.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Way {
    /// It waits for the router, or was lost there: by the mailbox, which counts it.
    Transit,
    /// Its router has it.
    Accepted,
    /// Its router counted it with a cause.
    Counted,
    /// All of it has left in datagrams.
    Left,
}

/// A package.
#[derive(Clone, Debug)]
pub struct Package {
    /// Its head when it was posted.
    pub head: Head,
    /// Where its modules are.
    pub from_node: NodeIndex,
    /// For whom.
    pub to_node: NodeIndex,
    /// What it is for.
    pub role: Role,
    /// When it was posted, true ns.
    pub posted_ns: u64,
    /// Its place among those of its sender, receiver and priority.
    pub(super) place: u32,
    /// How far it has come.
    pub way: Way,
    /// Life of the router that accepted it.
    pub life: u32,
    /// When it was published, on its node's monotonic clock.
    pub(super) published_ns: u64,
    /// Its place among all that its router accepted.
    pub(super) ticket: u64,
    /// Datagrams of lower levels that had left when it was accepted.
    pub(super) lower: u64,
    /// It was for a node that its router did not know yet, so that others may go before it.
    pub(super) held: bool,
    /// Whether it came marked as one that was handed out before.
    pub redelivered: bool,
    /// At each delivery, incarnation of the router that sent it and life of the one that delivered.
    pub deliveries: Vec<(u64, u32)>,
}

/// The books.
#[derive(Default)]
pub struct Book {
    /// All packages, by number.
    pub packages: Vec<Package>,
    places: Table<(Name, Name, u8), u32>,
    ids: Table<(Name, Name, i16), u16>,
    /// Packages by what their heads tell them apart by.
    by_head: Table<(Name, Name, i16, u16), u32>,
    /// Large packages by their first part: incarnation of the sender, receiver, sequence.
    pub(super) by_part: Table<(u64, NodeIndex, u64), u32>,
    /// What each life of a router sent.
    pub(super) sending: BTreeMap<u32, Sending>,
    /// What each took.
    pub(super) receiving: BTreeMap<u32, Receiving>,
    /// When a router last took something of another, true ns, and the lives of both: receiver, sender.
    pub(super) heard: Table<(usize, usize), (u64, u32, u32)>,
    /// From posting to delivery at most, ns, by sender, mailbox and priority.
    pub slowest_ns: BTreeMap<(Name, Name, u8), u64>,
    /// What was broken.
    pub problems: Vec<Problem>,
    /// What was seen, so that a test knows that it saw enough.
    pub seen: BTreeMap<&'static str, u64>,
    /// Bodies are cut from it.
    pattern: Vec<u8>,
    /// Level of a priority.
    bulk_below: u8,
    /// Whether datagrams are sealed.
    pub is_sealed: bool,
    /// From then on all must be well, true ns.
    pub well_ns: u64,
    /// System time.
    pub times: Times,
    /// Who transmits when, with time slots.
    pub wire: Wire,
    /// The master, and its term, that all nodes must agree on by now.
    pub master: Option<(Option<NodeIndex>, Term)>,
}

const PATTERN_PRIME: usize = 251;
/// Whether routers of intruders do as those want: that takes mistakes which can be switched on.
const HOSTILE: bool = cfg!(any(test, feature = "broken-variants"));

impl Book {
    /// Empty books.
    pub fn new(bulk_below: u8) -> Self {
        let pattern = (0..u16::MAX as usize + PATTERN_PRIME).map(|n| (n % PATTERN_PRIME) as u8).collect();
        Self { pattern, bulk_below, ..Self::default() }
    }

    /// Notes that a promise was broken.
    pub fn broken(&mut self, now: Now, promise: Promise, text: String) {
        self.problems.push(Problem { promise, at_ns: now.true_ns, text });
    }

    /// Counts something that was seen.
    pub fn saw(&mut self, what: &'static str) {
        *self.seen.entry(what).or_default() += 1;
    }

    /// Level of a package, 0 goes first.
    pub fn level(&self, priority: u8) -> usize {
        if priority < self.bulk_below { LEVELS - 1 } else { (15 - usize::from(priority >> 4)) * 2 }
    }

    /// A new package, from a node to a node: its number, its head with an id of its own, its body.
    pub fn post(&mut self, now: Now, mut head: Head, nodes: (usize, usize), role: Role) -> (u32, Head, Rc<[u8]>) {
        let number = self.packages.len() as u32;
        let id = self.ids.entry((head.from, head.to, head.kind.0)).or_default();
        *id = id.wrapping_add(1);
        head.id = *id;
        // As it is to leave.
        let leaving = if role == Role::Intruder && HOSTILE { head } else { admitted(&head) };
        self.by_head.insert(key(&head), number);
        let place = self.places.entry((head.from, head.to, leaving.priority.0)).or_default();
        *place += u32::from(!matches!(role, Role::Report { .. } | Role::Intruder));
        self.packages.push(Package {
            head: leaving,
            from_node: nodes.0 as NodeIndex,
            to_node: nodes.1 as NodeIndex,
            role,
            posted_ns: now.true_ns,
            place: *place,
            way: Way::Transit,
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
    pub fn number(&self, head: &Head) -> Option<u32> {
        self.by_head.get(&key(head)).copied()
    }

    /// Whether a body is that of a package.
    pub(super) fn is_body(&self, number: u32, body: &[u8]) -> bool {
        let start = number as usize % PATTERN_PRIME;
        number_of(body) == Some(number) && body[8..] == self.pattern[start + 8..start + body.len()]
    }
}

/// As a package may be delivered at most.
pub(super) fn admitted(head: &Head) -> Head {
    let [sender, receiver] = [head.from, head.to].map(|name| name.class().0);
    let most = match head.kind.0 {
        1.. => sender,
        _ if head.to.local() == local::COMMANDS => sender,
        -16383..=-1 => receiver,
        _ => sender.max(receiver),
    };
    Head { priority: Priority(head.priority.0.min(most)), ..*head }
}

fn key(head: &Head) -> (Name, Name, i16, u16) {
    (head.from, head.to, head.kind.0, head.id)
}

/// The number in a body of ours.
pub fn number_of(body: &[u8]) -> Option<u32> {
    let number = u32::from_le_bytes(*body.first_chunk()?);
    let check = u32::from_le_bytes(*body.get(4..)?.first_chunk()?);
    (check == !number).then_some(number)
}
