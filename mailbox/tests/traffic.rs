//! What is sent can be read, without asking, and adds up with what is received.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, HIGH, LOW, MAILBOX, OTHER, accounted, label, lost, received, shape, stay, tell, until};
use rohrpost_mailbox::{FlowInfo, Label, Loss, Name, Node, Participant, Publications, Type};
use std::sync::Arc;
use std::time::Duration;

const ME: Name = Name::new(1, 30, 0, 0);

/// This test binary in one of its roles.
#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    assert_eq!(role, "send one, then stay");
    let me = Participant::join(&ground.node(), ME).unwrap();
    me.sender(MAILBOX).unwrap().send(&label(LOW, 0), &[b"one"]).unwrap();
    tell("sent");
    stay();
}

fn flows_to(node: &Arc<Node>, to: Name) -> Vec<FlowInfo> {
    node.traffic().into_iter().filter(|flow| flow.to == to).collect()
}

fn one(flows: Vec<FlowInfo>) -> FlowInfo {
    assert_eq!(flows.len(), 1, "{flows:?}");
    flows.into_iter().next().unwrap()
}

#[test]
fn sent_is_received_and_lost_and_waiting() {
    let (ground, node) = Ground::made();
    let receiver = ground.join().receiver(MAILBOX, shape(16)).unwrap();
    let stop = std::sync::atomic::AtomicBool::new(false);
    let participants: Vec<_> = (0..3).map(|_| ground.join()).collect();
    std::thread::scope(|scope| {
        let take = |mut receiver: rohrpost_mailbox::Receiver| {
            // Leaves some, so that the mailbox is full now and then.
            let mut taken = 0;
            while !stop.load(std::sync::atomic::Ordering::Relaxed) {
                taken += u64::from(receiver.receive_timeout(Duration::from_millis(1)).is_some());
                if taken % 64 == 0 {
                    std::thread::yield_now();
                }
            }
            receiver
        };
        let taker = scope.spawn(move || take(receiver));
        let senders: Vec<_> = participants
            .iter()
            .enumerate()
            .map(|(i, participant)| {
                scope.spawn(move || {
                    let mut sender = participant.sender(MAILBOX).unwrap();
                    let (mut accepted, mut refused) = (0u64, 0u64);
                    for n in 0..20_000u32 {
                        let priority = if n % 7 == 0 { HIGH } else { LOW };
                        let kind = Type::command(1 + (n % 9) as u16);
                        let label = Label { kind, from: Name::new(1, 30, i as u8, 1), ..label(priority, 0) };
                        match sender.send(&label, &[&n.to_le_bytes()]) {
                            Ok(()) => accepted += 1,
                            Err(_) => refused += 1,
                        }
                    }
                    (accepted, refused)
                })
            })
            .collect();
        let told: Vec<(u64, u64)> = senders.into_iter().map(|sender| sender.join().unwrap()).collect();
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
        let _receiver = taker.join().unwrap();
        let flows = flows_to(&node, MAILBOX);
        assert_eq!(flows.len(), 3 * 9);
        for (i, (accepted, refused)) in told.iter().enumerate() {
            let its = || flows.iter().filter(|flow| flow.from == Name::new(1, 30, i as u8, 1));
            assert_eq!(its().map(|flow| flow.packages).sum::<u64>(), *accepted);
            assert_eq!(its().map(|flow| flow.refused).sum::<u64>(), *refused);
            assert!(its().all(|flow| flow.bytes == 4 * flow.packages && flow.first_ns <= flow.last_ns));
        }
        let info = ground.look();
        assert_eq!(flows.iter().map(|flow| flow.packages).sum::<u64>(), accounted(&info));
        assert_eq!(flows.iter().map(|flow| flow.refused).sum::<u64>(), lost(&info, Loss::Refused));
        assert_eq!(info.classes.iter().map(|class| class.body_bytes).sum::<u64>(), 4 * received(&info));
    });
}

