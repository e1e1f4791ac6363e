//! Mailboxes of policy `latest`: of each state only the newest waits.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, HIGH, LOW, MAILBOX, Process, accounted, label, lost, received, shape, tell};
use rohrpost_mailbox::{Label, Loss, Name, OverflowPolicy, Package, Receiver, SendError, Shape, Type};
use std::collections::HashMap;
use std::time::{Duration, Instant};

const STATES: u16 = 3;

fn latest(slots: u16) -> Shape {
    Shape { full: OverflowPolicy::Latest, ..shape(slots) }
}

/// Which sender, which state, and the how manieth of it.
fn body(package: &Package<'_>) -> ((u32, u16), u32) {
    let number = |at: usize| u32::from_le_bytes(package.body()[at..at + 4].try_into().unwrap());
    ((number(0), package.head().id), number(4))
}

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    assert_eq!(role, "send states");
    let me = ground.join();
    let mut sender = me.sender(MAILBOX).unwrap();
    let mut numbers = [0u32; STATES as usize];
    let end = Instant::now() + Duration::from_secs(2);
    for state in (0..STATES).cycle() {
        let number = numbers[usize::from(state)] + 1;
        match sender.send(&label(LOW, state), &[&me.incarnation().to_le_bytes(), &number.to_le_bytes()]) {
            Ok(()) => numbers[usize::from(state)] = number,
            // Only when the search for a free slot meets all the others on their ways.
            Err(SendError::Full(_)) => std::thread::yield_now(),
            Err(error) => panic!("{error}"),
        }
        if state == 0 && Instant::now() >= end {
            break;
        }
    }
    let numbers = numbers.map(|number| number.to_string()).join(" ");
    tell(format_args!("{} {numbers}", me.incarnation()));
    // Its place in the table is nobody else's until all have told.
    common::stay();
}

#[test]
fn a_slow_reader_of_fast_writers_gets_the_newest_of_each_and_never_goes_back() {
    let (ground, _me, mut receiver) = Ground::owned(latest(16));
    let senders: Vec<Process> = (0..3).map(|_| ground.start("send states")).collect();
    let mut last: HashMap<(u32, u16), u32> = HashMap::new();
    let mut count = 0;
    let mut take = |receiver: &mut Receiver, wait: Duration| {
        let Some(package) = receiver.receive_timeout(wait) else { return false };
        let (of, number) = body(&package);
        let before = last.insert(of, number);
        assert!(before.is_none_or(|before| before < number), "{before:?} before {number}");
        count += 1;
        true
    };
    let mut told = Vec::new();
    while told.len() < senders.len() {
        if take(&mut receiver, Duration::from_millis(20)) {
            std::thread::sleep(Duration::from_micros(300));
        } else if ground.look().depth == 0 {
            told.push(senders[told.len()].hear());
        }
    }
    while take(&mut receiver, Duration::ZERO) {}
    let mut sent = 0;
    for told in told {
        let mut numbers = told.split(' ').map(|number| number.parse::<u32>().unwrap());
        let sender = numbers.next().unwrap();
        for (state, number) in (0..STATES).zip(numbers) {
            sent += u64::from(number);
            assert_eq!(last.get(&(sender, state)).copied(), Some(number), "the newest was received");
        }
    }
    let info = ground.look();
    assert_eq!(info.sent, sent);
    assert_eq!((received(&info), accounted(&info), info.depth), (count, info.sent, 0));
    assert!(lost(&info, Loss::Replaced) > count, "too slow to prove anything: {info:?}");
    assert_eq!(
        info.classes.iter().map(|class| class.lost_in_all()).sum::<u64>(),
        lost(&info, Loss::Refused),
        "no loss"
    );
}

