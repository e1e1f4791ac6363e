//! A node's part in keeping time: the core behind the thread with the socket.

mod master;
mod other_tables;
mod overhearing;
mod slave;
mod slots;
mod steady;

use super::clock_model::{ClockModel, EVEN_PPB};
use super::election::{Election, ElectionState, Origin};
use super::history::{History, RATE_MAX};
use super::message::{Request, TimeMessage};
use super::others::Others;
use super::steadiness::Steadiness;
use super::types::{Exchanges, Ignored, Reading, Role, SentId, Step, TimeSettings};
use super::{Stamp, TIME_BYTES, Term};
use crate::frame::{FrameHead, HEAD_BYTES, NodeIndex};
use rohrpost_mailbox::{TimeRecord, TimeSource};
use std::collections::VecDeque;

pub use slots::Allowed;
use slots::SlotClock;

/// Exchanges in an interval, and the shortest pause between two with one slave.
const EXCHANGES: u64 = 8;
const EXCHANGE_NS_MIN: u64 = 10_000_000;
const BUCKET_NS_MIN: u64 = 250_000_000;
/// Syncs of one slave, and exchanges of one master, that may be in flight.
const PENDING: usize = 4;
const SECOND_NS: u64 = 1_000_000_000;

/// A slave, as its master knows it.
#[derive(Clone, Debug, Default)]
struct Slave {
    next_ns: u64,
    answered_ns: Option<u64>,
    eager: bool,
    syncs: [Left; PENDING],
}

/// A Sync that left: its id, and when.
#[derive(Clone, Copy, Debug, Default)]
struct Left {
    id: u64,
    sequence: u64,
    at: Stamp,
}

/// A Sync that came, and the Request that answers it.
#[derive(Clone, Copy, Debug, Default)]
struct PendingExchange {
    id: u64,
    sequence: u64,
    sync_came: Stamp,
    /// Just before the Request was handed to the kernel; 0: it was not.
    request_sent_ns: u64,
    request_left: Stamp,
}

/// The next datagram; its stamps are taken when it is sent.
#[derive(Clone, Copy, Debug)]
enum Draft {
    WarmUp,
    Sync { nominal_ns: u64 },
    Replacement { nominal_ns: u64 },
    Request { id: u64 },
    Reply { id: u64, came: Stamp },
}

/// The sans-I/O core of time. See the module's own page.
pub struct Clock {
    settings: TimeSettings,
    interval_ns: u64,
    exchange_ns: u64,
    election: Election,
    line: ClockModel,
    history: History,
    /// How much system time is faster than the local clock, as last known.
    usual_rate: f64,
    /// The term that the line follows, and in which this node's own began.
    term: Term,
    began: Term,
    /// The term in which the timeline of the line began; a master that is heard need not be on it yet.
    timeline: Term,
    /// Until when the stated growth of the bound holds, and the span that it was stated for.
    stated: (u64, u64),
    /// This node needs a new epoch.
    far: bool,
    epoch_began_ns: u64,
    slaves: Vec<Slave>,
    asked: [PendingExchange; PENDING],
    asked_ns: u64,
    hello_ns: u64,
    drafts: VecDeque<(NodeIndex, Draft)>,
    sequences: Vec<u64>,
    last_id: u64,
    exchanges: Exchanges,
    offset_ns: i64,
    /// Nodes of another configuration.
    others: Others,
    /// Whether the local clock keeps its limits.
    steadiness: Steadiness,
    /// State for time slots; none in free mode.
    slots: Option<Box<SlotClock>>,
}