#[test]
fn times_tell_the_rate_exactly() {
    let (ground, node) = Ground::made();
    let mut receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    let mut sender = ground.sender();
    let mut times = Vec::new();
    let mut seen = None;
    for n in 0..50u16 {
        sender.send(&label(LOW, n), &[&[0; 64][..usize::from(n)]]).unwrap();
        times.push(receiver.receive().published_ns());
        if n == 9 {
            seen = Some(one(flows_to(&node, MAILBOX)));
        }
    }
    let flow = one(flows_to(&node, MAILBOX));
    assert_eq!((flow.first_ns, flow.last_ns, flow.packages), (times[0], times[49], 50));
    assert_eq!(flow.rate_since(None), Some(49.0 * 1e9 / (times[49] - times[0]) as f64));
    assert_eq!(flow.rate_since(seen.as_ref()), Some(40.0 * 1e9 / (times[49] - times[9]) as f64));
    assert_eq!(flow.rate_since(Some(&flow)), None, "nothing came since");
    let intervals: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!(flow.interval_squares_ns2, intervals.iter().map(|ns| u128::from(*ns).pow(2)).sum::<u128>());
    for second in &flow.seconds {
        let here = |i: &usize| times[*i] / 1_000_000_000 == second.second;
        let bytes = || (0..50).filter(here);
        assert_eq!(second.bytes, (bytes().min().unwrap() as u32, bytes().max().unwrap() as u32));
        let intervals = || (1..50).filter(here).map(|i| intervals[i - 1]);
        assert_eq!(second.interval_ns, intervals().min().zip(intervals().max()));
    }
    assert!(!flow.seconds.is_empty());
}

#[test]
fn what_finds_no_row_is_counted_in_the_last_and_rows_are_used_again() {
    let (ground, node) = Ground::made();
    let me = ground.join();
    let _receiver = ground.join().receiver(MAILBOX, shape(1)).unwrap();
    let _other = ground.join().receiver(OTHER, shape(1)).unwrap();
    let mut sender = me.sender(MAILBOX).unwrap();
    for number in 1..=200 {
        let label = Label { kind: Type::command(number), ..label(LOW, 0) };
        // The first is accepted, all others are refused.
        let _ = sender.send(&label, &[b"x"]);
        let _ = sender.send(&label, &[b"x"]);
    }
    let flows = node.traffic();
    assert_eq!(flows.len(), 128);
    assert_eq!(flows.iter().map(|flow| flow.packages + flow.refused).sum::<u64>(), 400);
    let rest = flows.iter().find(|flow| flow.kind == Type(0)).unwrap();
    assert_eq!((rest.to, rest.packages, rest.refused, rest.last_ns), (Name::NONE, 0, 2 * (200 - 127), 0));
    assert!(!rest.is_publication());

    // The same sender once more finds its rows; another's goes where the longest unused was.
    drop(sender);
    let mut sender = me.sender(MAILBOX).unwrap();
    let _ = sender.send(&Label { kind: Type::command(5), ..label(LOW, 0) }, &[b"x"]);
    let mut other = me.sender(OTHER).unwrap();
    other.send(&label(LOW, 0), &[b"xyz"]).unwrap();
    let fifth = node.traffic().into_iter().find(|flow| flow.kind == Type::command(5)).unwrap();
    assert_eq!(fifth.refused, 3);
    assert_eq!(one(flows_to(&node, OTHER)).bytes, 3);
    let flows = node.traffic();
    assert_eq!(flows.iter().map(|flow| flow.packages + flow.refused).sum::<u64>(), 402, "nothing is forgotten");
}

#[test]
fn two_senders_of_one_participant_do_not_share_a_row() {
    let (ground, node) = Ground::made();
    let shape = rohrpost_mailbox::Shape { claims: 2, ..shape(8) };
    let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
    let me = ground.join();
    let senders = [me.sender(MAILBOX).unwrap(), me.sender(MAILBOX).unwrap()];
    std::thread::scope(|scope| {
        for mut sender in senders {
            scope.spawn(move || {
                let mut accepted = 0;
                while accepted < 5000 {
                    accepted += u32::from(sender.send(&label(LOW, 0), &[b"both"]).is_ok());
                }
            });
        }
        for _ in 0..10_000 {
            receiver.receive();
        }
    });
    let flow = one(flows_to(&node, MAILBOX));
    assert_eq!((flow.packages, flow.bytes), (10_000, 40_000));
}

#[test]
fn a_flow_that_lost_its_row_and_comes_back_is_another() {
    let (ground, node) = Ground::made();
    let me = ground.join();
    let mut receiver = ground.join().receiver(MAILBOX, shape(1)).unwrap();
    let mut send = |numbers: std::ops::Range<u16>| {
        let mut sender = me.sender(MAILBOX).unwrap();
        for number in numbers {
            sender.send(&Label { kind: Type::command(number), ..label(LOW, 0) }, &[b"x"]).unwrap();
            receiver.receive();
        }
    };
    let first = || one(node.traffic().into_iter().filter(|flow| flow.kind == Type::command(1)).collect());
    let sum = || node.traffic().iter().map(|flow| flow.packages).sum::<u64>();
    (0..3).for_each(|_| send(1..2));
    let seen = first();
    send(1..2);
    assert!(
        first().is_same(&seen) && first().rate_since(Some(&seen)) < first().rate_since(None).map(|rate| rate * 1e9)
    );
    // All rows go to others.
    send(2..129);
    assert_eq!(sum(), 4 + 127);
    (0..5).for_each(|_| send(1..2));
    assert_eq!(sum(), 4 + 127 + 5, "nothing is forgotten");
    assert_eq!(first().packages, 5);
    assert!(!first().is_same(&seen));
    assert_eq!(
        first().rate_since(Some(&seen)),
        first().rate_since(None),
        "counts of another incarnation are not subtracted"
    );
}

