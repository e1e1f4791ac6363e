//! Senders and receivers killed at random moments, thousands of times: nothing torn, stuck, out of order or hidden.
//!
//! In the full run each policy sees 10 000 kills:
//! `ROHRPOST_STORM_KILLS=10000 cargo test -p rohrpost-mailbox --test storm -- --nocapture`
//!
//! What a kill may cost is exactly one package in the accounts, and only of a process that was inside an operation (see
//! `common/board.rs`). Besides, each sender that had counted what it displaced when its mailbox was replaced by one of
//! another shape counts it a second time.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::board::{Board, MAILBOXES, Mark, PRIORITIES, missing};
use common::crew::{Actor, alone, master};
use common::load::{Listener, Talker, WaitMode, Weather};
use common::random::Random;
use common::{Ground, PATIENCE, label, received, shape, tell};
use rohrpost_mailbox::{Loss, MailboxInfo, Node, OverflowPolicy, Participant, SendError, Shape};
use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

const SENDERS: usize = 4;
/// The seat of the one that receives from all mailboxes.
const RECEIVER: usize = SENDERS;
/// Kills from one look at everything to the next, and until all are killed at once.
const CALM_EVERY: u64 = 40;
const AUDIT_EVERY: u64 = 400;

/// Of each mailbox two shapes, which replace each other.
fn shapes(full: OverflowPolicy, which: usize) -> [Shape; MAILBOXES.len()] {
    let of = |slots, body_bytes_max| Shape { full, body_bytes_max, ..shape(slots) };
    [[of(16, 256), of(3, 256)], [of(65, 100), of(5, 700)]][which]
}

fn kills() -> u64 {
    std::env::var("ROHRPOST_STORM_KILLS").map_or(1_000, |kills| kills.parse().expect("a number of kills"))
}

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    let full = OverflowPolicy::ALL.into_iter().find(|full| role.ends_with(full.name())).unwrap();
    master(|| Storm::new(ground, full).rage(kills()));
    tell("done");
}

#[test]
fn kills_under_displace_leave_nothing_torn_stuck_or_hidden() {
    alone(&Ground::in_memory(), "storm, displace");
}

#[test]
fn kills_under_reject_leave_nothing_torn_stuck_or_hidden() {
    alone(&Ground::in_memory(), "storm, reject");
}

#[test]
fn kills_under_latest_leave_nothing_torn_stuck_or_hidden() {
    alone(&Ground::in_memory(), "storm, latest");
}

/// Which shapes the mailboxes have, as far as the master knows.
struct Shaped {
    wanted: usize,
    /// A receiver has said that they have these.
    known: Option<usize>,
    /// Times that a receiver may have replaced them, or begun to.
    replacements: u64,
}

struct Storm {
    ground: Ground,
    node: Arc<Node>,
    full: OverflowPolicy,
    board: Board,
    random: Random,
    actors: Vec<Actor>,
    runs: u32,
    shaped: Shaped,
    kills: u64,
    /// Kills of those that were inside an operation.
    in_flight: u64,
    deadline: Instant,
}

impl Storm {
    fn new(ground: Ground, full: OverflowPolicy) -> Self {
        let node = ground.node();
        // An incarnation for each kill, and for the processes that live at the end of each part.
        let board = Board::new((kills() * 2) as usize + 100 * SENDERS);
        let random = Random::from_environment();
        let shaped = Shaped { wanted: 0, known: None, replacements: 0 };
        let mut storm = Self {
            ground,
            node,
            full,
            board,
            random,
            actors: Vec::new(),
            runs: 0,
            shaped,
            kills: 0,
            in_flight: 0,
            deadline: Instant::now() + PATIENCE,
        };
        // The mailboxes exist before anybody sends.
        drop(Listener::new(board, &storm.ground.join(), &shapes(full, 0), WaitMode::Polling));
        storm.start_all();
        storm
    }

