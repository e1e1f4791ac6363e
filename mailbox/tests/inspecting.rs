//! A mailbox from outside, down to its slots.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, HIGH, LOW, MAILBOX, OTHER, label, shape, stay, tell};
use rohrpost_mailbox::{InspectError, MailboxDetail, Name, Participant, SlotInfo, VictimInfo};
use std::fs;

const MODULE: Name = Name::new(1, 60, 3, 0);

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    match role.as_str() {
        "fill" => {
            let participant = Participant::join(&ground.node(), MODULE).unwrap();
            let mut sender = participant.sender(MAILBOX).unwrap();
            let _loan = sender.loan(HIGH).unwrap();
            tell("there");
            stay();
        }
        "take two, give one back" => {
            let mut receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
            drop(receiver.try_receive().unwrap());
            let _in_hand = receiver.try_receive().unwrap();
            tell("there");
            stay();
        }
        other => panic!("no role {other}"),
    }
}

fn inspect(ground: &Ground) -> MailboxDetail {
    ground.node().inspect(MAILBOX).unwrap()
}

fn count(detail: &MailboxDetail, of: impl Fn(&SlotInfo) -> bool) -> usize {
    detail.slots.iter().filter(|slot| of(slot)).count()
}

fn fillers(detail: &MailboxDetail) -> Vec<(Option<u32>, Name, bool, Option<VictimInfo>)> {
    let party = |slot: &SlotInfo| match slot {
        SlotInfo::Filling { by, victim } => Some((by.pid, by.module, by.is_alive, *victim)),
        _ => None,
    };
    detail.slots.iter().filter_map(party).collect()
}

#[test]
fn each_slot_names_its_filler_and_whether_that_lives() {
    let ground = Ground::new();
    let _receiver = ground.join().receiver(MAILBOX, shape(2)).unwrap();
    assert_eq!(inspect(&ground).slots, [SlotInfo::Free; 2]);
    let mut sender = ground.sender();
    (0..2).for_each(|id| sender.send(&label(LOW, id), &[]).unwrap());
    let first = ground.start("fill");
    assert_eq!(first.hear(), "there");
    let victim = Some(VictimInfo { priority: LOW, is_replaced: false });
    assert_eq!(fillers(&inspect(&ground)), [(Some(first.id()), MODULE, true, victim)]);
    let dead = first.id();
    first.kill();
    assert_eq!(fillers(&inspect(&ground)), [(Some(dead), MODULE, false, victim)]);
    // The successor of the dead one is another participant.
    let _successor = ground.join();
    assert_eq!(fillers(&inspect(&ground)), [(None, Name::NONE, false, victim)]);
    let detail = inspect(&ground);
    assert_eq!((detail.info.depth, count(&detail, |slot| matches!(slot, SlotInfo::Ready(_)))), (1, 1));
}

#[test]
fn what_waits_and_what_is_in_hand_say_their_places_in_the_order() {
    let ground = Ground::new();
    drop(ground.join().receiver(MAILBOX, shape(4)).unwrap());
    let mut sender = ground.sender();
    for (id, priority) in [(1, LOW), (2, HIGH), (3, LOW)] {
        sender.send(&label(priority, id), &[]).unwrap();
    }
    let receiver = ground.start("take two, give one back");
    assert_eq!(receiver.hear(), "there");
    let told = |detail: &MailboxDetail| {
        let mut told: Vec<_> = (detail.slots.iter())
            .filter_map(|slot| match slot {
                SlotInfo::Ready(package) => Some(("ready", package.priority.0, package.ticket, package.is_redelivered)),
                SlotInfo::Taken(package) => Some(("taken", package.priority.0, package.ticket, package.is_redelivered)),
                _ => None,
            })
            .collect();
        told.sort_unstable_by_key(|package| package.2);
        told
    };
    let detail = inspect(&ground);
    assert_eq!(told(&detail), [("taken", LOW.0, 0, false), ("ready", LOW.0, 2, false)]);
    assert_eq!(detail.receiver.map(|party| (party.pid, party.is_alive)), Some((Some(receiver.id()), true)));
    let pid = receiver.id();
    receiver.kill();
    let detail = inspect(&ground);
    assert_eq!(detail.receiver.map(|party| (party.pid, party.is_alive)), Some((Some(pid), false)));
    let _receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    let detail = inspect(&ground);
    assert_eq!(told(&detail), [("ready", LOW.0, 0, true), ("ready", LOW.0, 2, false)]);
    assert_eq!((detail.info.adoptions, detail.is_retired), (2, false));
}

#[test]
fn inspecting_changes_nothing() {
    let (ground, mut receiver, mut sender) = Ground::ends(shape(4));
    (0..3).for_each(|id| sender.send(&label(LOW, id), &[]).unwrap());
    let _in_hand = receiver.try_receive().unwrap();
    let read = || {
        let files = fs::read_dir(ground.path()).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<_> = files.map(|path| (path.clone(), fs::read(path).unwrap())).collect();
        files.sort();
        files
    };
    let node = ground.node();
    let before = read();
    (0..100).for_each(|_| drop(node.inspect(MAILBOX).unwrap()));
    assert!(read() == before);
}

#[test]
fn what_cannot_be_inspected_says_why() {
    let (ground, node) = Ground::made();
    assert!(matches!(node.inspect(MAILBOX), Err(InspectError::Missing(MAILBOX))));
    fs::write(ground.path().join(format!("{:08x}.mbx", OTHER.raw())), b"a letter").unwrap();
    let told = node.inspect(OTHER).unwrap_err().to_string();
    assert!(told.starts_with("mailbox 1.201.1.0: its file is no mailbox, or damaged"), "{told}");
    let receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    let file = ground.path().join(format!("{:08x}.mbx", MAILBOX.raw()));
    let mut bytes = fs::read(&file).unwrap();
    bytes[8] = 99;
    fs::write(&file, bytes).unwrap();
    let told = node.inspect(MAILBOX).unwrap_err().to_string();
    assert!(told.contains("another version (layout 99,"), "{told}");
    drop(receiver);
}
