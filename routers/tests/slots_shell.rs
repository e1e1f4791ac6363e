//! Three routers that send in time slots, between network namespaces: what crosses the bridge, and whether all arrives.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "slots_common/mod.rs"]
mod common;

use common::kept::{assert_inside, assert_kept, validate};
use common::talk::{Listeners, talkers};
use common::{Capture, MASTERS, NODES, PATIENCE, Segment};
use rohrpost_routers::frame::FrameKind;
use rohrpost_routers::time::Role;
use std::time::Instant;

/// Rounds of packages: from each node to each other.
const ROUNDS: u16 = 150;
#[test]
fn each_node_sends_in_its_slots_and_all_arrives_also_when_the_master_dies() {
    let Some(mut segment) = Segment::start() else { return };
    segment.wait_until_all_send();
    let all: Vec<u8> = (0..NODES).collect();
    let (mut listeners, mut mouths_of_all) = (Listeners::new(&segment), talkers(&segment, &all));
    listeners.acquaint(&mut mouths_of_all);
    let capture = Capture::start(&segment.lab);
    listeners.say_all(&mut mouths_of_all, 0..ROUNDS);
    listeners.hear_all(&segment, &all, 0..ROUNDS);
    let crossed = capture.end();
    for kind in [FrameKind::Packages, FrameKind::Sync, FrameKind::Request, FrameKind::Reply] {
        assert!(crossed.iter().any(|frame| frame.kind == kind), "{kind:?} crossed the bridge");
    }
    assert_kept("with a master", &segment, 0, &crossed);

    // The master ends in the middle of it: the others go on, and lose nothing.
    let capture = Capture::start(&segment.lab);
    // Where the first was slow to begin the other is master.
    let master = || segment.stations[2].clock().master;
    segment.wait_until("there is a master", |_| master().is_some());
    let master = master().unwrap();
    let next = MASTERS[0] + MASTERS[1] - master;
    let others = [next, 2];
    let mut mouths_of_others = talkers(&segment, &others);
    let left_out = |segment: &Segment| {
        let counts = segment.stations[usize::from(next)].slots().counts;
        (counts.syncs.replacements_sent, counts.late + counts.skipped + counts.synchronisations_late)
    };
    let before = left_out(&segment);
    listeners.say_all(&mut mouths_of_others, 0..ROUNDS / 2);
    segment.stations[usize::from(master)].shell = None;
    listeners.say_all(&mut mouths_of_others, ROUNDS / 2..2 * ROUNDS);
    listeners.hear_all(&segment, &others, 0..2 * ROUNDS);
    segment.wait_until("the next is the master", |segment| {
        segment.stations[usize::from(next)].clock().role == Role::Master
    });
    segment.wait_until("node 2 follows", |segment| segment.stations[2].clock().master == Some(next));
    let crossed = capture.end();
    assert_kept("while the master dies", &segment, 2, &crossed);
    let (stood_in, missed) = left_out(&segment);
    assert!(stood_in > before.0 || missed > before.1, "it stood in before it took over, or woke up too late for that");
    // On a busy computer many wake-ups are late; that such slots are skipped is what keeps the frames above where
    // they belong.
    for station in others.map(|own| &segment.stations[usize::from(own)]) {
        let counts = station.slots().counts;
        assert!(counts.used > 0, "node {}: {counts:?}", station.own);
    }

    // It comes back, listens, and speaks again.
    let Segment { stations, lab, .. } = &mut segment;
    stations[usize::from(master)].start(lab);
    segment.wait_until_all_send();
    listeners.acquaint(&mut mouths_of_all);
    // In one burst: the queue holds what waits for its slots.
    (0..20).for_each(|id| mouths_of_all.iter_mut().for_each(|talker| talker.say(id)));
    listeners.hear_all(&segment, &all, 0..20);
}

#[test]
fn a_refusal_waits_for_a_slot() {
    let Some(mut segment) = Segment::start() else { return };
    segment.wait_until_all_send();
    segment.stations[2].shell = None;
    let capture = Capture::start(&segment.lab);
    // In the place of node 2 there is now a sender with another configuration, which ignores slots.
    let stranger = segment.socket(2);
    let (mut heard, began) = ([0; 128], Instant::now());
    let refusals = loop {
        for node in [0, 1] {
            stranger.send_to(&common::of_another_digest(2, node), common::at(node)).unwrap();
        }
        let seen = common::frames(&stranger, &mut heard).filter(|kind| *kind == FrameKind::Refusal).count();
        if seen > 0 {
            break seen;
        }
        assert!(began.elapsed() < PATIENCE, "nobody refuses");
    };
    let mut crossed = capture.end();
    crossed.retain(|frame| frame.kind == FrameKind::Refusal);
    assert!(crossed.len() >= refusals);
    assert_inside("a refusal", &segment, &validate(&crossed, segment.time_of(0)));
}