impl Clock {
    /// A clock that has heard nothing yet. `wall_ns` is this computer's wall clock; the first epoch begins with it if
    /// this node becomes the first master. `page` is the node's time page, if there is one: an earlier incarnation's
    /// time continues.
    pub fn new(settings: TimeSettings, now_ns: u64, wall_ns: u64, page: Option<TimeRecord>) -> Self {
        let interval_ns = u64::try_from(settings.interval.as_nanos()).unwrap_or(u64::MAX).max(1);
        let exchange_ns = (interval_ns / EXCHANGES).max(interval_ns.min(EXCHANGE_NS_MIN));
        let line = match page {
            Some(page)
                if page.source == TimeSource::Master && page.monotonic_ns <= now_ns.saturating_add(SECOND_NS) =>
            {
                ClockModel::adopted(now_ns, page)
            }
            Some(page) => ClockModel::unsynchronised(now_ns, wall_ns, page.epoch.saturating_add(1)),
            None => ClockModel::unsynchronised(now_ns, wall_ns, 0),
        };
        let nodes = usize::from(settings.nodes);
        Self {
            interval_ns,
            exchange_ns,
            election: Election::new(settings.own, settings.masters.clone(), interval_ns, now_ns),
            usual_rate: if line.is_synchronised() { rate_of(line.record().pace_ppb) } else { 0.0 },
            line,
            history: History::new(exchange_ns.saturating_mul(4).max(BUCKET_NS_MIN)),
            term: Term::NONE,
            began: Term::NONE,
            timeline: Term::NONE,
            stated: (now_ns, interval_ns.saturating_mul(4)),
            far: false,
            epoch_began_ns: 0,
            slaves: vec![Slave::default(); nodes],
            asked: [PendingExchange::default(); PENDING],
            asked_ns: 0,
            hello_ns: now_ns,
            drafts: VecDeque::with_capacity(2 * nodes + 2 * PENDING),
            sequences: vec![0; nodes],
            last_id: 0,
            exchanges: Exchanges::default(),
            offset_ns: 0,
            others: Others::new(settings.nodes),
            steadiness: Steadiness::default(),
            slots: None,
            settings,
        }
    }

    /// Takes a datagram of time that came at `received`.
    ///
    /// # Errors
    /// [`Ignored`]: it changed nothing.
    pub fn handle(&mut self, now_ns: u64, received: Stamp, head: &FrameHead, rest: &[u8]) -> Result<(), Ignored> {
        if !self.is_ours(head) {
            return Err(Ignored::Stranger);
        }
        let message = TimeMessage::parse(head.kind, rest)?;
        self.others.agrees(head.from);
        if self.is_parted(now_ns) {
            return Err(Ignored::OtherTable);
        }
        if self.is_unsteady(now_ns) {
            return Err(Ignored::Unsteady);
        }
        match message {
            TimeMessage::WarmUp => {
                self.hears(head.from, head.incarnation, received.ns);
                Ok(())
            }
            TimeMessage::Sync(sync) => self.sync(now_ns, received, head, &sync),
            TimeMessage::Request(request) => self.request(received, head.from, &request),
            TimeMessage::Reply(reply) => self.reply(now_ns, received, head, &reply),
        }
    }

    /// Whether it comes from another node of this system, to this node.
    fn is_ours(&self, head: &FrameHead) -> bool {
        let TimeSettings { system, own, nodes, digest, .. } = self.settings;
        (head.system, head.digest, head.to) == (system, digest, own) && head.from != own && head.from < nodes
    }

    /// A datagram with a stamp id of [`Step::Send`] left.
    pub fn sent(&mut self, id: SentId, stamp: Stamp) {
        let Some(slave) = self.slaves.get_mut(usize::from(id.to)) else { return };
        if let Some(left) = slave.syncs.iter_mut().find(|left| left.id != 0 && left.sequence == id.sequence) {
            left.at = stamp;
        }
        let mut asked = self.asked.iter_mut();
        if let Some(asked) = asked.find(|asked| asked.id != 0 && asked.sequence == id.sequence)
            && let ElectionState::Slave(master) = self.election.state()
            && master.node == id.to
        {
            asked.request_left = stamp;
        }
    }

