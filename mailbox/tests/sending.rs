//! Loans, claims, limits, and moving on when a mailbox is replaced.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, HIGH, LOW, MAILBOX, OTHER, PATIENCE, accounted, label, lost, received, shape, stay, tell};
use rohrpost_mailbox::{Loss, OverflowPolicy, SendError, Shape};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    assert_eq!(role, "hold a loan");
    let mut sender = ground.sender();
    let _loan = sender.loan(LOW).unwrap();
    tell("holding");
    stay();
}

#[test]
fn a_participant_has_no_more_senders_than_claims() {
    for claims in 1..4 {
        let ground = Ground::new();
        let receiver = ground.join().receiver(MAILBOX, Shape { claims, ..shape(8) }).unwrap();
        let participant = ground.join();
        let _elsewhere = ground.join().receiver(OTHER, shape(8)).unwrap();
        let mut senders: Vec<_> = (0..claims).map(|_| participant.sender(MAILBOX).unwrap()).collect();
        assert!(matches!(participant.sender(MAILBOX), Err(SendError::InUse(MAILBOX))));
        assert!(participant.sender(OTHER).is_ok(), "each mailbox counts its own");
        assert!(ground.join().sender(MAILBOX).is_ok(), "and each participant");
        senders.pop();
        assert!(participant.sender(MAILBOX).is_ok(), "a dropped one gives its place back");
        drop(receiver);
    }
}

#[test]
fn a_stopped_filler_does_not_close_a_mailbox() {
    let (ground, _me, mut receiver) = Ground::owned(shape(2));
    let filler = ground.start("hold a loan");
    assert_eq!(filler.hear(), "holding");
    filler.signal(libc::SIGSTOP);
    let mut sender = ground.sender();
    for id in 0..1000 {
        sender.send(&label(LOW, id), &[b"through the other slot"]).unwrap();
        assert_eq!(receiver.receive_timeout(PATIENCE).unwrap().head().id, id);
    }
    // A more important package does not take the place of one that is not yet there.
    sender.send(&label(LOW, 1), &[]).unwrap();
    sender.send(&label(HIGH, 2), &[]).unwrap();
    assert!(matches!(sender.send(&label(HIGH, 3), &[]), Err(SendError::Full(_))));
    ground.node().announce_death();
    assert_eq!(receiver.try_receive().unwrap().head().id, 2, "the stopped one lives: its slot stays its own");
    assert_eq!((lost(&ground.look(), Loss::Unfinished), lost(&ground.look(), Loss::Displaced)), (0, 1));
}

#[test]
fn a_loan_dropped_unsent_is_as_if_never_lent() {
    let (ground, mut receiver, mut sender) = Ground::ends(shape(1));
    for _ in 0..100 {
        sender.loan(LOW).unwrap().body().fill(7);
    }
    assert!(receiver.try_receive().is_none());
    assert_eq!(ground.look().sent, 0);
    let mut loan = sender.loan(HIGH).unwrap();
    loan.body()[..3].copy_from_slice(b"yes");
    loan.send(&label(LOW, 1), 3).unwrap();
    let package = receiver.try_receive().unwrap();
    assert_eq!((package.body(), package.head().priority), (&b"yes"[..], HIGH), "the priority it was lent for");
}

#[test]
fn what_is_too_large_is_refused_and_pushes_nobody_out() {
    let (_ground, mut receiver, mut sender) = Ground::ends(shape(1));
    sender.send(&label(LOW, 1), &[&[1; 256]]).unwrap();
    let error = sender.send(&label(HIGH, 2), &[&[2; 200], &[2; 57]]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "mailbox 1.200.1.0 takes bodies of at most 256 bytes, this one has 257; raise its `size` in the configuration"
    );
    assert_eq!(receiver.try_receive().unwrap().head().id, 1);
    let loan = sender.loan(LOW).unwrap();
    assert!(matches!(loan.send(&label(LOW, 3), 257), Err(SendError::TooLarge { len: 257, max: 256, .. })));
    assert!(receiver.try_receive().is_none());
    sender.send(&label(LOW, 4), &[]).unwrap();
    assert_eq!(receiver.try_receive().unwrap().body(), b"");
}

