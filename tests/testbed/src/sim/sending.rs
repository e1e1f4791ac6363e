//! The books of the sender's side: what a router accepted, and how it left or was lost.

use super::clock::Now;
use super::lives::Account;
use super::oracle::Oracle;
use super::package::SendStage;
use super::plan::Shape;
use super::promise::Promise;
use super::spans::MS;
use rohrpost_mailbox::Head;
use rohrpost_network::LEVELS;
use rohrpost_routers::counts::Cause;
use rohrpost_routers::frame::Frame;
use rohrpost_routers::intake::MAKING_NS;
use rohrpost_routers::outbound::WAIT_MAX_NS;

/// What leaves may be so far ahead of its rate.
const AHEAD_NS_MAX: u64 = MS + 1000;

impl Oracle {
    /// A router is given a package.
    pub(crate) fn accepted(&mut self, life: u32, number: u32, published_ns: u64) {
        let level = self.level(self.packages[number as usize].head.priority.0);
        let sending = self.sending.entry(life).or_default();
        sending.account.accepted += 1;
        sending.newest = number;
        let package = &mut self.packages[number as usize];
        (package.way, package.life, package.published_ns) = (SendStage::Accepted, life, published_ns);
        (package.ticket, package.lower) = (sending.account.accepted, sending.below[level]);
        let waiting = sending.waiting.entry(package.head.from.module()).or_default();
        waiting.packages.insert((level, package.ticket, number));
        waiting.bytes += usize::from(package.head.len);
    }

    /// A router has accepted a package for a node that it does not know yet.
    pub(crate) fn held(&mut self, number: u32) {
        self.packages[number as usize].held = true;
    }

    /// A router has done with a package what it does at once: no sender has more waiting than its quota.
    pub(crate) fn queued(&mut self, now: Now, life: u32, number: u32, quota_bytes: usize) {
        let module = self.packages[number as usize].head.from.module();
        let Some(waiting) = self.sending.get(&life).and_then(|sending| sending.waiting.get(&module)) else { return };
        if waiting.bytes > quota_bytes {
            let text = format!("{module} has {} bytes waiting, {quota_bytes} at most", waiting.bytes);
            self.broken(now, Promise::Bounded, text);
        }
    }

    /// Bytes of all packages that wait in a router.
    pub(crate) fn waiting_bytes(&self, life: u32) -> usize {
        self.sending.get(&life).map_or(0, |sending| sending.waiting.values().map(|waiting| waiting.bytes).sum())
    }

    /// What an incarnation of a router has to account for.
    pub(crate) fn account(&self, life: u32) -> Account {
        self.sending.get(&life).map(|sending| sending.account).unwrap_or_default()
    }

    /// A router counts a package that it will not send; its number.
    pub(crate) fn lost_before(&mut self, now: Now, life: u32, head: &Head, cause: Cause) -> Option<u32> {
        let number = self.number(head)?;
        if !self.is_waiting(now, life, number, "is counted as lost") {
            return None;
        }
        let level = self.level(self.packages[number as usize].head.priority.0);
        let ticket = self.packages[number as usize].ticket;
        let sending = self.sending.entry(life).or_default();
        sending.account.lost += 1;
        if let Some(waiting) = sending.waiting.get(&head.from.module()).filter(|_| cause == Cause::Quota) {
            let others = waiting.packages.iter().rev().filter(|(_, _, other)| *other != sending.newest);
            let last = others.map(|(level, ticket, _)| (*level, *ticket)).next();
            if number != sending.newest && last != Some((level, ticket)) {
                let text = format!("package {number}, {ticket} of level {level}, gave way; {last:?} should have");
                self.broken(now, Promise::Displacing, text);
            }
        }
        self.waits_no_more(life, number, SendStage::Counted);
        Some(number)
    }

    fn is_waiting(&mut self, now: Now, life: u32, number: u32, what: &str) -> bool {
        let package = &self.packages[number as usize];
        let is_waiting = package.way == SendStage::Accepted && package.life == life;
        if !is_waiting {
            let text = format!("package {number} {what}, but is {:?}: {:?}", package.way, package.head);
            self.broken(now, Promise::Accounts, text);
        }
        is_waiting
    }

