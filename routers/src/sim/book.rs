//! The books of a simulated network: every package with its fate, and what must hold of them. Cores never see it.
//!
//! ```text
//!  posted ─▶ in the transit mailbox ─▶ accepted ─▶ left, in datagrams ─▶ handed in ─▶ delivered
//!               │ displaced, stale        │ counted: quota, stale, silent…   │ lost     │ counted: late, full, copy…
//! ```

use super::clock::Now;
use super::times::Times;
use crate::frame::{Frame, NodeIndex};
use crate::time::Term;
use rohrpost_mailbox::{Head, Name};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};
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
    /// Queue and reassembly stay within their limits.
    Bounded,
    /// A while after the last fault all is well.
    Recovery,
    /// System time is within its stated bound.
    TimeBound,
    /// System time never goes back within an epoch.
    TimeForward,
    /// One master in a term, and one master a while after the last fault.
    OneMaster,
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
    place: u32,
    /// How far it has come.
    pub way: Way,
    /// Life of the router that accepted it.
    pub life: u32,
    /// Datagrams of lower levels that had left when it was accepted.
    lower: u64,
    /// Whether it came marked as one that was handed out before.
    pub redelivered: bool,
    /// Lives of both routers, at each delivery.
    pub deliveries: Vec<(u32, u32)>,
}

type Mixing = BuildHasherDefault<Mix>;
type Table<K, V> = HashMap<K, V, Mixing>;

/// Hashes what nobody chooses in order to do harm: numbers, a few at a time. The usual one takes a sixth of a simulation's time.
#[derive(Default)]
struct Mix(u64);

impl Hasher for Mix {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_u64((*byte).into()));
    }

    fn write_u8(&mut self, value: u8) {
        self.write_u64(value.into());
    }

    fn write_u16(&mut self, value: u16) {
        self.write_u64(value.into());
    }

    fn write_u32(&mut self, value: u32) {
        self.write_u64(value.into());
    }

    fn write_u64(&mut self, value: u64) {
        self.0 = (self.0.rotate_left(23) ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn write_i16(&mut self, value: i16) {
        self.write_u64(value.cast_unsigned().into());
    }

    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 32
    }
}

/// What one life of a router has had of a package.
#[derive(Clone, Copy, Default, Debug)]
struct Receipt {
    parts: u32,
    of: u32,
    /// It was delivered, or counted with a cause.
    ended: bool,
}

/// What one life of a router has taken of another.
#[derive(Default, Debug)]
struct Taken {
    sequences: HashSet<u64, Mixing>,
    highest: u64,
}

/// Packages that one life of a router has to account for.
#[derive(Clone, Copy, Default, Debug)]
pub struct Account {
    /// Taken from its computer.
    pub accepted: u64,
    /// Sent whole.
    pub left: u64,
    /// Counted with a cause.
    pub lost: u64,
}

/// Levels of the queue, see `rohrpost_config::Network::level`.
const LEVELS: usize = 32;

/// Datagrams a router has sent, by what of them is more important.
#[derive(Clone, Default, Debug)]
struct Sent {
    /// Those whose most urgent package is of a lower level than this.
    below: [u64; LEVELS],
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
    by_part: Table<(u64, NodeIndex, u64), u32>,
    /// What routers have received of packages: life, package.
    receipts: Table<(u32, u32), Receipt>,
    /// Datagrams that routers took: life, incarnation of the sender.
    taken: Table<(u32, u64), Taken>,
    /// Last place that was delivered, of sender, receiver and priority, in one life of the receiver's router.
    last: Table<(Name, Name, u8, u32), u32>,
    sent: BTreeMap<u32, Sent>,
    accounts: BTreeMap<u32, Account>,
    /// What was broken.
    pub problems: Vec<Problem>,
    /// What was seen, so that a test knows that it saw enough.
    pub seen: BTreeMap<&'static str, u64>,
    /// Bodies are cut from it.
    pattern: Vec<u8>,
    /// Level of a priority.
    bulk_below: u8,
    /// System time.
    pub times: Times,
    /// The master, and its term, that all nodes must agree on by now.
    pub master: Option<(Option<NodeIndex>, Term)>,
    /// Packages that came to an end at a receiver's side.
    pub delivered_or_lost: u64,
    /// Whether damaged datagrams were handed to routers; then not all is theirs.
    pub damaged: u64,
}

