//! A process that is stopped in the middle of an operation holds nobody up: there is no lock, and nothing spins on
//! another process. Stopped at random moments, and after each single instruction; and killed after some of them, or
//! after each: `ROHRPOST_INSTRUCTION_KILLS=1000000 cargo test -p rohrpost-mailbox --test stops -- --nocapture
//! instruction`

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::board::{Board, MAILBOXES, missing, shared};
use common::crew::{Actor, alone, be_led, instruction_kills, master};
use common::load::{Listener, Talker, WaitMode, Weather};
use common::random::Random;
use common::{Ground, HIGH, LOW, MAILBOX, label, received, shape, tell, until};
use rohrpost_mailbox::{Loss, Node, OverflowPolicy, Participant, Priority, Receiver, SendError, Sender, Shape};
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::time::Duration;

const SENDERS: usize = 4;
/// The seat of the receiver.
const RECEIVER: usize = SENDERS;
const STOPS: u64 = 100;

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    master(|| match (role.as_str(), OverflowPolicy::ALL.into_iter().find(|full| full.name() == role)) {
        (_, Some(full)) => stop_and_go(&ground, full),
        ("instructions", None) => OPERATIONS.iter().for_each(|operation| operation.prove(&ground)),
        (other, None) => panic!("no role {other}"),
    });
    tell("done");
}

#[test]
fn a_process_stopped_at_random_holds_nobody_up() {
    OverflowPolicy::ALL.into_iter().for_each(|full| alone(&Ground::in_memory(), full.name()));
}

// Other processors may have atomics of two instructions, of which the second fails when the process was stopped after
// the first.
#[cfg(target_arch = "x86_64")]
#[test]
fn a_process_stopped_after_any_instruction_holds_nobody_up() {
    alone(&Ground::in_memory(), "instructions");
}

/// Senders and then the receiver are stopped at random moments: all others go on, and nothing is lost when they do too.
fn stop_and_go(ground: &Ground, full: OverflowPolicy) {
    let board = Board::new(SENDERS + 1);
    let mut random = Random::from_environment();
    let shape = Shape { full, ..shape(SENDERS as u16 + 2) };
    drop(Listener::new(board, &ground.join(), &[shape], WaitMode::Polling));
    let actors: Vec<Actor> = (0..=SENDERS)
        .map(|seat| {
            let way = WaitMode::ALL[random.below(WaitMode::ALL.len() as u64) as usize];
            let path = ground.path();
            Actor::new(|| {
                let me = Participant::join(&Node::open(path).unwrap(), rohrpost_mailbox::Name::NONE).unwrap();
                if seat < SENDERS {
                    let senders = vec![me.sender(MAILBOXES[0]).unwrap()];
                    return Talker::new(board, seat, seat as u32, full, senders, Weather::Calm).talk();
                }
                let mut listener = Listener::new(board, &me, &[shape], way);
                board.seat(seat).set_ready();
                while !board.is_ended() {
                    board.seat(seat).operate(|| listener.once());
                }
                listener.drain();
            })
        })
        .collect();
    until("all are ready", || (0..=SENDERS).all(|seat| board.seat(seat).is_ready()));
    for round in 0..STOPS {
        std::thread::sleep(Duration::from_micros(random.below(500)));
        // One to all but one; the receiver among them every third time.
        let mut stopped: Vec<usize> = (0..SENDERS).filter(|_| random.one_in(2)).take(SENDERS - 1).collect();
        if round % 3 == 0 {
            stopped.push(RECEIVER);
        }
        stopped.iter().for_each(|seat| actors[*seat].stop());
        let others: Vec<usize> = (0..=SENDERS).filter(|seat| !stopped.contains(seat)).collect();
        let before = others.iter().map(|seat| board.seat(*seat).operations()).collect::<Vec<_>>();
        until("the others go on", || {
            actors.iter().for_each(|actor| actor.assert_alive());
            others.iter().zip(&before).all(|(seat, before)| board.seat(*seat).operations() >= before + 20)
        });
        stopped.iter().for_each(|seat| actors[*seat].go_on());
    }
    board.end();
    // A process that still sends, or sleeps, sees that it is the end when somebody rings.
    for (seat, actor) in actors.into_iter().enumerate() {
        if seat == RECEIVER {
            ground.node().announce_death();
        }
        actor.finish();
    }
    let mut listener = Listener::new(board, &ground.join(), &[shape], WaitMode::Polling);
    listener.drain();
    let (info, tally) = (ground.look(), board.tally(0));
    let accepted: u64 = tally.accepted.iter().sum();
    assert_eq!((info.sent, tally.received + missing(&info)), (accepted, accepted), "{info:#?}");
    assert_eq!((received(&info), common::lost(&info, Loss::Refused)), (tally.received, tally.refused.iter().sum()));
    tell(format_args!("{STOPS} stops: {accepted} accepted, {} received", tally.received));
}

