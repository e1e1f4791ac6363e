//! A class of no importance keeps the mailbox full, or its senders are stopped with slots in hand: what is urgent gets
//! through as its policy says, others go on, and all is accounted for to the last package.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::board::{Board, Mark, PRIORITIES};
use common::crew::{Actor, alone, master};
use common::random::Random;
use common::{Ground, MAILBOX, PATIENCE, accounted, label, lost, received, shape, tell, until};
use rohrpost_mailbox::{
    Class, ClassTraffic, Loss, Options, OverflowPolicy, Package, Priority, SendError, Sender, Shape,
};
use std::time::{Duration, Instant};

/// Runs of the board, seats, and indices of [`PRIORITIES`].
const LOW: usize = 0;
const URGENT: usize = 3;
/// Urgent packages that are offered.
const ROUNDS: u64 = 400;
const HOLDERS: usize = 6;

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    let (what, full) = role.split_once(", ").unwrap();
    let full = OverflowPolicy::ALL.into_iter().find(|one| one.name() == full).unwrap();
    master(|| match what {
        "flood" => flood(&ground, full),
        "holders" => holders(&ground, full),
        other => panic!("no role {other}"),
    });
    tell("done");
}

#[test]
fn what_is_urgent_passes_a_flood_as_the_policy_says() {
    OverflowPolicy::ALL.into_iter().for_each(|full| alone(&Ground::in_memory(), &format!("flood, {}", full.name())));
}

#[test]
fn a_sender_stopped_with_a_loan_closes_no_mailbox() {
    OverflowPolicy::ALL.into_iter().for_each(|full| alone(&Ground::in_memory(), &format!("holders, {}", full.name())));
}

/// Sends one package of this class; with `latest`, of the state that its number has in turn.
fn send(board: Board, sender: &mut Sender, full: OverflowPolicy, class: usize, number: u32) -> bool {
    let state = if full == OverflowPolicy::Latest && class == LOW { number % 4 } else { class as u32 };
    let mark = Mark { run: class as u32, number, mailbox: 0, key: state as u8, class: class as u8 };
    let mut body = [0; 60];
    mark.write(&mut body);
    // Each urgent one is a command of its own, which nothing replaces.
    let id = if class == LOW { state } else { number };
    match sender.send(&label(PRIORITIES[class], id as u16), &[&body]) {
        Ok(()) => board.accepted(&mark),
        Err(SendError::Full(MAILBOX)) => {
            board.refused(&mark);
            return false;
        }
        Err(error) => panic!("{error}"),
    }
    true
}

fn low_sender(board: Board, ground: &Ground, full: OverflowPolicy) {
    let (mut sender, mut number, mut random) = (ground.sender(), 1, Random::new(1));
    board.seat(LOW).set_ready();
    while !board.is_ended() {
        let sent = board.seat(LOW).operate(|| send(board, &mut sender, full, LOW, number));
        number += u32::from(sent);
        // Asleep now and then, as a process that is not real-time.
        if random.one_in(if sent { 200 } else { 20 }) {
            std::thread::sleep(Duration::from_micros(50));
        }
    }
}

/// One each millisecond, when the one before was received: what waits is never more than one. Every second one finds
/// the mailbox full.
fn urgent_sender(board: Board, ground: &Ground, full: OverflowPolicy) {
    let (mut sender, mut number) = (ground.sender(), 1);
    for round in 0..ROUNDS {
        std::thread::sleep(Duration::from_millis(1));
        until("the one before is received", || u64::from(number) == board.received_of(URGENT, 0, URGENT) + 1);
        until("the mailbox is full", || round % 2 == 1 || ground.look().depth == ground.look().shape.slots.into());
        number += u32::from(board.seat(URGENT).operate(|| send(board, &mut sender, full, URGENT, number)));
    }
    until("it ends", || board.is_ended());
}

fn flood(ground: &Ground, full: OverflowPolicy) {
    let board = Board::new(PRIORITIES.len());
    // As many as there are states, so that the newest of all fill it.
    let shape = Shape { full, ..shape(4) };
    drop(ground.join().receiver(MAILBOX, shape).unwrap());
    let low = Actor::new(|| low_sender(board, ground, full));
    until("the mailbox is full", || ground.look().depth == u32::from(shape.slots));
    let urgent = Actor::new(|| urgent_sender(board, ground, full));
    let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
    let (mut urgents, began) = (0, Instant::now());
    while board.seat(URGENT).operations() < ROUNDS {
        assert!(began.elapsed() < PATIENCE, "too slow");
        [&low, &urgent].into_iter().for_each(Actor::assert_alive);
        // Each second urgent one has to meet a full mailbox, the others whatever they meet.
        let none_waits = urgents == board.accepted_of(URGENT, 0);
        if none_waits && board.seat(URGENT).operations().is_multiple_of(2) {
            std::thread::yield_now();
            continue;
        }
        let accepted = board.accepted_of(URGENT, 0);
        let Some(package) = receiver.try_receive() else { continue };
        board.received(&package);
        urgents += u64::from(package.head().priority == PRIORITIES[URGENT]);
        assert!(urgents >= accepted, "one of low priority passed an urgent one that had been accepted");
    }
    board.end();
    [low, urgent].into_iter().for_each(Actor::finish);
    while let Some(package) = receiver.try_receive() {
        board.received(&package);
    }
    check_flood(ground, full, board);
}