    /// The next step, after each datagram and at the deadline. `now_ns` is sent: read it just before.
    pub fn poll(&mut self, now_ns: u64, datagram: &mut [u8; TIME_BYTES]) -> Step {
        if self.slots.is_some() {
            return self.poll_in(now_ns, Allowed::Nothing, datagram);
        }
        self.advance(now_ns);
        if self.drafts.is_empty() {
            self.draft(now_ns);
        }
        while let Some((to, draft)) = self.drafts.pop_front() {
            if let Some(stamp) = self.write(now_ns, to, draft, datagram) {
                return Step::Send { to, stamp };
            }
        }
        Step::Wait { until_ns: self.deadline_ns(now_ns) }
    }

    /// The record for the node's page. It changes only within [`Self::handle`], [`Self::poll`] and [`Self::page_says`].
    pub fn record(&self) -> &TimeRecord {
        self.line.record()
    }

    /// The page was not written in time and still has this record: time continues from there. Write [`Self::record`]
    /// anew.
    pub fn page_says(&mut self, now_ns: u64, page: &TimeRecord) {
        self.line.go_on_from(now_ns, page);
    }

    /// System time at a moment of the local clock.
    pub fn reading(&self, now_ns: u64) -> Reading {
        Reading {
            time: self.line.at(now_ns),
            term: self.term,
            pace_ppb: self.line.record().pace_ppb,
            synchronised: self.line.is_synchronised(),
        }
    }

    /// The role of this node.
    pub fn role(&self) -> Role {
        match self.election.state() {
            ElectionState::Listening => Role::Listening,
            ElectionState::Slave(_) => Role::Slave,
            ElectionState::Master(_) => Role::Master,
        }
    }

    /// The term of the master that is heard, or of this node as master; none while listening. [`Reading::term`] follows
    /// when it is measured.
    pub fn term(&self) -> Term {
        match self.election.state() {
            ElectionState::Listening => Term::NONE,
            ElectionState::Slave(master) => master.term,
            ElectionState::Master(term) => term,
        }
    }

    /// The master that this node follows, or itself.
    pub fn master(&self) -> Option<NodeIndex> {
        match self.election.state() {
            ElectionState::Listening => None,
            ElectionState::Slave(master) => Some(master.node),
            ElectionState::Master(_) => Some(self.settings.own),
        }
    }

    /// When the master was last heard, local ns; for a master itself, now.
    pub fn heard_ns(&self, now_ns: u64) -> Option<u64> {
        match self.election.state() {
            ElectionState::Listening => None,
            ElectionState::Slave(master) => Some(master.heard_ns),
            ElectionState::Master(_) => Some(now_ns),
        }
    }

    /// Distance of the page from the best guess at the last measurement, ns.
    pub fn offset_ns(&self) -> i64 {
        self.offset_ns
    }

    /// How much faster than this node's clock system time runs, as last known, ns a second.
    pub fn rate_ppb(&self) -> i64 {
        (self.usual_rate * 1e9).round() as i64
    }

    /// Round-trip delay of the best exchange that counts, ns.
    pub fn delay_ns(&self) -> Option<u64> {
        self.history.delay_ns()
    }

    /// Exchanges so far.
    pub fn exchanges(&self) -> Exchanges {
        self.exchanges
    }

    /// Forgets measurements of another timeline.
    fn forget(&mut self) {
        self.history.clear();
        if self.slots.is_some() {
            self.history.fades(2.0 * RATE_MAX);
        }
        self.asked = [PendingExchange::default(); PENDING];
        self.asked_ns = 0;
        self.far = false;
    }

    /// Handles the passing of time.
    fn advance(&mut self, now_ns: u64) {
        self.stood_still(now_ns);
        self.line.end_slew(now_ns);
        self.keep_bound(now_ns);
        if self.election.falls_silent(now_ns) {
            self.line.stop_slew(now_ns);
            self.forget();
            self.hello_ns = now_ns;
        }
        // The cause of the wait may be a refusal that is over, since its node was heard.
        if self.election.waits(now_ns) && !self.is_parted(now_ns) && !self.is_unsteady(now_ns) {
            self.election.waits_no_longer(now_ns);
        }
        let origin = self.origin(now_ns);
        if let Some(term) = self.election.takes_over(now_ns, origin) {
            self.become_master(now_ns, term, origin);
        }
    }

