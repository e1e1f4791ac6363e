//! Modules that speak from node to node, in numbers: what was lost, and what came in another order, is seen.

use super::{NODES, PATIENCE, Segment, label};
use rohrpost_mailbox::{Receiver, SendError, Sender};
use std::time::{Duration, Instant};

/// A round of packages comes so much after the one before: a few in each cycle, at any moment of it.
pub(crate) const PAUSE: Duration = Duration::from_micros(2300);

/// These nodes speak to each other for so many rounds, and lose nothing.
pub(crate) fn talk(segment: &Segment, ears: &mut Ears, nodes: &[u8], rounds: u16) {
    let mut mouths = mouths(segment, nodes);
    for id in 0..rounds {
        mouths.iter_mut().for_each(|mouth| mouth.say(id));
        ears.listen();
        std::thread::sleep(PAUSE);
    }
    ears.hear_all(nodes, &(0..rounds).collect::<Vec<_>>());
}

/// Speaks from one node to another.
pub(crate) struct Mouth {
    from: u8,
    to: u8,
    sender: Sender,
}

impl Mouth {
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
pub(crate) fn mouths(segment: &Segment, nodes: &[u8]) -> Vec<Mouth> {
    let pairs = nodes.iter().flat_map(|from| nodes.iter().map(move |to| (*from, *to)));
    let mouth = |(from, to): (u8, u8)| Mouth { from, to, sender: segment.stations[usize::from(from)].sender(to) };
    pairs.filter(|(from, to)| from != to).map(mouth).collect()
}

/// What each node has heard of each, in order.
pub(crate) struct Ears {
    receivers: Vec<Receiver>,
    heard: Vec<Vec<Vec<u16>>>,
}

impl Ears {
    pub(crate) fn new(segment: &Segment) -> Self {
        Self {
            receivers: segment.stations.iter().map(|station| station.receiver()).collect(),
            heard: vec![vec![Vec::new(); NODES.into()]; NODES.into()],
        }
    }

    pub(crate) fn listen(&mut self) {
        for (receiver, heard) in self.receivers.iter_mut().zip(&mut self.heard) {
            while let Some(package) = receiver.try_receive() {
                heard[usize::from(package.head().from.instance())].push(package.head().id);
            }
        }
    }

    /// Waits until all these numbers have come from each of the nodes to each other.
    pub(crate) fn hear_all(&mut self, nodes: &[u8], numbers: &[u16]) {
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
