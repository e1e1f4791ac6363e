//! Three routers that send in time slots, between network namespaces: what crosses the bridge, and whether all arrives.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "slots_common/mod.rs"]
mod common;

use common::{Capture, Crossed, Judged, NODES, PATIENCE, Segment, judge, label};
use rohrpost_mailbox::{Receiver, SendError, Sender};
use rohrpost_routers::frame::Kind;
use rohrpost_routers::time::Role;
use std::time::{Duration, Instant};

/// Rounds of packages: from each node to each other.
const ROUNDS: u16 = 150;
/// A round comes so much after the one before: a few in each cycle, at any moment of it.
const PAUSE: Duration = Duration::from_micros(2300);
/// Of the frames, so many in a thousand may be outside of their sender's slots: the thread looks at the clock before each, and may lose
/// its processor between that and the system call. TDMA.md found 0.03 % to 0.5 % of wake-ups that late on a computer that works.
const OUTSIDE_PER_THOUSAND: usize = 10;

struct Mouth {
    from: u8,
    to: u8,
    sender: Sender,
}

impl Mouth {
    /// Says a number; if the router's mailbox is full just now, a little later.
    fn say(&mut self, id: u16) {
        let began = Instant::now();
        loop {
            match self.sender.send(&label(self.from, 100, id), &[&id.to_le_bytes()]) {
                Ok(()) => return,
                Err(SendError::Full(_)) => std::thread::sleep(Duration::from_micros(100)),
                Err(error) => panic!("{} to {}: {error}", self.from, self.to),
            }
            assert!(began.elapsed() < PATIENCE, "{} to {}: {id}", self.from, self.to);
        }
    }
}

fn mouths(segment: &Segment, nodes: &[u8]) -> Vec<Mouth> {
    let pairs = nodes.iter().flat_map(|from| nodes.iter().map(move |to| (*from, *to)));
    let mouth = |(from, to): (u8, u8)| Mouth { from, to, sender: segment.stations[usize::from(from)].sender(to) };
    pairs.filter(|(from, to)| from != to).map(mouth).collect()
}

/// What each node has heard of each, in order.
struct Ears {
    receivers: Vec<Receiver>,
    heard: Vec<Vec<Vec<u16>>>,
}

impl Ears {
    fn new(segment: &Segment) -> Self {
        Self {
            receivers: segment.stations.iter().map(|station| station.receiver()).collect(),
            heard: vec![vec![Vec::new(); NODES.into()]; NODES.into()],
        }
    }

    fn listen(&mut self) {
        for (receiver, heard) in self.receivers.iter_mut().zip(&mut self.heard) {
            while let Some(package) = receiver.try_receive() {
                heard[usize::from(package.head().from.instance())].push(package.head().id);
            }
        }
    }

    /// Waits until all these numbers have come from each of the nodes to each other.
    fn hear_all(&mut self, nodes: &[u8], numbers: &[u16]) {
        let began = Instant::now();
        for (from, to) in nodes.iter().flat_map(|from| nodes.iter().map(move |to| (*from, *to))) {
            while from != to && self.heard[usize::from(to)][usize::from(from)] != numbers {
                assert!(
                    began.elapsed() < PATIENCE,
                    "{from} to {to}: {:?}",
                    self.heard[usize::from(to)][usize::from(from)]
                );
                std::thread::sleep(Duration::from_millis(1));
                self.listen();
            }
        }
        self.heard.iter_mut().flatten().for_each(Vec::clear);
    }
}

fn tell(what: &str, judged: &Judged) {
    let at = |per_thousand: usize| judged.starts_ns[(judged.starts_ns.len() - 1) * per_thousand / 1000] as f64 / 1e3;
    println!(
        "{what}: {} frames, {} outside; slots begin p1 {:.1} p50 {:.1} p99 {:.1} p99.9 {:.1} us after their nominal time",
        judged.frames,
        judged.outside.len(),
        at(10),
        at(500),
        at(990),
        at(999)
    );
}

fn assert_kept(what: &str, crossed: &[Crossed], time: &rohrpost_mailbox::TimeRecord) {
    let judged = judge(crossed, time);
    tell(what, &judged);
    assert!(judged.frames > 100, "{judged:?}");
    assert!(judged.outside.len() * 1000 <= judged.frames * OUTSIDE_PER_THOUSAND, "{what}: {judged:?}");
}