#[test]
fn a_slot_not_lent_is_counted_where_it_was_asked_for() {
    let (ground, node) = Ground::made();
    let _receiver = ground.join().receiver(MAILBOX, shape(1)).unwrap();
    let mut sender = ground.sender();
    sender.send(&label(LOW, 0), &[]).unwrap();
    assert!(sender.loan(LOW).is_err());
    assert_eq!(one(node.traffic()).refused, 0, "no flow of a type that nobody sends");
    assert_eq!(lost(&ground.look(), Loss::Refused), 1);
}

/// Documented in docs/src/shared-memory.md.
const ROWS: usize = 64;
const ROW: usize = 256;

#[test]
fn a_damaged_table_takes_neither_time_nor_the_reader_down() {
    let (ground, node) = Ground::made();
    let _participants = [ground.join(), ground.join()];
    for participant in ["traffic.0", "traffic.1"] {
        let path = ground.path().join(participant);
        let mut table = std::fs::read(&path).unwrap();
        for row in table[ROWS..].chunks_mut(ROW) {
            // All of one flow, as often as can be, and being changed for ever.
            row[24..].fill(0xff);
            row[4..8].copy_from_slice(&1u32.to_ne_bytes());
        }
        std::fs::write(&path, table).unwrap();
    }
    let most = |flow: &FlowInfo| (flow.packages, flow.bytes, flow.refused, flow.interval_squares_ns2);
    assert!(node.traffic().iter().all(|flow| most(flow) == (u64::MAX, u64::MAX, u64::MAX, u128::MAX)));
    assert_eq!(node.traffic().len(), 2);
    // Patience for each of the rows would be no less than this.
    until("a look is short", || {
        let began = std::time::Instant::now();
        node.traffic();
        began.elapsed() < 2 * 128 * 24 * Duration::from_micros(100)
    });
}

#[test]
fn values_that_find_no_row_do_not_count_as_packages() {
    let (_ground, node) = Ground::made();
    let me = Participant::join(&node, ME).unwrap();
    for kinds in [1..128, 128..140] {
        let mut publications = Publications::new(&me);
        for kind in kinds.clone() {
            publications.published(ME, Type::data(kind), 8, Duration::from_nanos(1));
        }
        let mut late = Publications::new(&me);
        late.published(ME, Type::data(200), 8, Duration::from_nanos(1));
        let flows = node.traffic();
        assert!(flows.len() >= 127 && flows.iter().all(FlowInfo::is_publication), "{kinds:?}");
    }
}

#[test]
fn values_published_are_told_from_packages() {
    let (_ground, node) = Ground::made();
    let me = Participant::join(&node, ME).unwrap();
    let mut publications = Publications::new(&me);
    for age_ns in [10, 30] {
        publications.published(ME, Type::data(1), 8, Duration::from_nanos(age_ns));
    }
    let flow = one(node.traffic());
    assert!(flow.is_publication());
    assert_eq!((flow.module, flow.pid, flow.incarnation), (ME, std::process::id(), me.incarnation()));
    assert_eq!((flow.from, flow.kind, flow.packages, flow.bytes, flow.age_sum_ns), (ME, Type::data(1), 2, 16, 40));
}

#[test]
fn a_dead_ones_traffic_is_not_shown_and_its_successor_begins_anew() {
    let (ground, node) = Ground::made();
    let _receiver = ground.join().receiver(MAILBOX, shape(8)).unwrap();
    let child = ground.start("send one, then stay");
    child.hear();
    assert_eq!(one(node.traffic()).packages, 1);
    let left = ground.path().join("traffic.1");
    assert!(left.exists());
    child.kill();
    until("its lock is gone", || node.traffic().is_empty());
    assert!(left.exists(), "until the next comes");
    // A damaged file is nobody's traffic, and nobody's trouble.
    for damage in [&b""[..], b"rohrpost", &[0xff; 40_000]] {
        std::fs::write(&left, damage).unwrap();
        assert!(node.traffic().is_empty());
    }
    let me = Participant::join(&node, ME).unwrap();
    assert!(node.traffic().is_empty());
    me.sender(MAILBOX).unwrap().send(&label(LOW, 0), &[b"two"]).unwrap();
    assert_eq!(one(node.traffic()).packages, 1);
    drop(me);
    assert!(!left.exists());
    assert!(!ground.path().join("traffic.1.new").exists());
}
