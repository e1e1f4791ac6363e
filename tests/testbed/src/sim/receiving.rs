//! The books of the receiver's side: what a router took, and what it delivered or lost.

use super::clock::Now;
use super::lives::{Receipt, Taken};
use super::oracle::Oracle;
use super::package::{Package, Role, admitted};
use super::packages::ROUTER_CLASS;
use super::promise::Promise;
use super::spans::S;
use rohrpost_mailbox::{Head, local};
use rohrpost_routers::frame::{Frame, FrameHead, FrameKind, NodeIndex};
use rohrpost_routers::inbound::{REORDER_MAX, WINDOW};

/// A second datagram confirms a first one within this time, ns.
const CONFIRMED_WITHIN_NS: u64 = 2 * S;
/// So many that wait for a second are remembered of each peer at least.
const DOUBTED_KEPT: usize = 3;

impl Oracle {
    /// A router took a datagram: each whole package in it has a fate by now, and so has a large one of which this was
    /// the last part that was missing. `first`: where datagrams are sealed, the sequence from which on its incarnation
    /// is heard.
    pub(crate) fn took(&mut self, now: Now, life: u32, (datagram, first): (&[u8], Option<u64>), digest: u64) {
        let Ok((head, frame)) = Frame::parse(datagram) else {
            return self.broken(now, Promise::Unchanged, "a datagram that is no frame was taken".into());
        };
        if head.digest != digest {
            self.broken(now, Promise::Unchanged, format!("a datagram of digest {:#x} was taken", head.digest));
        }
        let receiving = self.receiving.entry(life).or_default();
        let is_first_incarnation = !receiving.present.contains_key(&head.from);
        let before = receiving.present.insert(head.from, head.incarnation);
        let start = match first {
            Some(first) => first,
            None if is_first_incarnation && head.sequence >= REORDER_MAX => head.sequence,
            None => 0,
        };
        let is_known = receiving.taken.contains_key(&head.incarnation);
        let taken = receiving.taken.entry(head.incarnation).or_insert_with(|| Taken { start, ..Taken::default() });
        if is_known && before != Some(head.incarnation) {
            (taken.unclear, taken.back) = (true, head.sequence);
        }
        taken.from = head.from;
        taken.highest = taken.highest.max(head.sequence);
        if !taken.sequences.insert(head.sequence) {
            let text = format!("datagram {} of {:#x} was taken twice", head.sequence, head.incarnation);
            self.broken(now, Promise::NoCopies, text);
        }
        match frame {
            Frame::Packages(packages) => {
                for number in packages.filter_map(|(_, body)| super::oracle::number_of(body)) {
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

    /// Whether a datagram has whole packages, and a router took none that was sent behind it.
    pub(crate) fn is_newest(&self, life: u32, datagram: &[u8]) -> bool {
        let Ok((head, _)) = FrameHead::read(datagram) else { return false };
        let taken = self.receiving.get(&life).and_then(|receiving| receiving.taken.get(&head.incarnation));
        head.kind == FrameKind::Packages && taken.is_none_or(|taken| head.sequence > taken.highest)
    }

    /// Whether a router took a datagram before, or cannot tell: it is out of the window, or from before the sequence
    /// from which on its incarnation is heard; that is `first`, or where it came back.
    pub(crate) fn came(&self, life: u32, head: &FrameHead, first: u64) -> bool {
        let receiving = self.receiving.get(&life);
        let Some(taken) = receiving.and_then(|receiving| receiving.taken.get(&head.incarnation)) else {
            return head.sequence < first;
        };
        let is_before = head.sequence < first.max(taken.back) || head.sequence + WINDOW <= taken.highest;
        is_before || taken.sequences.contains(&head.sequence)
    }

    /// Whether a datagram may be of an incarnation that is over, or not confirmed: a router takes
    /// - what goes on of an incarnation before, only while its successor `is_silent`;
    /// - a new incarnation, and what is out of the window, only when a second datagram within [`CONFIRMED_WITHIN_NS`]
    ///   is near. It remembers a few that waited for a second.
    pub(crate) fn may_be_old(&mut self, now: Now, life: u32, head: &FrameHead, is_silent: bool) -> bool {
        let receiving = self.receiving.entry(life).or_default();
        let present = receiving.present.get(&head.from).copied();
        match receiving.taken.get(&head.incarnation) {
            Some(taken) if present != Some(head.incarnation) => {
                return !is_silent || head.sequence <= taken.highest;
            }
            Some(taken) if head.sequence.abs_diff(taken.highest + 1) < WINDOW => return false,
            None if present.is_none() => return false,
            _ => {}
        }
        let doubted = receiving.doubted.entry(head.from).or_default();
        let confirms = |(incarnation, sequence, at_ns): &(u64, u64, u64)| {
            let is_near = *sequence != head.sequence && sequence.abs_diff(head.sequence) < WINDOW;
            *incarnation == head.incarnation && is_near && now.monotonic_ns < at_ns + CONFIRMED_WITHIN_NS
        };
        let is_confirmed = doubted.iter().any(confirms);
        doubted.push_back((head.incarnation, head.sequence, now.monotonic_ns));
        if doubted.len() > DOUBTED_KEPT {
            doubted.pop_front();
        }
        !is_confirmed
    }

    fn receipt(&mut self, life: u32, number: u32) -> &mut Receipt {
        self.receiving.entry(life).or_default().receipts.entry(number).or_default()
    }

    fn part(&mut self, now: Now, life: u32, number: u32, of: u32) {
        let receipt = self.receipt(life, number);
        receipt.parts += 1;
        if receipt.parts == of && !receipt.ended {
            let text = format!("package {number} came whole, and was neither delivered nor counted");
            self.broken(now, Promise::Accounts, text);
        }
    }

    /// A router counts a package that came, or parts of it; its number.
    pub(crate) fn lost_behind(&mut self, now: Now, life: u32, head: &Head) -> Option<u32> {
        let number = self.number(head);
        match number {
            Some(number) => self.receipt(life, number).ended = true,
            None => self.broken(now, Promise::Unchanged, format!("what never was sent is counted as lost: {head:?}")),
        }
        number
    }

    /// A router hands a package to a mailbox. Its number, if it is one that was sent there, and unchanged.
    pub(crate) fn arrives(&mut self, now: Now, node: usize, head: &Head, body: &[u8]) -> Option<u32> {
        let known = super::oracle::number_of(body).filter(|number| {
            self.packages.get(*number as usize).is_some_and(|package| {
                let same = Head { options: package.head.options, priority: package.head.priority, ..*head };
                same == package.head && usize::from(package.to_node) == node && self.is_body(*number, body)
            })
        });
        if known.is_none() {
            let text = format!("node {node} delivers what was never sent to it: {head:?}, {} bytes", body.len());
            self.broken(now, Promise::Unchanged, text);
        }
        if let Some(number) = known {
            self.is_admitted(now, head, &self.packages[number as usize].clone());
        }
        known
    }

    /// A package is delivered, with this head.
    fn is_admitted(&mut self, now: Now, head: &Head, package: &Package) {
        let wrong = if head.priority != admitted(&package.head).priority {
            "with another priority than it may have"
        } else if head.to.class() == ROUTER_CLASS && head.to.local() >= local::TRANSIT {
            "to a router's own mailbox"
        } else if self.is_sealed
            && head.from.instance() != package.from_node
            && !matches!(package.role, Role::Held { .. })
        {
            "in the name of another node"
        } else {
            return;
        };
        let text = format!("{wrong} {head:?} is delivered, posted at node {}: {:?}", package.from_node, package.head);
        self.broken(now, Promise::Admission, text);
    }

    /// A mailbox took it. `lives`: incarnation of the router that sent the datagram, not of the one that has the
    /// package by now (it may have found it again when it began), and incarnation of the one that delivers.
    pub(crate) fn delivered(&mut self, now: Now, lives: (u64, u32), number: u32, redelivered: bool) {
        let (_, life) = lives;
        self.receipt(life, number).ended = true;
        let package = &mut self.packages[number as usize];
        package.redelivered |= redelivered;
        let twice = package.deliveries.contains(&lives);
        package.deliveries.push(lives);
        let (head, place) = (package.head, package.place);
        let took_ns = now.true_ns - package.posted_ns;
        let slowest_ns = self.slowest_ns.entry((head.from, head.to, head.priority.0)).or_default();
        *slowest_ns = took_ns.max(*slowest_ns);
        let has_place = !twice && !redelivered && package.role.has_place();
        if twice {
            let text = format!("package {number} was delivered twice by one router: {head:?}");
            self.broken(now, Promise::NoCopies, text);
        }
        let last = &mut self.receiving.entry(life).or_default().last;
        let last = last.entry((head.from, head.to, head.priority.0)).or_default();
        let before = *last;
        if has_place {
            *last = before.max(place);
        }
        if place <= before && has_place {
            let text = format!("package {number}, the {place}th of {head:?}, was delivered after the {before}th");
            self.broken(now, Promise::Order, text);
        }
    }

    /// How many datagrams of a peer never came, as an incarnation of a router should have counted by now; none if that
    /// is not clear.
    pub(crate) fn missing(&self, life: u32, from: NodeIndex) -> Option<u64> {
        let lives = || self.receiving.get(&life).into_iter().flat_map(|its| its.taken.values());
        let lives = || lives().filter(|taken| taken.from == from);
        let missing = |taken: &Taken| {
            let counted = taken.sequences.iter().filter(|sequence| **sequence >= taken.start).count() as u64;
            (taken.highest + 1 - taken.start).saturating_sub(counted)
        };
        lives().all(|taken| !taken.unclear).then(|| lives().map(missing).sum())
    }

    /// At the end: of no package has a router only parts, uncounted.
    pub(crate) fn close_receipts(&mut self, now: Now, life: u32) {
        let Some(receiving) = self.receiving.get(&life) else { return };
        let open = receiving.receipts.iter().filter(|(_, receipt)| !receipt.ended);
        let mut open: Vec<u32> = open.map(|(number, _)| *number).collect();
        open.sort_unstable();
        if !open.is_empty() {
            self.broken(now, Promise::Accounts, format!("of packages {open:?} parts came, but they are not counted"));
        }
    }
}
