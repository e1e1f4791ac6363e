//! A node's part in keeping time: what the thread with the socket hands it and asks of it.

use super::broken::Broken;
use super::election::{Election, Followed, Heard, State};
use super::history::{Estimate, History, Sample};
use super::line::{EVEN_PPB, Line, wander_ns_s};
use super::message::{Message, Reply, Request, Sync};
use super::{RATE_MAX_PPB, STEP_MIN_NS, Stamp, TIME_BYTES, Term};
use crate::frame::{BadFrame, FrameHead, HEAD_BYTES, NodeIndex};
use rohrpost_mailbox::{SystemTime, TimeRecord, TimeSource};
use std::collections::VecDeque;
use std::time::Duration;

/// Exchanges in an interval, and the shortest pause between two with one slave.
const EXCHANGES: u64 = 8;
const EXCHANGE_NS_MIN: u64 = 10_000_000;
/// Pause while a slave has too few samples.
const EAGER_NS: u64 = 20_000_000;
/// So many samples a slave has before it believes them, and before it is content.
const SAMPLES_MIN: u32 = 4;
const SAMPLES_EAGER: u32 = 8;
/// A slave answers a Sync at most so late: meanwhile its clock drifts from the master's.
const ANSWER_NS_MAX: u64 = 50_000_000;
const BUCKET_NS_MIN: u64 = 250_000_000;
/// A slave is mended within so long, or four exchanges.
const SERVO_NS_MIN: u64 = 250_000_000;
/// For so long the stated growth of the bound holds, and at least for four intervals; then a greater one is stated.
const HORIZON_NS_MIN: u64 = 2_000_000_000;
/// A master begins at most one epoch in so long.
const EPOCH_NS_MIN: u64 = 10_000_000_000;
/// Syncs of one slave, and exchanges of one master, that may be on their way.
const PENDING: usize = 4;
const SECOND_NS: u64 = 1_000_000_000;

/// What a clock knows before the first datagram.
#[derive(Clone, Debug)]
pub struct TimeSettings {
    /// First byte of the names of this system.
    pub system: u8,
    /// Which node it runs on.
    pub own: NodeIndex,
    /// Nodes of the system.
    pub nodes: u8,
    /// Which of them may be master, in order.
    pub masters: Vec<NodeIndex>,
    /// Of synchronisation, 1 ms to 10 s; the same on all nodes.
    pub interval: Duration,
    /// What must be equal on both ends of a wire.
    pub digest: u64,
    /// Tells this life of the router from its others; not 0.
    pub incarnation: u64,
}

/// What a node is for the others.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Role {
    /// Hears no master; if it has time, it goes on by its own clock.
    Listening,
    /// Follows a master.
    Slave,
    /// Is followed.
    Master,
}

/// What to do next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// The buffer has a datagram for this node. If it is to be stamped, its id comes back with [`Clock::sent`].
    Send {
        /// To whom.
        to: NodeIndex,
        /// Which it is, if its stamp matters.
        stamp: Option<SentId>,
    },
    /// Nothing before this moment, local monotonic ns, unless a datagram comes.
    Wait {
        /// Until then.
        until_ns: u64,
    },
}

/// Which datagram left.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SentId {
    /// To whom.
    pub to: NodeIndex,
    /// The sequence in its head.
    pub sequence: u64,
}

/// Why a datagram was not taken. Counted; none of these is an error of this node.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Ignored {
    /// Not of this system, for another node, or of another configuration.
    #[error("from or for somebody else")]
    Stranger,
    /// Wrong in itself.
    #[error(transparent)]
    Bad(#[from] BadFrame),
    /// Of a master that must yield, late, or twice.
    #[error("late, twice, or of a master that must yield")]
    Late,
    /// A reply to a question that nobody asked, or that was answered.
    #[error("no such question")]
    Unasked,
    /// The frames arrived before they left: a wrong stamp.
    #[error("frames that arrived before they left")]
    NegativeDelay,
}

