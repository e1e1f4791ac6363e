//! Many processes at once, left alone and then killed at random: order, checksums, accounts.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, MAILBOX, PATIENCE, Process, accounted, label, lost, received, tell};
use rohrpost_mailbox::{Full, Loss, Options, Package, Priority, SendError, Sender, Shape};
use std::collections::HashMap;
use std::time::{Duration, Instant};

const PRIORITIES: [u8; 4] = [10, 20, 30, 40];
const SHAPE: Shape = Shape { slots: 16, body_bytes_max: 256, full: Full::Displace, max_age: None, claims: 1 };

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    let (role, policy) = role.split_once(", ").unwrap_or((&role, "displace"));
    match role {
        "send for a while" => {
            let end = Instant::now() + Duration::from_secs(4);
            let accepted = send_at_random(&ground, || Instant::now() < end);
            tell(accepted);
        }
        "send until killed" => {
            send_at_random(&ground, || true);
        }
        "receive until killed" => {
            let full = Full::ALL.into_iter().find(|full| full.name() == policy).unwrap();
            let mut receiver = ground.join().receiver(MAILBOX, Shape { full, ..SHAPE }).unwrap();
            let mut order = Order::default();
            tell("ready");
            loop {
                order.check(&receiver.receive());
            }
        }
        other => panic!("no role {other}"),
    }
}

/// Xorshift: good enough to be unforeseen.
struct Random(u64);

impl Random {
    fn new(seed: u32) -> Self {
        Self(u64::from(seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % end
    }
}

/// A body: who (incarnation), the how manieth of its priority, filling, and a sum over all that.
fn body(random: &mut Random, who: u32, number: u32) -> Vec<u8> {
    let mut bytes = [who.to_le_bytes(), number.to_le_bytes()].concat();
    bytes.extend((0..random.below(200)).map(|i| (i as u8) ^ number as u8));
    bytes.extend(sum(&bytes).to_le_bytes());
    bytes
}

fn sum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |sum, byte| (sum ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

fn send_at_random(ground: &Ground, go_on: impl Fn() -> bool) -> u64 {
    let participant = ground.join();
    let mut sender: Sender = participant.sender(MAILBOX).unwrap();
    let mut random = Random::new(participant.incarnation());
    let (mut numbers, mut accepted) = ([0; PRIORITIES.len()], 0);
    while go_on() {
        let class = random.below(PRIORITIES.len() as u64) as usize;
        let body = body(&mut random, participant.incarnation(), numbers[class]);
        let label = label(Priority(PRIORITIES[class]), 0);
        let result = match random.below(3) {
            0 => sender.loan(label.priority).and_then(|mut loan| {
                loan.body()[..body.len()].copy_from_slice(&body);
                loan.send(&label, body.len())
            }),
            _ => sender.send(&label, &[&body[..4], &body[4..]]),
        };
        match result {
            Ok(()) => {
                numbers[class] += 1;
                accepted += 1;
            }
            Err(SendError::Full(_)) => std::thread::yield_now(),
            Err(error) => panic!("{error}"),
        }
        if random.below(50) == 0 {
            drop(sender.loan(label.priority));
        }
        if random.below(30) == 0 {
            std::thread::sleep(Duration::from_micros(random.below(300)));
        }
    }
    accepted
}

/// The last number of each sender and priority.
#[derive(Default)]
struct Order(HashMap<(u32, u8), u32>);

impl Order {
    fn check(&mut self, package: &Package<'_>) {
        let (bytes, end) = package.body().split_at(package.body().len() - 4);
        assert_eq!(sum(bytes).to_le_bytes(), end, "torn");
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let last = self.0.insert((word(0), package.head().priority.0), word(4));
        let again = package.head().options.has(Options::REDELIVERED);
        assert!(again || last.is_none_or(|last| last < word(4)), "out of order: {last:?} before {}", word(4));
    }
}

#[test]
fn everything_sent_is_received_in_order_or_counted_as_lost() {
    let ground = Ground::new();
    let mut receiver = ground.join().receiver(MAILBOX, SHAPE).unwrap();
    let senders: Vec<Process> = (0..4).map(|_| ground.start("send for a while")).collect();
    let mut order = Order::default();
    let mut count = 0;
    let mut random = Random::new(1);
    let mut sent = Vec::new();
    while sent.len() < senders.len() {
        if let Some(package) = receiver.receive_timeout(Duration::from_millis(20)) {
            order.check(&package);
            count += 1;
            if random.below(200) == 0 {
                // Long enough for the mailbox to fill.
                std::thread::sleep(Duration::from_millis(1));
            }
        } else if ground.look().depth == 0 {
            // All are silent: they are done, or about to be.
            sent.push(senders[sent.len()].hear().parse::<u64>().unwrap());
        }
    }
    while let Some(package) = receiver.try_receive() {
        order.check(&package);
        count += 1;
    }
    let info = ground.look();
    assert_eq!(info.sent, sent.iter().sum::<u64>());
    assert_eq!((received(&info), accounted(&info), info.depth), (count, info.sent, 0));
    assert!(count > 1000 && lost(&info, Loss::Displaced) > 0, "too quiet to prove anything: {info:?}");
}

#[test]
fn a_storm_of_kills_leaves_nothing_torn_stuck_or_hidden() {
    storm(Full::Displace, Loss::Displaced);
}

#[test]
fn a_storm_of_kills_leaves_nothing_of_what_was_replaced() {
    storm(Full::Latest, Loss::Replaced);
}

fn storm(full: Full, cause: Loss) {
    let shape = Shape { full, ..SHAPE };
    let ground = Ground::new();
    drop(ground.join().receiver(MAILBOX, shape).unwrap());
    let receive = format!("receive until killed, {}", full.name());
    let roles = [&receive, "send until killed", "send until killed", "send until killed"];
    let mut processes: Vec<Process> = roles.iter().map(|role| ground.start(role)).collect();
    assert_eq!(processes[0].hear(), "ready");
    let node = ground.node();
    let mut random = Random::new(std::process::id());
    let start = Instant::now();
    let mut kills = 0;
    while start.elapsed() < Duration::from_secs(8) {
        std::thread::sleep(Duration::from_micros(random.below(30_000)));
        let which = random.below(roles.len() as u64) as usize;
        processes.swap_remove(which).kill();
        node.announce_death();
        kills += 1;
        processes.push(ground.start(roles[which]));
        processes.swap(which, roles.len() - 1);
    }
    processes.into_iter().for_each(Process::kill);
    kills += roles.len() as u64;
    node.announce_death();

    let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
    let mut order = Order::default();
    while let Some(package) = receiver.try_receive() {
        order.check(&package);
    }
    let info = ground.look();
    assert_eq!(info.depth, 0);
    assert!(lost(&info, cause) > 100, "too quiet to prove anything: {info:?}");
    assert!(
        info.sent.abs_diff(accounted(&info)) <= kills,
        "{kills} kills, {} accounted for: {info:#?}",
        accounted(&info)
    );
    assert!(received(&info) > 1000, "too quiet to prove anything: {info:?}");
    let mut sender = ground.sender();
    for id in 0..SHAPE.slots {
        sender.send(&label(Priority(1), id), &[]).unwrap();
    }
    for _ in 0..SHAPE.slots {
        assert!(receiver.receive_timeout(PATIENCE).is_some());
    }
    assert_eq!(node.participants().len(), 2);
}