fn check_flood(ground: &Ground, full: OverflowPolicy, board: Board) {
    let (info, tally) = (ground.look(), board.tally(0));
    let class = |class: usize| -> ClassTraffic {
        let Priority(number) = PRIORITIES[class];
        info.classes.iter().find(|found| found.class == Some(Class(number))).unwrap().clone()
    };
    let (low, urgent) = (class(LOW), class(URGENT));
    let gone = [Loss::Displaced, Loss::Replaced].map(|cause| low.lost(cause));
    assert_eq!(low.received + gone.iter().sum::<u64>(), tally.accepted[LOW], "{low:?}");
    assert_eq!(urgent.received, tally.accepted[URGENT], "nothing urgent is lost: {urgent:?}");
    assert_eq!([&low, &urgent].map(|row| row.lost(Loss::Refused)), [tally.refused[LOW], tally.refused[URGENT]]);
    assert_eq!((info.sent, accounted(&info), info.depth), (tally.accepted.iter().sum(), info.sent, 0));
    assert_eq!(tally.accepted[URGENT] + tally.refused[URGENT], ROUNDS);
    let [displaced, replaced] = gone;
    match full {
        OverflowPolicy::Displace => {
            assert!(tally.refused[URGENT] == 0 && replaced == 0 && displaced >= ROUNDS / 2 && tally.refused[LOW] > 0)
        }
        // The flood is of a few states, of which only the newest counts; what is urgent displaces one of them.
        OverflowPolicy::Latest => assert!(tally.refused[URGENT] == 0 && replaced > ROUNDS && displaced >= ROUNDS / 2),
        // Here the flood keeps out what is urgent. Its sender is told.
        OverflowPolicy::Reject => {
            assert!(tally.refused[URGENT] >= ROUNDS / 2 && replaced + displaced == 0 && tally.refused[LOW] > 0)
        }
    }
    tell(format_args!("{}: {tally:?}, {displaced} displaced, {replaced} replaced", full.name()));
}

/// Takes a slot, writes half a package, and stops; woken, it goes on. Its seat tells that it has sent.
fn hold(board: Board, ground: &Ground, seat: usize) {
    let mut sender = ground.sender();
    let mark = Mark { run: seat as u32, number: 1, mailbox: 0, key: 0, class: 1 };
    let mut body = [0; 100];
    mark.write(&mut body);
    let mut loan = sender.loan(PRIORITIES[1]).unwrap();
    loan.body()[..50].copy_from_slice(&body[..50]);
    nix::sys::signal::raise(nix::sys::signal::Signal::SIGSTOP).unwrap();
    loan.body()[50..100].copy_from_slice(&body[50..]);
    board.seat(seat).operate(|| loan.send(&label(PRIORITIES[1], 1), 100).unwrap());
    board.accepted(&mark);
    board.seat(seat).set_ready();
    until("it ends", || board.is_ended());
}

fn holders(ground: &Ground, full: OverflowPolicy) {
    let board = Board::new(HOLDERS + 1);
    let shape = Shape { full, ..shape(HOLDERS as u16 + 2) };
    drop(ground.join().receiver(MAILBOX, shape).unwrap());
    let filled = if full == OverflowPolicy::Reject { 0 } else { u64::from(shape.slots) };
    // Then each takes the place of an accepted package, and the others' two slots hold the rest.
    (0..filled).for_each(|id| ground.sender().send(&label(PRIORITIES[0], id as u16), &[]).unwrap());
    let all: Vec<Actor> = (0..HOLDERS).map(|seat| Actor::new(|| hold(board, ground, seat))).collect();
    all.iter().for_each(Actor::stopped);

    let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
    let mut sender = ground.sender();
    for _ in HOLDERS as u64..filled {
        assert_eq!(receiver.try_receive().map(|package| package.body().len()), Some(0));
    }
    for round in 0..500 {
        // All slots but those of the holders, at once.
        for id in 0..2 {
            sender.send(&label(PRIORITIES[0], 2 * round + id), &[b"goes on"]).unwrap();
        }
        assert!(matches!(sender.send(&label(PRIORITIES[0], 9_999), &[]), Err(SendError::Full(_))));
        for id in 0..2 {
            let package = receiver.receive_timeout(PATIENCE).unwrap();
            assert_eq!((package.head().id, package.body()), (2 * round + id, &b"goes on"[..]));
        }
    }
    let displaced = lost(&ground.look(), Loss::Displaced);
    ground.node().announce_death();
    assert!(receiver.try_receive().is_none(), "they live: their slots stay their own");

    // Every second one is killed, the others go on.
    for (seat, actor) in all.into_iter().enumerate() {
        if seat % 2 == 0 {
            actor.kill();
            continue;
        }
        std::thread::sleep(Duration::from_micros(100));
        actor.go_on();
        until("it has sent", || board.seat(seat).is_ready());
        let check = |package: Package<'_>| (board.received(&package), assert_eq!(package.head().options, Options(0))).0;
        receiver.receive_timeout(PATIENCE).map(check).unwrap();
        board.end();
        actor.finish();
    }
    ground.node().announce_death();
    assert!(receiver.try_receive().is_none());
    let info = ground.look();
    assert_eq!(lost(&info, Loss::Unfinished), HOLDERS as u64 / 2);
    // Counted when the killed were found dead, and by the others themselves.
    assert_eq!((displaced, lost(&info, Loss::Displaced)), (0, filled.min(HOLDERS as u64)));
    assert_eq!((info.sent, accounted(&info), info.depth), (received(&info) + filled.min(HOLDERS as u64), info.sent, 0));
    for id in 0..shape.slots {
        sender.send(&label(PRIORITIES[0], id), &[]).unwrap();
    }
    assert_eq!(ground.look().depth, u32::from(shape.slots), "all slots are in use again");
}