#[test]
fn the_same_are_those_of_one_sender_type_and_id() {
    let (ground, mut receiver, mut sender) = Ground::ends(latest(16));
    let state = Label { from: Name::new(1, 150, 0, 0), kind: Type::data(1), id: 7, priority: LOW, ..Label::default() };
    let others = [
        Label { from: Name::new(1, 150, 1, 0), ..state },
        Label { kind: Type::data(2), ..state },
        Label { id: 8, ..state },
        // Its importance does not tell it apart: the newest value is the newest.
        Label { priority: HIGH, ..state },
    ];
    for label in [state].iter().chain(&others) {
        sender.send(label, &[]).unwrap();
    }
    let heads: Vec<Label> = std::iter::from_fn(|| {
        let package = receiver.try_receive()?;
        let head = package.head();
        Some(Label { from: head.from, kind: head.kind, id: head.id, priority: head.priority, options: head.options })
    })
    .collect();
    assert_eq!(heads, [others[3], others[0], others[1], others[2]]);
    assert_eq!(lost(&ground.look(), Loss::Replaced), 1);
}

#[test]
fn a_fast_sender_and_a_slow_one_come_in_turn() {
    let (ground, _me, mut receiver) = Ground::owned(latest(8));
    let (mut fast, mut slow) = (ground.sender(), ground.sender());
    let mut id = 0;
    let mut flood = |fast: &mut rohrpost_mailbox::Sender| {
        for _ in 0..100 {
            id += 1;
            fast.send(&label(LOW, 1), &[&[1]]).unwrap();
        }
    };
    for _ in 0..50 {
        flood(&mut fast);
        slow.send(&label(LOW, 1), &[&[2]]).unwrap();
        flood(&mut fast);
        let order = [1, 2].map(|_| receiver.try_receive().unwrap().body()[0]);
        assert_eq!(order, [1, 2], "the sender that came first is received first, however often it sends");
        assert!(receiver.try_receive().is_none());
        slow.send(&label(LOW, 1), &[&[2]]).unwrap();
        flood(&mut fast);
        let order = [1, 2].map(|_| receiver.try_receive().unwrap().body()[0]);
        assert_eq!(order, [2, 1]);
    }
}

#[test]
fn a_restarted_sender_replaces_nothing_and_nothing_comes_back() {
    let (ground, _me, mut receiver) = Ground::owned(latest(8));
    for number in 1..=3u8 {
        let mut sender = ground.sender();
        sender.send(&label(LOW, 1), &[&[0]]).unwrap();
        sender.send(&label(LOW, 1), &[&[number]]).unwrap();
    }
    let all: Vec<u8> = std::iter::from_fn(|| receiver.try_receive().map(|package| package.body()[0])).collect();
    assert_eq!(all, [1, 2, 3]);
}

#[test]
fn one_slot_is_enough_and_a_loan_replaces_too() {
    let (ground, mut receiver, mut sender) = Ground::ends(latest(1));
    (1..=9u8).for_each(|number| sender.send(&label(LOW, 1), &[&[number]]).unwrap());
    assert!(matches!(ground.sender().send(&label(LOW, 1), &[]), Err(SendError::Full(_))), "it has nothing to replace");
    assert!(matches!(sender.loan(LOW), Err(SendError::Full(_))), "nor does it know yet");
    ground.sender().send(&label(HIGH, 1), &[&[20]]).unwrap();
    assert_eq!(receiver.try_receive().unwrap().body(), [20]);
    assert!(receiver.try_receive().is_none());
    drop(receiver);

    let mut receiver = ground.join().receiver(MAILBOX, latest(2)).unwrap();
    sender.send(&label(LOW, 1), &[&[10]]).unwrap();
    let mut loan = sender.loan(LOW).unwrap();
    loan.body()[0] = 11;
    loan.send(&label(LOW, 1), 1).unwrap();
    assert_eq!(receiver.try_receive().unwrap().body(), [11]);
    assert!(receiver.try_receive().is_none());
    let info = ground.look();
    assert_eq!((info.sent, accounted(&info), lost(&info, Loss::Displaced)), (12, 12, 1));
}

#[test]
fn commands_have_an_id_each_and_are_never_replaced() {
    let (ground, mut receiver, mut sender) = Ground::ends(latest(4));
    // More than it remembers, too.
    for id in 0..40 {
        sender.send(&label(LOW, id), &[]).unwrap();
        if id % 4 == 3 {
            assert_eq!([0, 1, 2, 3].map(|_| receiver.try_receive().unwrap().head().id), [id - 3, id - 2, id - 1, id]);
        }
    }
    assert_eq!(lost(&ground.look(), Loss::Replaced), 0);
}
