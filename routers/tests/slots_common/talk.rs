//! Modules that speak from node to node, in numbers: what was lost, and what came in another order, is seen.

use super::{NODES, PATIENCE, Segment, label};
use rohrpost_mailbox::{Receiver, SendError, Sender};
use std::ops::Range;
use std::time::{Duration, Instant};

/// A round of packages comes so much after the one before: a few in each cycle, at any moment of it.
pub(crate) const PAUSE: Duration = Duration::from_micros(2300);

/// With this number nodes begin a peer session; it counts for nothing else.
const FIRST_WORD: u16 = u16::MAX;

/// These nodes speak to each other for so many rounds, and lose nothing.
pub(crate) fn talk(segment: &Segment, listeners: &mut Listeners, nodes: &[u8], rounds: u16) {
    let mut talkers = talkers(segment, nodes);
    listeners.acquaint(&mut talkers);
    listeners.say_all(&mut talkers, 0..rounds);
    listeners.hear_all(segment, nodes, 0..rounds);
}

/// Speaks from one node to another.
pub(crate) struct Talker {
    from: u8,
    to: u8,
    sender: Sender,
}

impl Talker {
    /// Says a number; if the router's mailbox is full just now, a little later.
    pub(crate) fn say(&mut self, id: u16) {
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

/// From each of these nodes to each other of them.
pub(crate) fn talkers(segment: &Segment, nodes: &[u8]) -> Vec<Talker> {
    let pairs = nodes.iter().flat_map(|from| nodes.iter().map(move |to| (*from, *to)));
    let talker = |(from, to): (u8, u8)| Talker { from, to, sender: segment.stations[usize::from(from)].sender(to) };
    pairs.filter(|(from, to)| from != to).map(talker).collect()
}

/// What each node has heard of each, in order.
pub(crate) struct Listeners {
    receivers: Vec<Receiver>,
    heard: Vec<Vec<Vec<u16>>>,
    /// By receiver, the nodes that greeted it since the last handshake began.
    greeted: Vec<Vec<bool>>,
}

impl Listeners {
    pub(crate) fn new(segment: &Segment) -> Self {
        Self {
            receivers: segment.stations.iter().map(|station| station.receiver()).collect(),
            heard: vec![vec![Vec::new(); NODES.into()]; NODES.into()],
            greeted: vec![vec![false; NODES.into()]; NODES.into()],
        }
    }

    pub(crate) fn listen(&mut self) {
        for ((receiver, heard), greeted) in self.receivers.iter_mut().zip(&mut self.heard).zip(&mut self.greeted) {
            while let Some(package) = receiver.try_receive() {
                let from = usize::from(package.head().from.instance());
                match package.head().id {
                    FIRST_WORD => greeted[from] = true,
                    id => heard[from].push(id),
                }
            }
        }
    }

    /// Rounds of packages with these numbers.
    pub(crate) fn say_all(&mut self, talkers: &mut [Talker], numbers: Range<u16>) {
        for id in numbers {
            talkers.iter_mut().for_each(|talker| talker.say(id));
            self.listen();
            std::thread::sleep(PAUSE);
        }
    }

    /// All of them speak until each has heard each. Before, one may take another for silent, on a computer that is slow
    /// to join; then it loses what is for that one, as it has to.
    pub(crate) fn acquaint(&mut self, talkers: &mut [Talker]) {
        let began = Instant::now();
        self.greeted.iter_mut().flatten().for_each(|greeted| *greeted = false);
        while !talkers.iter().all(|talker| self.greeted[usize::from(talker.to)][usize::from(talker.from)]) {
            assert!(began.elapsed() < PATIENCE, "nodes that greeted each node: {:?}", self.greeted);
            talkers.iter_mut().for_each(|talker| talker.say(FIRST_WORD));
            std::thread::sleep(PAUSE);
            self.listen();
        }
        // Of what was said before nothing is under way any more.
        self.heard.iter_mut().flatten().for_each(Vec::clear);
    }

    /// Waits until all these numbers have come from each of the nodes to each other. That one does not come is known
    /// once a later number has: between two nodes nothing changes its order.
    pub(crate) fn hear_all(&mut self, segment: &Segment, nodes: &[u8], numbers: Range<u16>) {
        self.hear_all_unless(segment, nodes, numbers, || false);
    }

    /// The same, unless something happens that may keep them up.
    pub(crate) fn hear_all_unless(
        &mut self,
        segment: &Segment,
        nodes: &[u8],
        numbers: Range<u16>,
        has_happened: impl Fn() -> bool,
    ) {
        let numbers: Vec<u16> = numbers.collect();
        let began = Instant::now();
        for (from, to) in nodes.iter().flat_map(|from| nodes.iter().map(move |to| (*from, *to))) {
            while from != to && self.heard[usize::from(to)][usize::from(from)] != numbers {
                if has_happened() {
                    return;
                }
                let heard = &self.heard[usize::from(to)][usize::from(from)];
                let is_whole = numbers.starts_with(heard) && began.elapsed() < PATIENCE;
                assert!(is_whole, "{from} to {to}: {heard:?}; lost: {:?}", segment.lost());
                std::thread::sleep(Duration::from_millis(1));
                self.listen();
            }
        }
        self.heard.iter_mut().flatten().for_each(Vec::clear);
    }
}