const PATTERN_PRIME: usize = 251;

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
        self.by_head.insert(key(&head), number);
        let place = self.places.entry((head.from, head.to, head.priority.0)).or_default();
        *place += u32::from(!matches!(role, Role::Report { .. }));
        self.packages.push(Package {
            head,
            from_node: nodes.0 as NodeIndex,
            to_node: nodes.1 as NodeIndex,
            role,
            posted_ns: now.true_ns,
            place: *place,
            way: Way::Transit,
            life: 0,
            lower: 0,
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

    /// A router is given a package.
    pub fn accepted(&mut self, life: u32, number: u32) {
        let level = self.level(self.packages[number as usize].head.priority.0);
        let lower = self.sent.entry(life).or_default().below[level];
        let package = &mut self.packages[number as usize];
        (package.way, package.life, package.lower) = (Way::Accepted, life, lower);
        self.accounts.entry(life).or_default().accepted += 1;
    }

    /// A router counts a package that it will not send; its number.
    pub fn lost_before(&mut self, now: Now, life: u32, head: &Head) -> Option<u32> {
        let number = self.number(head)?;
        let package = &mut self.packages[number as usize];
        if package.way != Way::Accepted || package.life != life {
            let text = format!("package {number} is counted as lost, but is {:?}: {head:?}", package.way);
            self.broken(now, Promise::Accounts, text);
            return None;
        }
        package.way = Way::Counted;
        self.accounts.entry(life).or_default().lost += 1;
        Some(number)
    }

    /// What a life of a router has to account for.
    pub fn account(&self, life: u32) -> Account {
        self.accounts.get(&life).copied().unwrap_or_default()
    }

    /// A datagram leaves a router.
    pub fn leaves(&mut self, now: Now, life: u32, datagram: &[u8]) {
        let mut first = LEVELS;
        match Frame::parse(datagram) {
            Ok((_, Frame::Packages(packages))) => {
                for (head, body) in packages {
                    first = first.min(self.level(head.priority.0));
                    let Some(number) = number_of(body) else { continue };
                    self.urgency(now, life, number);
                    self.left(now, life, number);
                }
            }
            Ok((head, Frame::Fragment(part))) => {
                first = self.level(part.head.priority.0);
                let place = (head.incarnation, head.to, part.first);
                if part.index == 0
                    && let Some(number) = number_of(part.bytes)
                {
                    self.by_part.insert(place, number);
                    self.urgency(now, life, number);
                }
                if part.index + 1 == part.count
                    && let Some(number) = self.by_part.get(&place).copied()
                {
                    self.left(now, life, number);
                }
            }
            _ => return,
        }
        let sent = self.sent.entry(life).or_default();
        sent.below[..first].iter_mut().for_each(|count| *count += 1);
    }

    fn left(&mut self, now: Now, life: u32, number: u32) {
        let Some(package) = self.packages.get_mut(number as usize) else { return };
        if package.way != Way::Accepted || package.life != life {
            let text = format!("package {number} leaves, but is {:?}", package.way);
            self.broken(now, Promise::Accounts, text);
            return;
        }
        package.way = Way::Left;
        self.accounts.entry(life).or_default().left += 1;
    }

    fn urgency(&mut self, now: Now, life: u32, number: u32) {
        let Some(package) = self.packages.get(number as usize) else { return };
        let level = self.level(package.head.priority.0);
        let lower = self.sent.entry(life).or_default().below[level] - package.lower;
        if package.life == life && lower > 1 {
            let text = format!("package {number} of level {level} was behind {lower} datagrams of lower levels");
            self.broken(now, Promise::Urgency, text);
        }
    }

    /// A router took a datagram: each whole package in it has a fate by now, and so has a large one of which this was the last
    /// part that was missing.
    pub fn took(&mut self, now: Now, life: u32, datagram: &[u8]) {
        let Ok((head, frame)) = Frame::parse(datagram) else {
            return self.broken(now, Promise::Unchanged, "a datagram that is no frame was taken".into());
        };
        let taken = self.taken.entry((life, head.incarnation)).or_default();
        taken.highest = taken.highest.max(head.sequence);
        if !taken.sequences.insert(head.sequence) {
            self.broken(
                now,
                Promise::NoCopies,
                format!("datagram {} of {:#x} was taken twice", head.sequence, head.incarnation),
            );
        }
        match frame {
            Frame::Packages(packages) => {
                for number in packages.filter_map(|(_, body)| number_of(body)) {
                    self.part(now, life, number, 1);
                }
            }
            Frame::Fragment(part) => {
                if let Some(number) = self.by_part.get(&(head.incarnation, head.to, part.first)).copied() {
                    self.part(now, life, number, part.count.into());
                }
            }
            _ => {}
        }
    }

    /// A router dropped a datagram as one that it had before: it had, or it is too old to tell.
    pub fn dropped_as_copy(&mut self, now: Now, life: u32, datagram: &[u8], window: u64) {
        let Ok((head, _)) = Frame::parse(datagram) else { return };
        let taken = self.taken.entry((life, head.incarnation)).or_default();
        if !taken.sequences.contains(&head.sequence) && head.sequence + window > taken.highest {
            let text = format!(
                "datagram {} was dropped as a copy; it is the first, {} the highest",
                head.sequence, taken.highest
            );
            self.broken(now, Promise::Accounts, text);
        }
    }

    fn part(&mut self, now: Now, life: u32, number: u32, of: u32) {
        let receipt = self.receipts.entry((life, number)).or_default();
        (receipt.parts, receipt.of) = (receipt.parts + 1, of);
        if receipt.parts == of && !receipt.ended {
            self.broken(
                now,
                Promise::Accounts,
                format!("package {number} came whole, and was neither delivered nor counted"),
            );
        }
    }

    /// A router counts a package that came, or parts of it; its number.
    pub fn lost_behind(&mut self, now: Now, life: u32, head: &Head) -> Option<u32> {
        let number = self.number(head);
        match number {
            Some(number) => self.end(life, number),
            None if self.damaged > 0 => {}
            None => self.broken(now, Promise::Unchanged, format!("what never was sent is counted as lost: {head:?}")),
        }
        number
    }

    /// The number of the package with this head.
    pub fn number(&self, head: &Head) -> Option<u32> {
        self.by_head.get(&key(head)).copied()
    }

    fn end(&mut self, life: u32, number: u32) {
        self.receipts.entry((life, number)).or_default().ended = true;
        self.delivered_or_lost += 1;
    }

    /// At the end: of no package has a router only parts, uncounted.
    pub fn close(&mut self, now: Now, life: u32) {
        let open = self.receipts.iter().filter(|((its, _), receipt)| *its == life && !receipt.ended);
        let mut open: Vec<u32> = open.map(|((_, number), _)| *number).collect();
        open.sort_unstable();
        if !open.is_empty() {
            self.broken(now, Promise::Accounts, format!("of packages {open:?} parts came, but they are not counted"));
        }
    }

    /// A router hands a package to a mailbox. Its number, if it is one of ours and unchanged.
    pub fn arrives(&mut self, now: Now, node: usize, head: &Head, body: &[u8]) -> Option<u32> {
        let known = number_of(body).filter(|number| {
            let start = *number as usize % PATTERN_PRIME;
            self.packages.get(*number as usize).is_some_and(|package| {
                // A command's priority is lowered to its sender's class on the way.
                let same = Head { options: package.head.options, priority: package.head.priority, ..*head };
                same == package.head
                    && usize::from(package.to_node) == node
                    && body[8..] == self.pattern[start + 8..start + body.len()]
            })
        });
        if known.is_none() && self.damaged == 0 {
            let text = format!("node {node} delivers what was never sent to it: {head:?}, {} bytes", body.len());
            self.broken(now, Promise::Unchanged, text);
        }
        known
    }

    /// A mailbox took it.
    pub fn delivered(&mut self, now: Now, life: u32, number: u32, redelivered: bool) {
        self.end(life, number);
        let package = &mut self.packages[number as usize];
        let lives = (package.life, life);
        package.redelivered |= redelivered;
        let twice = package.deliveries.contains(&lives);
        package.deliveries.push(lives);
        let (head, place) = (package.head, package.place);
        let has_place = !twice && !redelivered && !matches!(package.role, Role::Report { .. });
        if twice {
            self.broken(
                now,
                Promise::NoCopies,
                format!("package {number} was delivered twice by one router: {head:?}"),
            );
        }
        let last = self.last.entry((head.from, head.to, head.priority.0, life)).or_default();
        let before = *last;
        *last = before.max(place);
        if place <= before && has_place {
            let text = format!("package {number}, the {place}th of {head:?}, was delivered after the {before}th");
            self.broken(now, Promise::Order, text);
        }
    }
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