/// What [`Clock::reading`] says.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Reading {
    /// System time, its epoch and its bound, by the node's page.
    pub time: SystemTime,
    /// The term that this time follows; its bound is about the time of this term.
    pub term: Term,
    /// System nanoseconds in a billion local ones.
    pub pace_ppb: u64,
    /// Whether the bound says anything at all.
    pub synchronised: bool,
}

/// One exchange, for who wants to look at it: stamps of both ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Exchange {
    /// Of Sync, Request and Reply.
    pub id: u64,
    /// Sync left: system ns, just before it was handed to the kernel.
    pub sync_sent_ns: u64,
    /// Sync left: system ns, as the master knows it.
    pub sync_left_ns: u64,
    /// Sync came: local.
    pub sync_came: Stamp,
    /// Request left: local, just before it was handed to the kernel.
    pub request_sent_ns: u64,
    /// Request left: local.
    pub request_left: Stamp,
    /// Request came: system ns.
    pub request_came_ns: u64,
    /// Reply left: system ns, just before it was handed to the kernel.
    pub reply_sent_ns: u64,
    /// Reply came: local.
    pub reply_came: Stamp,
    /// All four stamps that count are the kernel's.
    pub by_kernel: bool,
}

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
struct Asked {
    exchange: Exchange,
    sequence: u64,
}

/// What is about to be sent; its stamps are taken when it is.
#[derive(Clone, Copy, Debug)]
enum Draft {
    WarmUp,
    Sync { nominal_ns: u64 },
    Request { id: u64 },
    Reply { id: u64, came: Stamp },
}

/// The sans-I/O core of time. See the module's own page.
pub struct Clock {
    settings: TimeSettings,
    interval_ns: u64,
    exchange_ns: u64,
    election: Election,
    line: Line,
    history: History,
    /// How much system time is faster than the local clock, as last known.
    usual_rate: f64,
    /// The term that the line follows, and in which this node's own began.
    term: Term,
    began: Term,
    /// Until when the stated growth of the bound holds; and the span that it was stated for.
    stated: (u64, u64),
    /// It needs a new epoch.
    far: bool,
    epoch_began_ns: u64,
    slaves: Vec<Slave>,
    asked: [Asked; PENDING],
    asked_ns: u64,
    hello_ns: u64,
    drafts: VecDeque<(NodeIndex, Draft)>,
    sequences: Vec<u64>,
    last_id: u64,
    last: Option<Exchange>,
    offset_ns: i64,
    contradictions: u64,
    #[cfg(any(test, feature = "broken-variants"))]
    pub(super) broken: Option<Broken>,
}

impl Clock {
    /// A clock that has heard nobody yet. `wall_ns` is this computer's wall clock, by which the first epoch begins if this node becomes
    /// the first master; `page` what the node's time page says, if there is one: an earlier life's time goes on.
    pub fn new(settings: TimeSettings, now_ns: u64, wall_ns: u64, page: Option<TimeRecord>) -> Self {
        let interval_ns = u64::try_from(settings.interval.as_nanos()).unwrap_or(u64::MAX).max(1);
        let exchange_ns = (interval_ns / EXCHANGES).max(interval_ns.min(EXCHANGE_NS_MIN));
        let line = match page {
            Some(page)
                if page.source == TimeSource::Master && page.monotonic_ns <= now_ns.saturating_add(SECOND_NS) =>
            {
                Line::adopted(now_ns, page)
            }
            Some(page) => Line::unsynchronised(now_ns, wall_ns, page.epoch.saturating_add(1)),
            None => Line::unsynchronised(now_ns, wall_ns, 0),
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
            stated: (now_ns, interval_ns.saturating_mul(4).max(HORIZON_NS_MIN)),
            far: false,
            epoch_began_ns: 0,
            slaves: vec![Slave::default(); nodes],
            asked: [Asked::default(); PENDING],
            asked_ns: 0,
            hello_ns: now_ns,
            drafts: VecDeque::with_capacity(2 * nodes + 2 * PENDING),
            sequences: vec![0; nodes],
            last_id: 0,
            last: None,
            offset_ns: 0,
            contradictions: 0,
            #[cfg(any(test, feature = "broken-variants"))]
            broken: None,
            settings,
        }
    }