    fn rage(&mut self, kills: u64) {
        let began = Instant::now();
        while self.kills < kills {
            std::thread::sleep(Duration::from_micros(self.random.below(2_000)));
            self.kill_one();
            if self.kills.is_multiple_of(CALM_EVERY) {
                self.calm();
            }
            if self.kills.is_multiple_of(AUDIT_EVERY) || self.kills == kills {
                self.kill_all();
                self.audit();
                tell(format_args!("{} kills in {:.1?}", self.kills, began.elapsed()));
                self.start_all();
            }
        }
        self.kill_all();
        self.audit();
        assert!(self.node.participants().is_empty());
        self.assert_was_busy(kills);
    }

    fn start_all(&mut self) {
        self.actors = (0..=SENDERS).map(|seat| self.start(seat)).collect();
    }

    fn start(&mut self, seat: usize) -> Actor {
        self.board.seat(seat).reset();
        if seat == RECEIVER { self.start_receiver() } else { self.start_sender(seat) }
    }

    fn start_sender(&mut self, seat: usize) -> Actor {
        self.runs += 1;
        let (path, board, run, full) = (self.ground.path(), self.board, self.runs, self.full);
        Actor::new(|| {
            let me = Participant::join(&Node::open(path).unwrap(), rohrpost_mailbox::Name::NONE).unwrap();
            let senders = MAILBOXES.iter().map(|name| me.sender(*name).unwrap()).collect();
            Talker::new(board, seat, run, full, senders, Weather::Stormy).talk();
        })
    }

    fn start_receiver(&mut self) -> Actor {
        if self.random.one_in(6) {
            self.shaped.wanted ^= 1;
        }
        if self.shaped.known != Some(self.shaped.wanted) {
            self.shaped.known = None;
            self.shaped.replacements += MAILBOXES.len() as u64;
        }
        let way = WaitMode::ALL[self.random.below(WaitMode::ALL.len() as u64) as usize];
        let (path, board, shapes) = (self.ground.path(), self.board, shapes(self.full, self.shaped.wanted));
        Actor::new(|| {
            let seat = board.seat(RECEIVER);
            seat.operate(|| {
                let me = Participant::join(&Node::open(path).unwrap(), rohrpost_mailbox::Name::NONE).unwrap();
                let mut listener = Listener::new(board, &me, &shapes, way);
                seat.set_ready();
                loop {
                    listener.once();
                }
            })
        })
    }

    /// One of them, wherever it is; another takes its seat.
    fn kill_one(&mut self) {
        let seat = self.random.below(self.actors.len() as u64) as usize;
        self.deadline = Instant::now() + PATIENCE;
        // Some while they start; most at work, however busy the computer is.
        if !self.random.one_in(4) {
            self.wait("the process to be killed works", |storm| storm.board.seat(seat).is_ready());
            std::thread::sleep(Duration::from_micros(self.random.below(500)));
        }
        let actor = self.actors.swap_remove(seat);
        self.kill(actor, seat);
        let instead = self.start(seat);
        self.actors.push(instead);
        let last = self.actors.len() - 1;
        self.actors.swap(seat, last);
    }

    fn kill_all(&mut self) {
        for (seat, actor) in std::mem::take(&mut self.actors).into_iter().enumerate() {
            self.kill(actor, seat);
        }
    }

    fn kill(&mut self, actor: Actor, seat: usize) {
        actor.kill();
        self.kills += 1;
        self.in_flight += u64::from(self.board.seat(seat).is_busy());
        if seat == RECEIVER && self.board.seat(seat).is_ready() {
            self.shaped.known = Some(self.shaped.wanted);
        }
        self.node.announce_death();
    }

    /// Nobody sends: a receiver that sleeps beside a package now has missed its wake-up.
    fn calm(&mut self) {
        self.deadline = Instant::now() + PATIENCE;
        self.board.hold(true);
        self.wait("all senders hold still", |storm| (0..SENDERS).all(|seat| storm.board.is_still(seat)));
        self.wait("all is received", |storm| storm.look().iter().all(|info| info.depth == 0));
        self.check_accounts();
        self.board.hold(false);
    }

    fn wait(&self, what: &str, done: impl Fn(&Self) -> bool) {
        while !done(self) {
            self.actors.iter().for_each(Actor::assert_alive);
            assert!(Instant::now() < self.deadline, "{self}: waited too long until {what}: {:#?}", self.look());
            std::thread::sleep(Duration::from_micros(100));
        }
    }