#[test]
fn each_node_sends_in_its_slots_and_all_arrives_also_when_the_master_dies() {
    let Some(mut segment) = Segment::start() else { return };
    segment.wait_until("all send", |segment| segment.stations.iter().all(common::Station::is_ready));
    let all: Vec<u8> = (0..NODES).collect();
    let (mut ears, mut mouths_of_all) = (Ears::new(&segment), mouths(&segment, &all));
    let time = segment.stations[0].clock().record;
    let capture = Capture::start(&segment.lab);
    for id in 0..ROUNDS {
        mouths_of_all.iter_mut().for_each(|mouth| mouth.say(id));
        ears.listen();
        std::thread::sleep(PAUSE);
    }
    ears.hear_all(&all, &(0..ROUNDS).collect::<Vec<_>>());
    let crossed = capture.end();
    for kind in [Kind::Packages, Kind::Sync, Kind::Request, Kind::Reply] {
        assert!(crossed.iter().any(|frame| frame.kind == kind), "{kind:?} crossed the bridge");
    }
    assert_kept("with a master", &crossed, &time);

    // The master ends in the middle of it: the others go on, and lose nothing.
    let capture = Capture::start(&segment.lab);
    let others = [1, 2];
    let mut mouths_of_others = mouths(&segment, &others);
    for id in 0..2 * ROUNDS {
        if id == ROUNDS / 2 {
            segment.stations[0].shell = None;
        }
        mouths_of_others.iter_mut().for_each(|mouth| mouth.say(id));
        ears.listen();
        std::thread::sleep(PAUSE);
    }
    ears.hear_all(&others, &(0..2 * ROUNDS).collect::<Vec<_>>());
    segment.wait_until("node 1 is the master", |segment| segment.stations[1].clock().role == Role::Master);
    segment.wait_until("node 2 follows", |segment| segment.stations[2].clock().master == Some(1));
    let crossed = capture.end();
    assert_kept("while the master dies", &crossed, &time);
    let counts = segment.stations[1].slots().counts;
    assert!(counts.syncs.replacements_sent > 0, "it stood in before it took over: {counts:?}");
    // On a busy computer many wake-ups are late; that such slots are skipped is what keeps the frames above where they belong.
    for station in &segment.stations[1..] {
        let counts = station.slots().counts;
        assert!(counts.used > 0, "node {}: {counts:?}", station.own);
    }

    // It comes back, listens, and speaks again.
    segment.stations.iter_mut().take(1).for_each(|station| station.start(&segment.lab));
    segment.wait_until("all send again", |segment| segment.stations.iter().all(common::Station::is_ready));
    let numbers: Vec<_> = (0..20).collect();
    numbers.iter().for_each(|id| mouths_of_all.iter_mut().for_each(|mouth| mouth.say(*id)));
    ears.hear_all(&all, &numbers);
}

#[test]
fn a_refusal_waits_for_a_slot() {
    let Some(mut segment) = Segment::start() else { return };
    segment.wait_until("all send", |segment| segment.stations.iter().all(common::Station::is_ready));
    let time = segment.stations[0].clock().record;
    segment.stations[2].shell = None;
    let capture = Capture::start(&segment.lab);
    // In the place of node 2 now somebody speaks who has another configuration, and whenever he likes.
    let stranger = segment.socket(2);
    let (mut heard, began) = ([0; 128], Instant::now());
    let refusals = loop {
        for node in [0, 1] {
            stranger.send_to(&common::of_another_digest(2, node), common::at(node)).unwrap();
        }
        let seen = common::frames(&stranger, &mut heard).filter(|kind| *kind == Kind::Refusal).count();
        if seen > 0 {
            break seen;
        }
        assert!(began.elapsed() < PATIENCE, "nobody refuses");
    };
    let mut crossed = capture.end();
    crossed.retain(|frame| frame.kind == Kind::Refusal);
    assert!(crossed.len() >= refusals);
    let judged = judge(&crossed, &time);
    assert!(judged.outside.is_empty(), "{judged:?}");
}