#[test]
fn a_sender_moves_on_when_its_mailbox_is_replaced() {
    let ground = Ground::new();
    let owner = ground.join();
    let mut sender = {
        let _receiver = owner.receiver(MAILBOX, shape(2)).unwrap();
        ground.sender()
    };
    sender.send(&label(LOW, 1), &[b"lost with the old mailbox, and counted"]).unwrap();
    let larger = Shape { body_bytes_max: 1000, full: OverflowPolicy::Reject, ..shape(4) };
    let mut loan = sender.loan(LOW).unwrap();
    loan.body()[..4].copy_from_slice(b"loan");
    let receiver = owner.receiver(MAILBOX, larger).unwrap();
    loan.send(&label(LOW, 2), 4).unwrap();
    drop(receiver);

    // Larger than the mailbox that it knows.
    let mut receiver = owner.receiver(MAILBOX, Shape { body_bytes_max: 2000, ..larger }).unwrap();
    sender.send(&label(LOW, 3), &[&[3; 2000]]).unwrap();
    assert_eq!(receiver.try_receive().unwrap().body(), [3; 2000]);
    assert!(receiver.try_receive().is_none());
    let info = ground.look();
    assert_eq!((info.sent, received(&info), lost(&info, Loss::Closed)), (3, 1, 2));
    assert_eq!(accounted(&info), 3);

    // Smaller: a loan may find that it is too large now.
    let mut loan = sender.loan(LOW).unwrap();
    loan.body().fill(9);
    drop(receiver);
    let mut receiver = owner.receiver(MAILBOX, shape(2)).unwrap();
    assert!(matches!(loan.send(&label(LOW, 4), 300), Err(SendError::TooLarge { max: 256, .. })));
    assert!(receiver.try_receive().is_none());
    assert_eq!(accounted(&ground.look()), ground.look().sent);
}

#[test]
fn sending_to_nobody_says_so() {
    let (ground, participant) = Ground::joined();
    assert!(matches!(participant.sender(MAILBOX), Err(SendError::NoMailbox(MAILBOX))));
    let mut receiver = participant.receiver(MAILBOX, shape(4)).unwrap();
    let mut sender = ground.sender();
    sender.send(&label(LOW, 1), &[]).unwrap();
    sender.send(&label(LOW, 2), &[]).unwrap();
    drop(receiver.try_receive());
    assert_eq!(receiver.close(), 1, "what it still held");
    for _ in 0..3 {
        assert!(matches!(sender.send(&label(LOW, 3), &[]), Err(SendError::NoMailbox(MAILBOX))));
        assert!(matches!(sender.loan(LOW).map(drop), Err(SendError::NoMailbox(MAILBOX))));
    }
    let mut again = participant.receiver(MAILBOX, shape(4)).unwrap();
    sender.send(&label(LOW, 4), &[]).unwrap();
    assert_eq!(again.try_receive().unwrap().head().id, 4, "the same sender finds the new one");
}

#[test]
fn what_is_accepted_while_a_mailbox_closes_is_counted() {
    let ground = Ground::new();
    let owner = ground.join();
    for _ in 0..50 {
        let mut receiver = owner.receiver(MAILBOX, shape(64)).unwrap();
        let mut sender = ground.sender();
        let thread = std::thread::spawn(move || {
            let mut accepted = 0;
            loop {
                match sender.send(&label(LOW, 1), &[]) {
                    Ok(()) => accepted += 1,
                    Err(SendError::Full(_)) => std::thread::yield_now(),
                    Err(SendError::NoMailbox(_)) => return accepted,
                    Err(error) => panic!("{error}"),
                }
            }
        });
        let mut received = 0;
        while received < 100 {
            received += usize::from(receiver.receive_timeout(PATIENCE).is_some());
        }
        let lost = receiver.close();
        assert_eq!(thread.join().unwrap(), received + lost);
    }
}

#[test]
fn no_loss_is_hidden_while_a_mailbox_is_replaced_again_and_again() {
    let ground = Ground::new();
    let owner = ground.join();
    let mut receiver = owner.receiver(MAILBOX, shape(3)).unwrap();
    let go_on = Arc::new(AtomicBool::new(true));
    let senders: Vec<_> = [LOW, HIGH, LOW]
        .map(|priority| {
            let (mut sender, go_on) = (ground.sender(), go_on.clone());
            std::thread::spawn(move || {
                let mut accepted = 0;
                while go_on.load(Ordering::Relaxed) {
                    match sender.send(&label(priority, 1), &[&[1; 100]]) {
                        Ok(()) => accepted += 1,
                        Err(SendError::Full(_)) => std::thread::yield_now(),
                        // Just between the old mailbox and the new one.
                        Err(SendError::NoMailbox(_)) => {}
                        Err(error) => panic!("{error}"),
                    }
                }
                accepted
            })
        })
        .into();
    let mut count = 0;
    for turn in 0..300 {
        for _ in 0..turn % 7 {
            count += u64::from(receiver.receive_timeout(PATIENCE).is_some());
        }
        drop(receiver);
        receiver = owner.receiver(MAILBOX, shape(3 + turn % 2)).unwrap();
    }
    go_on.store(false, Ordering::Relaxed);
    let accepted: u64 = senders.into_iter().map(|sender| sender.join().unwrap()).sum();
    count += std::iter::from_fn(|| receiver.try_receive().map(drop)).count() as u64;
    let info = ground.look();
    assert_eq!((received(&info), info.depth), (count, 0));
    assert_eq!(info.sent, accounted(&info), "a new mailbox begins with accounts that are even");
    // A sender that had counted what it displaced, and not yet published, when the old mailbox was given up: once too
    // often.
    let too_many = info.sent.checked_sub(accepted).expect("a loss is hidden");
    assert!(too_many <= 30, "{too_many} of {accepted}");
}
