//! Eight senders, processes and threads, at random for a long time: order, sums of bodies, and accounts that agree
//! exactly.
//!
//! The full run takes ten minutes:
//! `ROHRPOST_SOAK_SECONDS=600 cargo test -p rohrpost-mailbox --test soak -- --nocapture`
//!
//! Nobody is killed here, so nothing is uncertain: of each class, sent = received + counted losses, and refusals that
//! senders were told = refusals counted.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::board::{Board, MAILBOXES, PRIORITIES, Tally};
use common::crew::{Actor, alone, master};
use common::load::{Listener, Talker, WaitMode, Weather};
use common::random::Random;
use common::{Ground, lost, received, shape, tell, until};
use rohrpost_mailbox::{Class, Loss, MailboxInfo, OverflowPolicy, Participant, Priority, Sender, Shape};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const PROCESSES: usize = 4;
const SENDERS: usize = 8;
/// Fewer would prove little.
const TAKEN_MIN: u64 = 1000;
/// Says that it lives so often.
const TELL_EVERY: Duration = Duration::from_secs(10);

fn duration() -> Duration {
    let seconds = std::env::var("ROHRPOST_SOAK_SECONDS");
    Duration::from_secs(seconds.map_or(8, |seconds| seconds.parse().expect("a number of seconds")))
}

/// Around the sizes at which something changes: one slot, fewer than senders, words of hints, distance of slot words.
fn shapes(full: OverflowPolicy) -> Vec<Shape> {
    let of = |slots, body_bytes_max, max_age| Shape { full, body_bytes_max, max_age, claims: 2, ..shape(slots) };
    vec![
        of(1, 256, None),
        of(3, 20_000, None),
        of(64, 1000, None),
        of(65, 256, None),
        of(1024, 256, None),
        // Some wait for longer than that, and are counted as stale.
        of(16, 256, Some(Duration::from_micros(300))),
    ]
}

#[test]
fn role() {
    let Some((_, ground)) = common::role() else { return };
    master(|| {
        let cases: Vec<Shape> = OverflowPolicy::ALL.into_iter().flat_map(shapes).collect();
        let each = duration() / cases.len() as u32;
        let mut random = Random::from_environment();
        let mut stale = 0;
        for shape in cases {
            let way = WaitMode::ALL[random.below(WaitMode::ALL.len() as u64) as usize];
            stale += soak(&ground, shape, way, each);
            assert!(ground.node().remove_orphan(MAILBOXES[0]).unwrap());
        }
        assert!(stale > 0, "too quick to prove anything of what is stale");
    });
    tell("done");
}

#[test]
fn what_is_sent_is_received_in_order_or_counted_to_the_last_package() {
    alone(&Ground::in_memory(), "soak");
}

/// Lets all loose on one mailbox; returns how many packages were stale.
fn soak(ground: &Ground, shape: Shape, way: WaitMode, time: Duration) -> u64 {
    let board = Board::new(SENDERS);
    // Forked processes hold no lock of ours: the mailbox is ours again only after that.
    drop(Listener::new(board, &ground.join(), &[shape], way));
    let processes: Vec<Actor> = (0..PROCESSES)
        .map(|seat| Actor::new(|| talk(board, seat, shape.full, ground.join().sender(MAILBOXES[0]).unwrap())))
        .collect();
    let mut listener = Listener::new(board, &ground.join(), &[shape], way);
    let threads = start_threads(board, ground, shape.full);

    let (began, mut told) = (Instant::now(), Instant::now());
    // However busy the computer is, some are received.
    while began.elapsed() < time || listener.taken < TAKEN_MIN {
        listener.once();
        if told.elapsed() > TELL_EVERY {
            told = Instant::now();
            tell(format_args!("{shape:?}: {:.0?}", began.elapsed()));
        }
    }
    board.hold(true);
    until("all senders hold still", || {
        listener.drain();
        processes.iter().for_each(Actor::assert_alive);
        (0..SENDERS).all(|seat| board.is_still(seat))
    });
    listener.drain();
    let info = ground.look();
    let tally = board.tally(0);
    check(&info, &tally);
    check_traffic(ground, &tally);
    board.end();
    processes.into_iter().for_each(Actor::finish);
    threads.into_iter().for_each(|thread| thread.join().unwrap());
    let all: Vec<String> = Loss::ALL.iter().map(|cause| format!("{} {}", lost(&info, *cause), cause.word())).collect();
    let (name, slots) = (shape.full.name(), shape.slots);
    tell(format_args!(
        "{name}, {slots} slots, {way:?}: {} sent, {} received, {}",
        info.sent,
        tally.received,
        all.join(", ")
    ));
    lost(&info, Loss::Stale)
}

fn talk(board: Board, seat: usize, full: OverflowPolicy, sender: Sender) {
    Talker::new(board, seat, seat as u32, full, vec![sender], Weather::Calm).talk();
}

/// Two by two they are one participant, which may hold two claims.
fn start_threads(board: Board, ground: &Ground, full: OverflowPolicy) -> Vec<JoinHandle<()>> {
    let pairs: Vec<Arc<Participant>> = (PROCESSES..SENDERS).step_by(2).map(|_| ground.join()).collect();
    let all = (PROCESSES..SENDERS).zip(pairs.iter().flat_map(|one| [one, one]));
    all.map(|(seat, participant)| {
        let sender = participant.sender(MAILBOXES[0]).unwrap();
        std::thread::spawn(move || talk(board, seat, full, sender))
    })
    .collect()
}

/// Nothing waits and nobody sends.
fn check(info: &MailboxInfo, tally: &Tally) {
    let accepted: u64 = tally.accepted.iter().sum();
    assert_eq!((info.depth, info.sent, received(info)), (0, accepted, tally.received), "{tally:?}: {info:#?}");
    for (at, Priority(number)) in PRIORITIES.into_iter().enumerate() {
        let class = info.classes.iter().find(|class| class.class == Some(Class(number))).expect("each was used");
        let lost: u64 = Loss::ALL.into_iter().filter(|cause| cause.was_accepted()).map(|cause| class.lost(cause)).sum();
        assert_eq!(class.received + lost, tally.accepted[at], "priority {number}: {class:?}");
        assert_eq!(class.lost(Loss::Refused), tally.refused[at], "priority {number}: {class:?}");
    }
    let cannot_be = [Loss::Poison, Loss::Closed, Loss::Unfinished].map(|cause| lost(info, cause));
    assert_eq!(cannot_be, [0; 3]);
    assert_eq!(
        info.shape.full == OverflowPolicy::Latest,
        lost(info, Loss::Replaced) > 0,
        "only newer states replace: {info:#?}"
    );
    assert!(info.shape.full != OverflowPolicy::Reject || lost(info, Loss::Displaced) == 0);
}

/// What the senders' own tables say is the same. A loan that was asked for and not lent had no type yet; they do not
/// count it.
fn check_traffic(ground: &Ground, tally: &Tally) {
    let flows = ground.node().traffic();
    let here = flows.iter().filter(|flow| flow.to == MAILBOXES[0]);
    let (packages, refused) = here.fold((0, 0), |sum, flow| (sum.0 + flow.packages, sum.1 + flow.refused));
    assert_eq!(packages, tally.accepted.iter().sum());
    assert!(refused <= tally.refused.iter().sum());
}