    fn look(&self) -> [MailboxInfo; MAILBOXES.len()] {
        MAILBOXES.map(|name| self.node.look_at(name).unwrap())
    }

    /// Adopts what processes left that were all killed at once, and uses each slot again.
    fn audit(&mut self) {
        let me = self.ground.join();
        let shapes = shapes(self.full, self.shaped.known.unwrap_or(self.shaped.wanted));
        if self.shaped.known.is_none() {
            self.shaped.replacements += MAILBOXES.len() as u64;
        }
        let mut listener = Listener::new(self.board, &me, &shapes, WaitMode::Polling);
        listener.drain();
        self.check_accounts();
        self.runs += 1;
        for (mailbox, shape) in shapes.iter().enumerate() {
            self.fill(&me, mailbox, shape);
        }
        listener.drain();
        self.check_accounts();
    }

    /// All slots of an empty mailbox, and not one more.
    fn fill(&self, me: &Arc<Participant>, mailbox: usize, shape: &Shape) {
        let mut sender = me.sender(MAILBOXES[mailbox]).unwrap();
        for number in 1..=u32::from(shape.slots) + 1 {
            let mark = Mark { run: self.runs, number, mailbox: mailbox as u8, key: 0, class: 0 };
            let mut body = [0; 40];
            mark.write(&mut body);
            let sent = sender.send(&label(PRIORITIES[0], number as u16), &[&body]);
            match sent {
                Ok(()) => self.board.accepted(&mark),
                Err(SendError::Full(_)) => self.board.refused(&mark),
                Err(error) => panic!("{error}"),
            }
            assert_eq!(number > u32::from(shape.slots), sent.is_err(), "{self}: slot {number}");
        }
        assert_eq!(self.look()[mailbox].depth, u32::from(shape.slots));
    }

    /// Nothing waits. What was accepted was received or counted as lost, each package of it; and too much was counted
    /// at most once for each process killed in flight, and for each sender when a mailbox was replaced. Returns how
    /// much it was.
    fn check_accounts(&self) -> u64 {
        let (mut too_many, mut off) = (0, 0);
        for (mailbox, info) in self.look().into_iter().enumerate() {
            let tally = self.board.tally(mailbox);
            let (accepted, lost): (u64, u64) = (tally.accepted.iter().sum(), missing(&info));
            let more = (tally.received + lost).checked_sub(accepted);
            too_many += more.unwrap_or_else(|| {
                let received = tally.received;
                panic!("{self}: {accepted} accepted, only {received} received and {lost} counted as lost: {info:#?}")
            });
            off += info.sent.abs_diff(common::accounted(&info));
        }
        let most = self.in_flight + SENDERS as u64 * self.shaped.replacements;
        assert!(too_many <= most && off <= most, "{self}: {too_many} too many, {off} off: {:#?}", self.look());
        too_many
    }

    /// A storm in which little happens would prove little.
    fn assert_was_busy(&self, kills: u64) {
        let infos = self.look();
        let cause = match self.full {
            OverflowPolicy::Displace => Loss::Displaced,
            OverflowPolicy::Latest => Loss::Replaced,
            OverflowPolicy::Reject => Loss::Refused,
        };
        let lost = |cause| infos.iter().map(|info| common::lost(info, cause)).sum::<u64>();
        let (received, gone) = (infos.iter().map(received).sum::<u64>(), lost(cause));
        let adoptions: u32 = infos.iter().map(|info| info.adoptions).sum();
        let [unfinished, poison] = [Loss::Unfinished, Loss::Poison].map(lost);
        let (cause, too_many) = (cause.word(), self.check_accounts());
        tell(format_args!(
            "{self}, {adoptions} adoptions since the last: {received} received, {gone} {cause}, {unfinished} \
            unfinished, {poison} \
             poison; {too_many} counted too many"
        ));
        assert!(received > kills && gone > kills / 10 && self.in_flight > kills / 10, "too quiet to prove anything");
    }
}

impl fmt::Display for Storm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kills, in_flight, replacements) = (self.kills, self.in_flight, self.shaped.replacements);
        write!(f, "{}: {kills} kills, {in_flight} in flight, {replacements} replacements", self.full.name())
    }
}
