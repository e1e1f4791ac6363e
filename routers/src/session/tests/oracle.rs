//! What is true, which neither end knows: every package with its fate, and what must hold of them.

use super::plan::ROUTER;
use crate::replication::LineReplicas;
use crate::report::NotDelivered;
use crate::session::frame::{Carried, Range};
use crate::session::{AGE_MAX_NS, Cause, EndHost, client, server};
use rohrpost_mailbox::{ALL_SYSTEMS, Head, Kind, Name, Options, local};
use rohrpost_testbed::sim::chance::Chance;
use std::collections::BTreeMap;

/// What clocks of different pace make of two seconds.
const SLACK_NS: u64 = 2_000_000;
/// What an answer for a lost command begins with.
const LOST: &[u8] = b"lost";

pub(super) struct Posted {
    pub(super) head: Head,
    pub(super) from: usize,
    pub(super) posted_ns: u64,
    /// In a name of another: it may go nowhere.
    pub(super) is_forged: bool,
    pub(super) said_lost: bool,
    pub(super) delivered: Vec<(usize, u8)>,
}

/// A client, as far as the books know it.
pub(super) struct Known {
    pub(super) system: u8,
    pub(super) ranges: Vec<Range>,
    pub(super) reaches_own: bool,
}

/// Packages that stay in their order: of one sender, receiver and priority; of data of which only the newest counts, of
/// one address and id.
type Flow = (Name, Name, u8, Option<(Name, u16)>);

#[derive(Default)]
pub(super) struct SessionOracle {
    pub(super) now_ns: u64,
    pub(super) packages: Vec<Posted>,
    pub(super) clients: Vec<Known>,
    /// The last number of each flow, by the delivering end.
    last: BTreeMap<(usize, Flow), usize>,
    /// Of each delivery: age, sender, receiver.
    pub(super) log: Vec<(u64, usize, usize)>,
    pub(super) problems: Vec<String>,
    pub(super) seen: BTreeMap<&'static str, u64>,
    /// The client that sends too much. What others send it must not cost anything.
    pub(super) flooder: Option<usize>,
}

impl SessionOracle {
    pub(super) fn new(clients: Vec<Known>) -> Self {
        Self { clients, ..Self::default() }
    }

    pub(super) fn saw(&mut self, what: &'static str) {
        *self.seen.entry(what).or_default() += 1;
    }

    pub(super) fn broken(&mut self, text: String) {
        self.problems.push(format!("at {} ms: {text}", self.now_ns / 1_000_000));
    }

    pub(super) fn post(&mut self, from: usize, head: Head, is_forged: bool) -> (usize, Vec<u8>) {
        let number = self.packages.len();
        let mut body = (number as u64).to_le_bytes().to_vec();
        body.resize(head.len.into(), number as u8);
        let posted_ns = self.now_ns;
        self.packages.push(Posted { head, from, posted_ns, is_forged, said_lost: false, delivered: Vec::new() });
        (number, body)
    }

    fn delivered(&mut self, to: usize, carried: &Carried<'_>) {
        let Some(number) = number_of(carried.body) else { return self.broken(format!("nobody sent {carried:?}")) };
        let now_ns = self.now_ns;
        let Some(package) = self.packages.get_mut(number) else { return self.broken(format!("nobody sent {number}")) };
        let (head, system) = (carried.head, self.clients[to].system);
        let to_all = package.head.to.system() == ALL_SYSTEMS;
        let is_unchanged = head.from == package.head.from
            && head.kind == package.head.kind
            && (head.priority, head.id, head.options) == (package.head.priority, package.head.id, package.head.options)
            && carried.body.len() == usize::from(package.head.len)
            && carried.body[8..].iter().all(|byte| *byte == number as u8)
            && (head.to == package.head.to || to_all && head.to.system() == system);
        let age_ns = now_ns - package.posted_ns;
        let mut wrong = Vec::new();
        let mut check = |holds: bool, what: &str| {
            if !holds {
                wrong.push(format!("{number}, {:?}, at client {to}: {what}", package.head));
            }
        };
        check(is_unchanged, "changed");
        check(!package.is_forged, "in the name of another");
        check(head.to.class() != ROUTER || head.to.local() < local::TRANSIT, "to a router's own mailbox");
        check(!package.said_lost, "was said to be lost");
        check(age_ns <= AGE_MAX_NS + SLACK_NS, "too old");
        check(self.clients[to].ranges.iter().any(|range| range.has(head.to)), "does not host it");
        check(package.from != to, "came back to its sender");
        check(!package.delivered.iter().any(|(client, at)| !to_all || *client == to || *at == system), "twice");
        let from = &self.clients[package.from];
        check(!(to_all && from.reaches_own && from.system == system), "its own system gets it without the server");
        package.delivered.push((to, system));
        let newest = head.options.has(Options::NEWEST).then_some((package.head.to, head.id));
        let (from, flow) = (package.from, (head.from, head.to, head.priority.0, newest));
        let before = self.last.insert((to, flow), number);
        check(before.is_none_or(|before| before < number), "out of order");
        wrong.into_iter().for_each(|text| self.broken(text));
        self.log.push((age_ns, from, to));
        self.saw(if to_all { "to all" } else { "delivered" });
    }
}