/// What a process does while it is led through it, instruction by instruction.
struct Operation {
    name: &'static str,
    full: OverflowPolicy,
    /// Others' packages that wait, all of priority [`LOW`]; there are four slots.
    filled: u16,
    does: Does,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Does {
    Send(Priority),
    Loan(Priority),
    /// Sends a newer package of a state.
    Renew(Priority),
    Receive,
}

const SLOTS: u16 = 4;
/// How it ended.
const DONE: u32 = 1;
const REFUSED: u32 = 2;
const OPERATIONS: &[Operation] = &[
    Operation { name: "send", full: OverflowPolicy::Reject, filled: 2, does: Does::Send(LOW) },
    Operation { name: "send a loan", full: OverflowPolicy::Latest, filled: 2, does: Does::Loan(HIGH) },
    Operation { name: "send and displace", full: OverflowPolicy::Displace, filled: 4, does: Does::Send(HIGH) },
    Operation { name: "send and be refused", full: OverflowPolicy::Displace, filled: 4, does: Does::Send(LOW) },
    Operation { name: "send and replace", full: OverflowPolicy::Latest, filled: 2, does: Does::Renew(Priority(1)) },
    Operation {
        name: "send into one's own slot",
        full: OverflowPolicy::Latest,
        filled: 3,
        does: Does::Renew(Priority(1)),
    },
    Operation { name: "receive", full: OverflowPolicy::Displace, filled: 4, does: Does::Receive },
];

/// In the process that is led: stops itself, does it, and says so.
fn led(operation: &Operation, ground: &Ground, done: &AtomicU32) {
    // Full: it may look at each slot just while that one is in use, since the others act between any two of its
    // instructions.
    let told = |sent| match sent {
        Ok(()) => DONE,
        Err(SendError::Full(_)) => REFUSED,
        Err(error) => panic!("{error}"),
    };
    let send = |sender: &mut Sender, priority| told(sender.send(&label(priority, 1), &[b"step", b" by step"]));
    let me = ground.join();
    match operation.does {
        Does::Receive => {
            let mut receiver = me.receiver(MAILBOX, operation.shape()).unwrap();
            be_led();
            drop(receiver.try_receive());
            done.store(DONE, SeqCst);
        }
        Does::Send(priority) | Does::Loan(priority) | Does::Renew(priority) => {
            let mut sender = me.sender(MAILBOX).unwrap();
            if matches!(operation.does, Does::Renew(_)) {
                send(&mut sender, priority);
            }
            be_led();
            let how = if matches!(operation.does, Does::Loan(_)) {
                told(sender.loan(priority).and_then(|mut loan| {
                    loan.body()[..12].fill(1);
                    loan.send(&label(priority, 1), 12)
                }))
            } else {
                send(&mut sender, priority)
            };
            done.store(how, SeqCst);
        }
    }
}

/// What the others do: the master.
struct Others {
    sender: Sender,
    /// None while the one that is led receives.
    receiver: Option<Receiver>,
    sent: u16,
    received: u64,
}

impl Others {
    fn new(ground: &Ground, operation: &Operation) -> Self {
        let receives = operation.does == Does::Receive;
        let receiver = (!receives).then(|| ground.join().receiver(MAILBOX, operation.shape()).unwrap());
        let mut others = Self { sender: ground.sender(), receiver, sent: 0, received: 0 };
        (0..operation.filled).for_each(|_| others.send().unwrap());
        others
    }