    /// The time that this node would use as master.
    fn origin(&self, now_ns: u64) -> Origin {
        match &self.slots {
            Some(slots) => self.origin_in_slots(slots, now_ns),
            None if self.line.is_synchronised() => Origin::Own,
            None => Origin::New,
        }
    }

    /// Drafts what is due without a request.
    fn draft(&mut self, now_ns: u64) {
        match self.election.state() {
            ElectionState::Listening => self.draft_hello(now_ns),
            ElectionState::Slave(_) => {}
            ElectionState::Master(_) => {
                let due = (0..self.settings.nodes)
                    .filter(|node| *node != self.settings.own)
                    .find(|node| self.slaves[usize::from(*node)].next_ns <= now_ns);
                if let Some(node) = due {
                    self.draft_sync(now_ns, node);
                }
            }
        }
    }

    /// A node without a master says so.
    fn draft_hello(&mut self, now_ns: u64) {
        if self.hello_ns <= now_ns {
            self.hello_ns = now_ns.saturating_add(self.interval_ns);
            for master in self.election.masters().iter().filter(|master| **master != self.settings.own) {
                self.drafts.push_back((*master, Draft::Request { id: 0 }));
            }
        }
    }

    fn deadline_ns(&self, now_ns: u64) -> u64 {
        let role_ns = match self.election.state() {
            // In time slots others plan its windows.
            _ if self.slots.is_some() => None,
            ElectionState::Master(_) => {
                let others = self.slaves.iter().enumerate().filter(|(node, _)| *node != usize::from(self.settings.own));
                others.map(|(_, slave)| slave.next_ns).min()
            }
            ElectionState::Listening => Some(self.hello_ns),
            ElectionState::Slave(_) => None,
        };
        let bound_ns = self.is_held_over().then_some(self.stated.0);
        let election_ns = self.election.deadline_ns(now_ns, self.origin(now_ns));
        let deadlines = [role_ns, self.line.slew_end_ns(), bound_ns, election_ns];
        deadlines.into_iter().flatten().min().unwrap_or(now_ns + SECOND_NS).max(now_ns)
    }

    /// Writes a datagram with the present time. None when it is not needed any more.
    fn write(
        &mut self,
        now_ns: u64,
        to: NodeIndex,
        draft: Draft,
        datagram: &mut [u8; TIME_BYTES],
    ) -> Option<Option<SentId>> {
        let sequence = self.sequences[usize::from(to)];
        let message = match draft {
            Draft::WarmUp => TimeMessage::WarmUp,
            Draft::Sync { nominal_ns } => TimeMessage::Sync(self.write_sync(now_ns, to, nominal_ns, sequence)?),
            Draft::Replacement { nominal_ns } => TimeMessage::Sync(self.write_replacement(now_ns, nominal_ns)?),
            Draft::Request { id } => TimeMessage::Request(self.write_request(now_ns, id, sequence)?),
            Draft::Reply { id, came } => TimeMessage::Reply(self.write_reply(now_ns, to, id, came)?),
        };
        self.sequences[usize::from(to)] += 1;
        let TimeSettings { system, own: from, digest, incarnation, .. } = self.settings;
        let head = FrameHead { kind: message.kind(), system, from, to, digest, incarnation, sequence };
        let rest = message.to_bytes();
        datagram[..HEAD_BYTES].copy_from_slice(&head.to_bytes(&[&rest]));
        datagram[HEAD_BYTES..].copy_from_slice(&rest);
        let stamped = matches!(message, TimeMessage::Sync(_) | TimeMessage::Request(Request { id: 1.., .. }));
        Some(stamped.then_some(SentId { to, sequence }))
    }
}

fn rate_of(pace_ppb: u64) -> f64 {
    (pace_ppb as f64 - EVEN_PPB as f64) * 1e-9
}