    fn waits_no_more(&mut self, life: u32, number: u32, way: SendStage) {
        let level = self.level(self.packages[number as usize].head.priority.0);
        let package = &mut self.packages[number as usize];
        package.way = way;
        let sending = self.sending.entry(life).or_default();
        if let Some(waiting) = sending.waiting.get_mut(&package.head.from.module()) {
            waiting.packages.remove(&(level, package.ticket, number));
            waiting.bytes -= usize::from(package.head.len);
        }
    }

    /// A datagram leaves a router: all that is in it was waiting, and may go now.
    pub(crate) fn leaves(&mut self, now: Now, life: u32, datagram: &[u8]) {
        let mut first = LEVELS;
        match Frame::parse(datagram) {
            Ok((_, Frame::Packages(packages))) => {
                for (head, body) in packages {
                    first = first.min(self.level(head.priority.0));
                    if let Some(number) = super::oracle::number_of(body) {
                        self.begins(now, life, number, &head);
                        self.left(now, life, number);
                    }
                }
            }
            Ok((head, Frame::Fragment(part))) => {
                first = self.level(part.head.priority.0);
                let place = (head.incarnation, head.to, part.first);
                if part.index == 0
                    && let Some(number) = super::oracle::number_of(part.bytes)
                {
                    self.by_part.insert(place, number);
                    self.begins(now, life, number, &part.head);
                    self.gives_way_no_more(life, number);
                }
                if part.index + 1 == part.count
                    && let Some(number) = self.by_part.get(&place).copied()
                {
                    self.left(now, life, number);
                }
            }
            _ => {}
        }
        let sending = self.sending.entry(life).or_default();
        sending.below[..first.min(LEVELS)].iter_mut().for_each(|count| *count += u64::from(first < LEVELS));
    }

    /// Levels of the most and of the least important package in a datagram, if there is one.
    fn levels(&self, datagram: &[u8]) -> Option<(usize, usize)> {
        match Frame::parse(datagram) {
            Ok((_, Frame::Packages(packages))) => {
                let levels = || packages.map(|(head, _)| self.level(head.priority.0));
                Some((levels().min()?, levels().max()?))
            }
            Ok((_, Frame::Fragment(part))) => {
                let level = self.level(part.head.priority.0);
                Some((level, level))
            }
            _ => None,
        }
    }

    /// In time slots nothing leaves while something more important waits, whichever node it is for and however large:
    /// of those that something can be sealed to. `behind`: the first that waits in the mailbox.
    pub(crate) fn is_strict(
        &mut self,
        now: Now,
        life: u32,
        datagram: &[u8],
        behind: Option<u32>,
        reaches: impl Fn(u8) -> bool,
    ) {
        let last = self.levels(datagram).map(|(_, last)| last);
        let waiting = self.sending.get(&life).into_iter().flat_map(|sending| sending.waiting.values());
        let may_leave = |(_, _, number): &&(usize, u64, u32)| reaches(self.packages[*number as usize].to_node);
        let first = waiting.filter_map(|waiting| waiting.packages.iter().find(may_leave)).min().copied();
        let behind = behind.map(|number| (self.level(self.packages[number as usize].head.priority.0), number));
        let first = first.map(|(level, _, number)| (level, number)).into_iter().chain(behind).min();
        if let (Some(last), Some((first, number))) = (last, first)
            && first < last
        {
            let text = format!("a package of level {last} leaves, and {number} of level {first} waits");
            self.broken(now, Promise::Urgency, text);
        }
    }

    /// Without time slots no router sends faster than it may; "still there" goes anyway.
    pub(crate) fn paces(&mut self, now: Now, life: u32, datagram: &[u8], shape: &Shape, overhead_bytes: usize) {
        let first = self.levels(datagram).map(|(first, _)| first);
        let sending = self.sending.entry(life).or_default();
        let ahead_ns = sending.through_ns.saturating_sub(now.monotonic_ns);
        let takes_ns = (datagram.len() + overhead_bytes) as u64 * 1_000_000_000 / shape.rate_bytes_s;
        sending.through_ns = sending.through_ns.max(now.monotonic_ns) + takes_ns;
        sending.all_through_ns = sending.all_through_ns.max(now.monotonic_ns) + takes_ns;
        let Some(first) = first else { return };
        // What is more urgent than what left last may go in advance, by one datagram.
        let advance_ns = match first < sending.last {
            true => (shape.datagram_bytes_max + overhead_bytes) as u64 * 1_000_000_000 / shape.rate_bytes_s,
            false => 0,
        };
        sending.last = first;
        if ahead_ns > AHEAD_NS_MAX + advance_ns {
            self.broken(now, Promise::Pace, format!("a datagram leaves {ahead_ns} ns before its time"));
        }
    }