    /// Takes a datagram of time that came at `received`.
    ///
    /// # Errors
    /// [`Ignored`]: it changed nothing.
    pub fn handle(&mut self, now_ns: u64, received: Stamp, head: &FrameHead, rest: &[u8]) -> Result<(), Ignored> {
        let ours =
            head.system == self.settings.system && head.digest == self.settings.digest && head.to == self.settings.own;
        if !ours || head.from == self.settings.own || head.from >= self.settings.nodes {
            return Err(Ignored::Stranger);
        }
        match Message::parse(head.kind, rest)? {
            Message::WarmUp => Ok(()),
            Message::Sync(sync) => self.sync(now_ns, received, head, &sync),
            Message::Request(request) => self.request(received, head.from, &request),
            Message::Reply(reply) => self.reply(now_ns, received, head, &reply),
        }
    }

    /// When a datagram that [`Step::Send`] asked to be stamped left.
    pub fn sent(&mut self, id: SentId, stamp: Stamp) {
        let Some(slave) = self.slaves.get_mut(usize::from(id.to)) else { return };
        if let Some(left) = slave.syncs.iter_mut().find(|left| left.id != 0 && left.sequence == id.sequence) {
            left.at = stamp;
        }
        let mut asked = self.asked.iter_mut();
        if let Some(asked) = asked.find(|asked| asked.exchange.id != 0 && asked.sequence == id.sequence)
            && let State::Slave(master) = self.election.state()
            && master.node == id.to
        {
            asked.exchange.request_left = stamp;
        }
    }