    /// Each is a command of its own.
    fn send(&mut self) -> Result<(), SendError> {
        let sent = self.sender.send(&label(LOW, 100 + self.sent), &[b"another"]);
        self.sent += u16::from(sent.is_ok());
        sent
    }

    fn receive(&mut self) -> bool {
        let there = self.receiver.as_mut().is_some_and(|receiver| receiver.try_receive().is_some());
        self.received += u64::from(there);
        there
    }

    /// While another is stopped somewhere: takes a package and sends one, at once.
    fn go_on(&mut self, what: &str) {
        if self.receiver.is_some() {
            assert!(self.receive(), "{what}: packages wait, and none is received");
            self.send().unwrap_or_else(|error| panic!("{what}: {error}, though a slot was freed just now"));
        } else if let Err(error) = self.send() {
            assert!(matches!(error, SendError::Full(_)), "{what}: {error}");
        }
    }
}

impl Operation {
    fn shape(&self) -> Shape {
        Shape { full: self.full, ..shape(SLOTS) }
    }

    /// Stops it after each instruction, so that others go on; then kills it after some.
    fn prove(&self, ground: &Ground) {
        let (stops, adversely) = self.lead(ground, u64::MAX, Others::go_on);
        let (instructions, ended) = self.lead(ground, u64::MAX, |_, _| ());
        let expected = if self.name == "send and be refused" { REFUSED } else { DONE };
        assert_eq!((ended, instructions > 200), (expected, true), "{}: {instructions} instructions", self.name);
        let kills = instruction_kills().min(instructions);
        for kill in 0..kills {
            self.lead(ground, 1 + kill * instructions / kills, |_, _| ());
            if kill % 200 == 199 {
                tell(format_args!("{}: {kill} of {kills}", self.name));
            }
        }
        tell(format_args!(
            "{}: stopped after each of {stops} instructions (refused: {}), killed after {kills} of {instructions}",
            self.name,
            adversely == REFUSED
        ));
    }

    /// Leads a process through it, for so many instructions at most, then kills it. Returns how many there were, and
    /// how it ended.
    fn lead(&self, ground: &Ground, most: u64, mut meanwhile: impl FnMut(&mut Others, &str)) -> (u64, u32) {
        drop(ground.join().receiver(MAILBOX, self.shape()).unwrap());
        let done = shared();
        let actor = Actor::new(|| led(self, ground, done));
        actor.stopped();
        let mut others = Others::new(ground, self);
        let mut instructions = 0;
        while done.load(SeqCst) == 0 && instructions < most {
            actor.step(self.name);
            instructions += 1;
            meanwhile(&mut others, self.name);
        }
        // Stopped in its midst, whatever it holds there.
        if done.load(SeqCst) == 0 {
            others.go_on(self.name);
        }
        actor.kill();
        ground.node().announce_death();
        self.check(ground, others);
        (instructions, done.load(SeqCst))
    }

    /// All that others sent was received or counted as lost, at most one too many; and all slots come into use again.
    fn check(&self, ground: &Ground, mut others: Others) {
        let receives = others.receiver.is_none();
        if receives {
            others.receiver = Some(ground.join().receiver(MAILBOX, self.shape()).unwrap());
        }
        while others.receive() {}
        let info = ground.look();
        let (found, accepted) = (others.received + missing(&info), u64::from(others.sent));
        let before = u64::from(matches!(self.does, Does::Renew(_)));
        // It may have received one, or sent one.
        let range = if receives { accepted - 1..=accepted } else { accepted + before..=accepted + before + 1 };
        assert!(range.contains(&found), "{}: {found} of {accepted}: {info:#?}", self.name);
        assert!(info.sent.abs_diff(common::accounted(&info)) <= 1, "{}: {info:#?}", self.name);
        assert_eq!((0..=SLOTS).take_while(|_| others.send().is_ok()).count(), SLOTS.into(), "{}: slots", self.name);
        others.receiver.take().unwrap().close();
    }
}