    /// Without time slots a part of a replica leaves only at the rate that packages leave to it; "still there" goes
    /// anyway.
    pub(crate) fn paces_parts(&mut self, now: Now, life: u32, (bytes, is_alive): (usize, bool), shape: &Shape) {
        let sending = self.sending.entry(life).or_default();
        let ahead_ns = sending.all_through_ns.saturating_sub(now.monotonic_ns);
        let takes_ns = |bytes: usize| bytes as u64 * 1_000_000_000 / shape.rate_bytes_s;
        sending.all_through_ns = sending.all_through_ns.max(now.monotonic_ns) + takes_ns(bytes);
        let advance_ns = takes_ns(2 * shape.datagram_bytes_max);
        if ahead_ns > AHEAD_NS_MAX + advance_ns && !is_alive {
            let text = format!("a datagram leaves by the port of replicas {ahead_ns} ns before its time");
            self.broken(now, Promise::RecordBounds, text);
        }
    }

    fn begins(&mut self, now: Now, life: u32, number: u32, head: &Head) {
        let Some(package) = self.packages.get(number as usize) else { return };
        let level = self.level(package.head.priority.0);
        let lower = self.sending.entry(life).or_default().below[level] - package.lower;
        if package.life == life && lower > 1 && !package.held {
            let text = format!("package {number} of level {level} was behind {lower} datagrams of lower levels");
            self.broken(now, Promise::Urgency, text);
        } else if head.priority != package.head.priority {
            let text = format!("package {number} leaves with {:?}: {:?}", head.priority, package.head);
            self.broken(now, Promise::Fresh, text);
        } else if now.monotonic_ns.saturating_sub(package.published_ns) > WAIT_MAX_NS + MAKING_NS {
            let text = format!("package {number} leaves, but was published at {} ns", package.published_ns);
            self.broken(now, Promise::Fresh, text);
        }
    }

    /// A datagram that left the queue and no router is lost: what was complete in it waits as before, for as long as it
    /// takes to lose it.
    pub(crate) fn comes_back(&mut self, life: u32, datagram: &[u8]) {
        let number = |body: &[u8]| super::oracle::number_of(body);
        match Frame::parse(datagram) {
            Ok((_, Frame::Packages(packages))) => {
                packages.filter_map(|(_, body)| number(body)).for_each(|number| self.waits_again(life, number));
            }
            Ok((head, Frame::Fragment(part))) if part.index + 1 == part.count => {
                let whole = self.by_part.get(&(head.incarnation, head.to, part.first)).copied();
                whole.into_iter().for_each(|number| self.waits_again(life, number));
            }
            _ => {}
        }
    }

    fn waits_again(&mut self, life: u32, number: u32) {
        let level = self.level(self.packages[number as usize].head.priority.0);
        let package = &mut self.packages[number as usize];
        if package.life != life || package.way != SendStage::Left {
            return;
        }
        package.way = SendStage::Accepted;
        let sending = self.sending.entry(life).or_default();
        sending.account.left -= 1;
        if let Some(waiting) = sending.waiting.get_mut(&package.head.from.module()) {
            waiting.packages.insert((level, package.ticket, number));
            waiting.bytes += usize::from(package.head.len);
        }
    }

    /// The first part has left: it would be a waste to lose the others.
    fn gives_way_no_more(&mut self, life: u32, number: u32) {
        let package = &self.packages[number as usize];
        let (module, ticket) = (package.head.from.module(), package.ticket);
        let level = self.level(package.head.priority.0);
        if let Some(waiting) = self.sending.get_mut(&life).and_then(|sending| sending.waiting.get_mut(&module)) {
            waiting.packages.remove(&(level, ticket, number));
        }
    }

    fn left(&mut self, now: Now, life: u32, number: u32) {
        if self.is_waiting(now, life, number, "leaves") {
            self.waits_no_more(life, number, SendStage::Left);
            self.sending.entry(life).or_default().account.left += 1;
        }
    }
}