    /// What is to be done now. To be called again after each datagram sent or taken, and when the time has come. `now_ns` goes into the
    /// datagram: it is to be read just before.
    pub fn poll(&mut self, now_ns: u64, datagram: &mut [u8; TIME_BYTES]) -> Step {
        self.line.end_slew(now_ns);
        self.keep_bound(now_ns);
        if self.election.falls_silent(now_ns) {
            self.line.stop_slew(now_ns);
            self.forget();
            self.hello_ns = now_ns;
        }
        if let Some(term) = self.election.takes_over(now_ns, self.line.is_synchronised()) {
            self.reign(now_ns, term);
        }
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

    /// What the node's page is to say. It changes only within [`Self::handle`], [`Self::poll`] and [`Self::page_says`].
    pub fn record(&self) -> &TimeRecord {
        self.line.record()
    }

    /// The page could not be written in time, and says this: time goes on from there, and [`Self::record`] is to be written anew.
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

    /// What this node is.
    pub fn role(&self) -> Role {
        match self.election.state() {
            State::Listening => Role::Listening,
            State::Slave(_) => Role::Slave,
            State::Master(_) => Role::Master,
        }
    }

    /// The term of the master that is heard, or of this node's own reign; none while listening. [`Reading::term`] follows when it is
    /// measured.
    pub fn term(&self) -> Term {
        match self.election.state() {
            State::Listening => Term::NONE,
            State::Slave(master) => master.term,
            State::Master(term) => term,
        }
    }

    /// The master that this node follows, or itself.
    pub fn master(&self) -> Option<NodeIndex> {
        match self.election.state() {
            State::Listening => None,
            State::Slave(master) => Some(master.node),
            State::Master(_) => Some(self.settings.own),
        }
    }

    /// When the master was heard last, local ns; this node's own time is heard always.
    pub fn heard_ns(&self, now_ns: u64) -> Option<u64> {
        match self.election.state() {
            State::Listening => None,
            State::Slave(master) => Some(master.heard_ns),
            State::Master(_) => Some(now_ns),
        }
    }

    /// How far the page lay off the best guess when the master was last measured, ns.
    pub fn offset_ns(&self) -> i64 {
        self.offset_ns
    }

    /// How much faster than this node's clock system time runs, as last known, ns a second.
    pub fn rate_ppb(&self) -> i64 {
        (self.usual_rate * 1e9).round() as i64
    }

    /// Delay of both ways together in the best exchange that counts, ns.
    pub fn delay_ns(&self) -> Option<u64> {
        self.history.delay_ns()
    }

    /// How often a clock did what it must not, so that all samples were thrown away.
    pub fn contradictions(&self) -> u64 {
        self.contradictions
    }

    /// The last exchange, taken out.
    pub fn take_exchange(&mut self) -> Option<Exchange> {
        self.last.take()
    }

    fn sync(&mut self, now_ns: u64, received: Stamp, head: &FrameHead, sync: &Sync) -> Result<(), Ignored> {
        let was_master = matches!(self.election.state(), State::Master(_));
        let followed = self.is_followed(now_ns);
        if was_master && self.is(Broken::Stubborn) {
            return Err(Ignored::Late);
        }
        match self.election.sync(head.from, head.incarnation, sync, received.ns, followed) {
            Heard::Ignored => {
                self.keep_term();
                return Err(Ignored::Late);
            }
            Heard::Turned => {
                self.line.stop_slew(now_ns);
                self.forget();
                if was_master {
                    self.drafts.clear();
                }
            }
            Heard::Followed if self.term.rank() == sync.term.rank() && !self.history.is_new() => self.term = sync.term,
            Heard::Followed => {}
        }
        let pause_ns = self.exchange_ns.min(EXCHANGE_NS_MIN) / 2;
        let pauses = received.ns.saturating_sub(self.asked_ns) < pause_ns;
        if pauses || now_ns.saturating_sub(received.ns) > ANSWER_NS_MAX {
            return Ok(());
        }
        self.asked_ns = received.ns;
        let exchange = Exchange { id: sync.id, sync_sent_ns: sync.sent_ns, sync_came: received, ..Exchange::default() };
        self.asked.rotate_right(1);
        self.asked[0] = Asked { exchange, ..Asked::default() };
        self.drafts.retain(|(_, draft)| !matches!(draft, Draft::Request { .. }));
        self.drafts.push_back((head.from, Draft::WarmUp));
        self.drafts.push_back((head.from, Draft::Request { id: sync.id }));
        Ok(())
    }

    fn request(&mut self, received: Stamp, from: NodeIndex, request: &Request) -> Result<(), Ignored> {
        if request.id == 0 {
            self.election.hello(request, received.ns);
            self.keep_term();
            // Whoever asks for a master gets its time at once.
            if matches!(self.election.state(), State::Master(_)) {
                self.slaves[usize::from(from)].next_ns = 0;
            }
            return Ok(());
        }
        let State::Master(own) = self.election.state() else { return Err(Ignored::Unasked) };
        let slave = &mut self.slaves[usize::from(from)];
        if !slave.syncs.iter().any(|left| left.id == request.id) {
            return Err(Ignored::Unasked);
        }
        if slave.answered_ns.is_none() || (request.eager && !slave.eager) {
            slave.next_ns = 0;
        }
        (slave.answered_ns, slave.eager) = (Some(received.ns), request.eager);
        if request.far && request.term.round() <= own.round() {
            self.begin_epoch(received.ns, request.epoch);
        }
        if self.drafts.len() < self.drafts.capacity() {
            self.drafts.push_back((from, Draft::Reply { id: request.id, came: received }));
        }
        Ok(())
    }

    fn reply(&mut self, now_ns: u64, received: Stamp, head: &FrameHead, reply: &Reply) -> Result<(), Ignored> {
        let State::Slave(master) = self.election.state() else { return Err(Ignored::Unasked) };
        if (head.from, head.incarnation, reply.began) != (master.node, master.incarnation, master.began) {
            return Err(Ignored::Unasked);
        }
        let any = self.is(Broken::AnyReply);
        let mut asked = self.asked.iter_mut();
        let asked = asked.find(|asked| (asked.exchange.id == reply.id || any) && asked.exchange.request_sent_ns != 0);
        let mut exchange = asked.map(std::mem::take).ok_or(Ignored::Unasked)?.exchange;
        exchange.sync_left_ns = reply.sync_ns;
        exchange.request_came_ns = reply.request_ns;
        (exchange.reply_sent_ns, exchange.reply_came) = (reply.sent_ns, received);
        let master_by_kernel = reply.sync_by_kernel && reply.request_by_kernel;
        exchange.by_kernel = master_by_kernel && exchange.sync_came.by_kernel && exchange.request_left.by_kernel;
        self.election.reply(reply.epoch, reply.error_ns, received.ns);
        let doubt_ns = exchange.sync_came.doubt_ns.max(exchange.request_left.doubt_ns);
        let sample =
            sample(&exchange, u64::from(doubt_ns) + u64::from(reply.doubt_ns)).ok_or(Ignored::NegativeDelay)?;
        self.last = Some(exchange);
        self.history.add(sample);
        if self.history.samples() >= SAMPLES_MIN {
            self.discipline(now_ns, sample);
        }
        Ok(())
    }

    /// The servo: from what was measured, where the line is to go.
    fn discipline(&mut self, now_ns: u64, newest: Sample) {
        let State::Slave(master) = self.election.state() else { return };
        let Some(estimate) = self.history.estimate(now_ns, self.usual_rate) else {
            self.contradictions += 1;
            self.forget();
            self.history.add(newest);
            return;
        };
        self.usual_rate = estimate.rate;
        let pace_ppb = EVEN_PPB.saturating_add_signed((estimate.rate * 1e9).round() as i64);
        let drift_ns_s = self.drift_ns_s(&estimate, pace_ppb);
        let target_ns = now_ns.saturating_add_signed(estimate.offset_ns);
        let epoch = self.line.record().epoch;
        let by_ns = target_ns.wrapping_sub(self.line.at(now_ns).ns).cast_signed();
        if master.epoch > epoch || self.is(Broken::Steps) {
            let error_ns = self.bound_ns(&estimate, estimate.offset_ns, &master);
            self.line.step(now_ns, master.epoch, target_ns, pace_ppb, error_ns, drift_ns_s);
        } else if master.epoch < epoch || !self.line.is_synchronised() || by_ns.unsigned_abs() > STEP_MIN_NS {
            self.far = true;
            return;
        } else {
            let page_ns = self.line.at(now_ns).ns.wrapping_sub(now_ns).cast_signed();
            let target_error_ns = self.bound_ns(&estimate, estimate.offset_ns, &master);
            let error_ns = self.bound_ns(&estimate, page_ns, &master).max(target_error_ns);
            let within_ns = self.exchange_ns.saturating_mul(4).max(SERVO_NS_MIN);
            self.line.bend(now_ns, by_ns, within_ns, pace_ppb, error_ns, drift_ns_s);
        }
        (self.term, self.far, self.offset_ns) = (master.term, false, by_ns);
        self.stated = (now_ns.saturating_add(self.horizon_ns()), self.horizon_ns());
    }

    /// How far a line may be off that is `offset_ns` from the local clock now.
    fn bound_ns(&self, estimate: &Estimate, offset_ns: i64, master: &Followed) -> u64 {
        let off_ns = (estimate.high_ns - offset_ns).max(offset_ns - estimate.low_ns).unsigned_abs();
        let off_ns = if self.is(Broken::HalfBound) { off_ns / 2 } else { off_ns };
        off_ns.saturating_add(if self.is(Broken::NoMasterError) { 0 } else { master.error_ns })
    }

    /// How fast a bound may grow until the horizon, ns a second.
    fn drift_ns_s(&self, estimate: &Estimate, pace_ppb: u64) -> u64 {
        let pace = rate_of(pace_ppb);
        let off = (pace - estimate.rate_low).max(estimate.rate_high - pace).max(0.0);
        (off * 1e9).ceil() as u64 + wander_ns_s(self.horizon_ns()) + 1
    }

    fn horizon_ns(&self) -> u64 {
        self.interval_ns.saturating_mul(4).max(HORIZON_NS_MIN)
    }

    /// Without a master for longer than was thought of, the rate may have changed more: the bound grows faster.
    fn keep_bound(&mut self, now_ns: u64) {
        let (until_ns, span_ns) = self.stated;
        if self.is(Broken::NoDrift) {
            self.line.restate(self.line.record().error_ns, 0);
        } else if until_ns <= now_ns && self.is_held_over() {
            let record = self.line.record();
            let drift_ns_s = record.drift_ns_s.saturating_add(wander_ns_s(span_ns));
            self.line.restate(record.error_ns, drift_ns_s.min(2 * RATE_MAX_PPB.unsigned_abs()));
            self.stated = (now_ns.saturating_add(span_ns), span_ns.saturating_mul(2));
        }
    }

    fn is_held_over(&self) -> bool {
        let is_master = matches!(self.election.state(), State::Master(_));
        let at_most = self.line.record().drift_ns_s >= 2 * RATE_MAX_PPB.unsigned_abs();
        self.line.is_synchronised() && !is_master && !at_most
    }

    /// This node is master from now on. If it has time, that goes on; else the first epoch begins by its wall clock.
    fn reign(&mut self, now_ns: u64, term: Term) {
        self.line.stop_slew(now_ns);
        if self.line.is_synchronised() {
            self.line.become_reference(now_ns);
        } else {
            let epoch = self.line.record().epoch.max(self.election.highest_epoch()).saturating_add(1);
            let system_ns = self.line.at(now_ns).ns;
            self.line.step(now_ns, epoch, system_ns, EVEN_PPB, 0, 0);
        }
        self.forget();
        self.drafts.clear();
        (self.term, self.began) = (term, term);
        (self.offset_ns, self.far, self.epoch_began_ns) = (0, false, 0);
        self.slaves.iter_mut().for_each(|slave| *slave = Slave { next_ns: now_ns, ..Slave::default() });
    }

    /// A master's own term may have been raised: its timeline goes on.
    fn keep_term(&mut self) {
        if let State::Master(term) = self.election.state() {
            self.term = term;
        }
    }

    /// Somebody is too far off to slew, or has seen a later epoch.
    fn begin_epoch(&mut self, now_ns: u64, theirs: u64) {
        let own = self.line.record().epoch;
        let pause_ns = EPOCH_NS_MIN.max(self.interval_ns);
        let pauses = self.epoch_began_ns != 0 && now_ns.saturating_sub(self.epoch_began_ns) < pause_ns;
        if theirs >= own && !pauses {
            self.line.rename(theirs.saturating_add(1));
            self.epoch_began_ns = now_ns;
        }
    }

    /// What was measured of another timeline does not count any more.
    fn forget(&mut self) {
        if !self.is(Broken::OldSamples) {
            self.history.clear();
        }
        self.asked = [Asked::default(); PENDING];
        self.asked_ns = 0;
        self.far = false;
    }

    fn is_followed(&self, now_ns: u64) -> bool {
        self.slaves.iter().any(|slave| self.answers(slave, now_ns))
    }

    fn answers(&self, slave: &Slave, now_ns: u64) -> bool {
        let recently_ns = self.interval_ns.saturating_mul(4).max(4 * EAGER_NS);
        slave.answered_ns.is_some_and(|answered| now_ns.saturating_sub(answered) < recently_ns)
    }

    /// What is due without anybody having asked.
    fn draft(&mut self, now_ns: u64) {
        match self.election.state() {
            State::Listening if self.hello_ns <= now_ns => {
                self.hello_ns = now_ns.saturating_add(self.interval_ns);
                for master in self.election.masters().iter().filter(|master| **master != self.settings.own) {
                    self.drafts.push_back((*master, Draft::Request { id: 0 }));
                }
            }
            State::Listening | State::Slave(_) => {}
            State::Master(_) => {
                let due = (0..self.settings.nodes)
                    .filter(|node| *node != self.settings.own)
                    .find(|node| self.slaves[usize::from(*node)].next_ns <= now_ns);
                if let Some(node) = due {
                    self.draft_sync(now_ns, node);
                }
            }
        }
    }

    fn draft_sync(&mut self, now_ns: u64, node: NodeIndex) {
        let slave = &self.slaves[usize::from(node)];
        let answers = self.answers(slave, now_ns);
        let every_ns = match answers {
            // Nobody may be there.
            false => self.interval_ns,
            true if slave.eager => self.exchange_ns.min(EAGER_NS),
            true => self.exchange_ns,
        };
        // In step with system time, so that the next master goes on in step; slaves one after the other.
        let system_ns = self.line.at(now_ns).ns;
        let shift_ns = every_ns / u64::from(self.settings.nodes) * u64::from(node);
        let nominal_ns = system_ns.saturating_sub(shift_ns) / every_ns * every_ns + shift_ns;
        let next_ns = now_ns + (nominal_ns + every_ns).saturating_sub(system_ns).clamp(every_ns / 4, 2 * every_ns);
        self.slaves[usize::from(node)].next_ns = next_ns;
        if answers {
            self.drafts.push_back((node, Draft::WarmUp));
        }
        self.drafts.push_back((node, Draft::Sync { nominal_ns }));
    }

    fn deadline_ns(&self, now_ns: u64) -> u64 {
        let role_ns = match self.election.state() {
            State::Master(_) => {
                let others = self.slaves.iter().enumerate().filter(|(node, _)| *node != usize::from(self.settings.own));
                others.map(|(_, slave)| slave.next_ns).min()
            }
            State::Listening => Some(self.hello_ns),
            State::Slave(_) => None,
        };
        let bound_ns = self.is_held_over().then_some(self.stated.0);
        let election_ns = self.election.deadline_ns(now_ns, self.line.is_synchronised());
        let deadlines = [role_ns, self.line.slew_end_ns(), bound_ns, election_ns];
        deadlines.into_iter().flatten().min().unwrap_or(now_ns + SECOND_NS).max(now_ns)
    }

    /// Writes a datagram, with stamps of now. None when it is not wanted any more.
    fn write(
        &mut self,
        now_ns: u64,
        to: NodeIndex,
        draft: Draft,
        datagram: &mut [u8; TIME_BYTES],
    ) -> Option<Option<SentId>> {
        let sequence = self.sequences[usize::from(to)];
        let message = match draft {
            Draft::WarmUp => Message::WarmUp,
            Draft::Sync { nominal_ns } => Message::Sync(self.write_sync(now_ns, to, nominal_ns, sequence)?),
            Draft::Request { id } => Message::Request(self.write_request(now_ns, id, sequence)?),
            Draft::Reply { id, came } => Message::Reply(self.write_reply(now_ns, to, id, came)?),
        };
        self.sequences[usize::from(to)] += 1;
        let TimeSettings { system, own: from, digest, incarnation, .. } = self.settings;
        let head = FrameHead { kind: message.kind(), system, from, to, digest, incarnation, sequence };
        let rest = message.to_bytes();
        datagram[..HEAD_BYTES].copy_from_slice(&head.to_bytes(&[&rest]));
        datagram[HEAD_BYTES..].copy_from_slice(&rest);
        let stamped = matches!(message, Message::Sync(_) | Message::Request(Request { id: 1.., .. }));
        Some(stamped.then_some(SentId { to, sequence }))
    }

    fn write_sync(&mut self, now_ns: u64, to: NodeIndex, nominal_ns: u64, sequence: u64) -> Option<Sync> {
        let State::Master(term) = self.election.state() else { return None };
        self.last_id += 1;
        let (id, at) = (self.last_id, Stamp::by_us(now_ns));
        let syncs = &mut self.slaves[usize::from(to)].syncs;
        syncs.rotate_right(1);
        syncs[0] = Left { id, sequence, at };
        let (epoch, error_ns) = (self.line.record().epoch, self.line.error_ns(now_ns));
        let cycle = nominal_ns / self.interval_ns;
        let (sent_ns, began, followed) = (self.line.at(now_ns).ns, self.began, self.is_followed(now_ns));
        Some(Sync { id, cycle, nominal_ns, sent_ns, error_ns, epoch, term, began, followed })
    }

    fn write_request(&mut self, now_ns: u64, id: u64, sequence: u64) -> Option<Request> {
        if id != 0 {
            let asked = self.asked.iter_mut().find(|asked| asked.exchange.id == id)?;
            asked.sequence = sequence;
            (asked.exchange.request_sent_ns, asked.exchange.request_left) = (now_ns, Stamp::by_us(now_ns));
        }
        Some(Request {
            id,
            error_ns: self.line.error_ns(now_ns),
            epoch: self.line.record().epoch,
            term: self.term,
            eager: self.history.samples() < SAMPLES_EAGER,
            far: self.far,
            timed: self.line.is_synchronised(),
        })
    }

    fn write_reply(&mut self, now_ns: u64, to: NodeIndex, id: u64, came: Stamp) -> Option<Reply> {
        let State::Master(term) = self.election.state() else { return None };
        let left = self.slaves[usize::from(to)].syncs.iter().find(|left| left.id == id)?.at;
        Some(Reply {
            id,
            sync_ns: self.line.at(left.ns).ns,
            request_ns: self.line.at(came.ns).ns,
            sent_ns: self.line.at(now_ns).ns,
            error_ns: self.line.error_ns(now_ns),
            epoch: self.line.record().epoch,
            term,
            began: self.began,
            doubt_ns: left.doubt_ns.max(came.doubt_ns),
            sync_by_kernel: left.by_kernel,
            request_by_kernel: came.by_kernel,
        })
    }
}

/// The interval that an exchange leaves for `system − local` when the Request left. None when the frames took less than no time.
fn sample(exchange: &Exchange, doubt_ns: u64) -> Option<Sample> {
    let (came_ns, left_ns) = (exchange.sync_came.ns, exchange.request_left.ns);
    let waited_ns = left_ns.checked_sub(came_ns)?;
    let low_ns = exchange.sync_left_ns.wrapping_sub(came_ns).cast_signed();
    let high_ns = exchange.request_came_ns.wrapping_sub(left_ns).cast_signed();
    if high_ns <= low_ns {
        return None;
    }
    // Between both of our stamps our clock drifted; the master's are whole numbers.
    let drifted_ns = u128::from(waited_ns) * RATE_MAX_PPB as u128 / 1_000_000_000;
    let doubt_ns = doubt_ns.saturating_add(drifted_ns as u64).saturating_add(2).cast_signed();
    Some(Sample {
        local_ns: left_ns,
        low_ns: low_ns.saturating_sub(doubt_ns),
        high_ns: high_ns.saturating_add(doubt_ns),
    })
}

fn rate_of(pace_ppb: u64) -> f64 {
    (pace_ppb as f64 - EVEN_PPB as f64) * 1e-9
}
