//! What comes out, and in which order, against a model of a page.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, MAILBOX, label, lost, received, shape};
use proptest::prelude::*;
use rohrpost_mailbox::{Loss, Options, OverflowPolicy, Priority, Receiver, SendError, Sender};

const SENDERS: usize = 3;

#[derive(Clone, Debug)]
enum Step {
    Send {
        sender: usize,
        priority: u8,
        state: u16,
    },
    DropLoan {
        sender: usize,
        priority: u8,
    },
    Receive,
    Look,
    /// The receiver goes, another adopts.
    Restart,
}

fn step() -> impl Strategy<Value = Step> {
    let sends = (0..SENDERS, 1u8..5);
    prop_oneof![
        6 => (sends.clone(), 0u16..3).prop_map(|((sender, priority), state)| Step::Send { sender, priority, state }),
        1 => sends.prop_map(|(sender, priority)| Step::DropLoan { sender, priority }),
        4 => Just(Step::Receive),
        1 => Just(Step::Look),
        1 => Just(Step::Restart),
    ]
}

struct Waiting {
    priority: u8,
    number: u16,
    /// Its sender, and of what it is the newest.
    of: (usize, u16),
}

/// A mailbox as it is described: a list.
struct Model {
    slots: usize,
    full: OverflowPolicy,
    /// In the order of sending.
    waiting: Vec<Waiting>,
    sent: u64,
    displaced: u64,
    replaced: u64,
    refused: u64,
    received: u64,
}

impl Model {
    /// Makes room for a package of this priority.
    fn claim(&mut self, priority: u8) -> bool {
        if self.waiting.len() < self.slots {
            return true;
        }
        let least = self.waiting.iter().map(|package| package.priority).min().filter(|least| *least < priority);
        let least = least.filter(|_| self.full != OverflowPolicy::Reject);
        match least {
            Some(least) => {
                let newest = self.waiting.iter().rposition(|package| package.priority == least).unwrap();
                self.waiting.remove(newest);
                self.displaced += 1;
            }
            None => self.refused += 1,
        }
        least.is_some()
    }

    fn send(&mut self, package: Waiting) -> bool {
        let same = self.waiting.iter().position(|old| self.full == OverflowPolicy::Latest && old.of == package.of);
        let sent = same.is_some() || self.claim(package.priority);
        match same {
            Some(at) => {
                self.waiting[at] = package;
                self.replaced += 1;
            }
            None if sent => self.waiting.push(package),
            None => {}
        }
        self.sent += u64::from(sent);
        sent
    }

    fn receive(&mut self) -> Option<u16> {
        let most = self.waiting.iter().map(|package| package.priority).max()?;
        let first = self.waiting.iter().position(|package| package.priority == most)?;
        self.received += 1;
        Some(self.waiting.remove(first).number)
    }
}

fn receive(receiver: &mut Receiver) -> Option<u16> {
    let package = receiver.try_receive()?;
    assert!(!package.head().options.has(Options::REDELIVERED));
    Some(u16::from_le_bytes(package.body().try_into().unwrap()))
}

fn send(sender: &mut Sender, priority: u8, id: u16, number: u16) -> bool {
    match sender.send(&label(Priority(priority), id), &[&number.to_le_bytes()]) {
        Ok(()) => true,
        Err(SendError::Full(MAILBOX)) => false,
        Err(error) => panic!("{error}"),
    }
}

fn agree(slots: u16, full: OverflowPolicy, steps: &[Step]) {
    let ground = Ground::new();
    let shape = rohrpost_mailbox::Shape { full, ..shape(slots) };
    let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
    let mut senders: Vec<Sender> = (0..SENDERS).map(|_| ground.sender()).collect();
    let waiting = Vec::new();
    let mut model =
        Model { slots: slots.into(), full, waiting, sent: 0, displaced: 0, replaced: 0, refused: 0, received: 0 };
    for (number, step) in (0u16..).zip(steps) {
        match *step {
            Step::Send { sender, priority, state } => {
                let room = model.send(Waiting { priority, number, of: (sender, state) });
                assert_eq!(send(&mut senders[sender], priority, state, number), room);
            }
            Step::DropLoan { sender, priority } => {
                assert_eq!(senders[sender].loan(Priority(priority)).is_ok(), model.claim(priority));
            }
            Step::Receive => assert_eq!(receive(&mut receiver), model.receive()),
            Step::Look => {
                // What gave way to a loan that was dropped is still counted.
                let (count, first) = receiver.waits();
                let there = model.waiting.iter().map(|package| package.priority).max();
                assert!((model.waiting.len()..=model.slots).contains(&count), "{count}");
                assert!(first.map(|first| first.0) >= there, "{first:?}, {there:?}");
            }
            Step::Restart => {
                drop(receiver);
                receiver = ground.join().receiver(MAILBOX, shape).unwrap();
            }
        }
    }
    let info = ground.look();
    assert_eq!((info.sent, info.depth as usize), (model.sent, model.waiting.len()));
    let found = [Loss::Displaced, Loss::Replaced, Loss::Refused].map(|cause| lost(&info, cause));
    assert_eq!((received(&info), found), (model.received, [model.displaced, model.replaced, model.refused]));
    while let Some(number) = model.receive() {
        assert_eq!(receive(&mut receiver), Some(number));
    }
    assert_eq!(receive(&mut receiver), None);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    #[test]
    fn a_mailbox_is_a_list_by_priority_and_age(
        slots in prop_oneof![1u16..6, 63u16..67],
        full in proptest::sample::select(OverflowPolicy::ALL.to_vec()),
        steps in proptest::collection::vec(step(), 0..300),
    ) {
        agree(slots, full, &steps);
    }
}

#[test]
fn a_full_mailbox_does_what_it_says() {
    for (full, priorities, out) in [
        (OverflowPolicy::Displace, &[1, 1, 2, 3][..], &[3, 2][..]),
        (OverflowPolicy::Displace, &[2, 2, 2], &[2, 2]),
        (OverflowPolicy::Displace, &[3, 2, 1], &[3, 2]),
        (OverflowPolicy::Reject, &[1, 1, 9], &[1, 1]),
        (OverflowPolicy::Latest, &[1, 1, 2, 3], &[3, 2]),
        (OverflowPolicy::Latest, &[2, 2, 2], &[2, 2]),
    ] {
        let ground = Ground::new();
        let mut receiver = ground.join().receiver(MAILBOX, rohrpost_mailbox::Shape { full, ..shape(2) }).unwrap();
        let mut sender = ground.sender();
        for (number, priority) in (0..).zip(priorities) {
            send(&mut sender, *priority, number, number);
        }
        for priority in out {
            assert_eq!(receiver.try_receive().unwrap().head().priority, Priority(*priority), "{full:?} {priorities:?}");
        }
        assert!(receiver.try_receive().is_none());
    }
}