fn number_of(body: &[u8]) -> Option<usize> {
    body.first_chunk().map(|number| u64::from_le_bytes(*number) as usize)
}

/// An end, as it tells the books.
pub(super) struct Teller<'a> {
    pub(super) oracle: &'a mut SessionOracle,
    /// Which client; the server has none.
    pub(super) client: usize,
    pub(super) chance: &'a mut Chance,
    /// Its replicas, if it has some.
    pub(super) line: Option<&'a mut LineReplicas>,
}

impl EndHost for Teller<'_> {
    fn answer(&mut self, call: &[u8], why: Cause, _: Option<&str>, answer: &mut Vec<u8>) -> bool {
        let Some(number) = number_of(call) else { return false };
        self.oracle.saw(why.word());
        let package = &mut self.oracle.packages[number];
        // What goes to all systems each of them answers for itself.
        let is_lack = matches!(why, Cause::Full | Cause::Share | Cause::Stale);
        if is_lack && self.oracle.flooder.is_some_and(|flooder| flooder != package.from) {
            self.oracle.problems.push(format!(
                "{number} of client {} is lost by another's flood: {}",
                package.from,
                why.word()
            ));
        }
        package.said_lost = package.head.to.system() != ALL_SYSTEMS;
        if package.said_lost && !package.delivered.is_empty() {
            self.oracle.broken(format!("{number} was delivered, and is said to be lost: {}", why.word()));
        }
        answer.extend(LOST);
        answer.extend((number as u64).to_le_bytes());
        true
    }

    fn replicas(&mut self) -> Option<&mut LineReplicas> {
        self.line.as_deref_mut()
    }
}

impl client::ClientHost for Teller<'_> {
    fn deliver(&mut self, carried: &Carried<'_>) -> Result<(), NotDelivered> {
        if let Kind::Reply(_) = carried.head.kind.kind() {
            let number = carried.body.strip_prefix(LOST).and_then(number_of);
            let is_his = number.is_some_and(|number| self.oracle.packages[number].from == self.client);
            if !is_his {
                self.oracle.broken(format!("an answer for another: {carried:?}"));
            }
            self.oracle.saw("answered");
            return Ok(());
        }
        if self.chance.percent(2) {
            let why = [NotDelivered::NoMailbox, NotDelivered::MailboxFull, NotDelivered::TooLarge];
            return Err(self.chance.pick(&why));
        }
        self.oracle.delivered(self.client, carried);
        Ok(())
    }

    fn event(&mut self, event: client::ClientEvent<'_>) {
        if let client::ClientEvent::Damaged(bad) = event {
            self.oracle.broken(format!("client {} read: {bad}", self.client));
        }
        self.oracle.saw(match event {
            client::ClientEvent::Up => "up",
            client::ClientEvent::Down => "down",
            client::ClientEvent::Refused(_) => "refused",
            client::ClientEvent::Objected(_) => "objected",
            client::ClientEvent::Damaged(_) => "damaged",
        });
    }
}

impl server::ServerHost for Teller<'_> {
    fn event(&mut self, event: server::ServerEvent<'_>) {
        self.oracle.saw(match event {
            server::ServerEvent::Joined { .. } => "joined",
            server::ServerEvent::Left { why, .. } => why.map_or("left", |why| why.word()),
            server::ServerEvent::Refused { .. } => "not let in",
            server::ServerEvent::Objected { .. } => "objected to",
        });
    }
}
