//! Modules that speak from node to node, in numbers: what was lost, and what came in another order, is seen.

use super::stalls::Stalls;
use super::{NODES, PATIENCE, Segment, label};
use rohrpost_mailbox::{Receiver, SendError, Sender};
use std::time::{Duration, Instant};

/// A round of packages comes so much after the one before: a few in each cycle, at any moment of it.
pub(crate) const PAUSE: Duration = Duration::from_micros(2300);

/// With this number nodes get acquainted; it counts for nothing else.
const GREETING: u16 = u16::MAX;

/// These nodes speak to each other for so many rounds, and lose nothing.
pub(crate) fn talk(segment: &Segment, ears: &mut Ears, nodes: &[u8], rounds: u16) {
    let mut mouths = mouths(segment, nodes);
    ears.acquaint(&mut mouths);
    ears.say_all(&mut mouths, rounds);
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
    /// Whom each was greeted by since the last acquaintance began.
    greeted: Vec<Vec<bool>>,
    /// Since they listened last for all that was said.
    stalls: Stalls,
}

impl Ears {
    pub(crate) fn new(segment: &Segment) -> Self {
        Self {
            receivers: segment.stations.iter().map(|station| station.receiver()).collect(),
            heard: vec![vec![Vec::new(); NODES.into()]; NODES.into()],
            greeted: vec![vec![false; NODES.into()]; NODES.into()],
            stalls: Stalls::watched(),
        }
    }

    /// Whether this computer had too little time for slots since they listened last: then packages become too old, and are lost.
    pub(crate) fn is_excused(&mut self) -> bool {
        std::mem::replace(&mut self.stalls, Stalls::watched()).starved()
    }

    pub(crate) fn listen(&mut self) {
        for ((receiver, heard), greeted) in self.receivers.iter_mut().zip(&mut self.heard).zip(&mut self.greeted) {
            while let Some(package) = receiver.try_receive() {
                let from = usize::from(package.head().from.instance());
                match package.head().id {
                    GREETING => greeted[from] = true,
                    id => heard[from].push(id),
                }
            }
        }
    }

    /// So many rounds of packages.
    pub(crate) fn say_all(&mut self, mouths: &mut [Mouth], rounds: u16) {
        for id in 0..rounds {
            mouths.iter_mut().for_each(|mouth| mouth.say(id));
            self.listen();
            std::thread::sleep(PAUSE);
        }
    }

    /// All of them speak until each has heard each. Before, one may take another for silent, on a computer that is slow to join; then it loses
    /// what is for that one, as it has to.
    pub(crate) fn acquaint(&mut self, mouths: &mut [Mouth]) {
        let began = Instant::now();
        self.greeted.iter_mut().flatten().for_each(|greeted| *greeted = false);
        while !mouths.iter().all(|mouth| self.greeted[usize::from(mouth.to)][usize::from(mouth.from)]) {
            assert!(began.elapsed() < PATIENCE, "who has heard whom: {:?}", self.greeted);
            mouths.iter_mut().for_each(|mouth| mouth.say(GREETING));
            std::thread::sleep(PAUSE);
            self.listen();
        }
    }

    /// Waits until all these numbers have come from each of the nodes to each other, which they do on a computer that has time for slots.
    pub(crate) fn hear_all(&mut self, nodes: &[u8], numbers: &[u16]) {
        match self.try_hear_all(nodes, numbers) {
            Ok(()) => self.stalls = Stalls::watched(),
            Err((from, to, heard)) => assert!(self.is_excused(), "{from} to {to}: {heard:?}"),
        }
    }

    /// The same; the first that was not heard in full, by whom, and what was heard of it. That is known once a later number has come: between
    /// two nodes nothing changes its order.
    pub(crate) fn try_hear_all(&mut self, nodes: &[u8], numbers: &[u16]) -> Result<(), (u8, u8, Vec<u16>)> {
        let began = Instant::now();
        let mut heard_all = Ok(());
        for (from, to) in nodes.iter().flat_map(|from| nodes.iter().map(move |to| (*from, *to))) {
            while from != to && heard_all.is_ok() && self.heard[usize::from(to)][usize::from(from)] != numbers {
                let heard = &self.heard[usize::from(to)][usize::from(from)];
                if !numbers.starts_with(heard) || began.elapsed() > PATIENCE {
                    heard_all = Err((from, to, heard.clone()));
                }
                std::thread::sleep(Duration::from_millis(1));
                self.listen();
            }
        }
        self.heard.iter_mut().flatten().for_each(Vec::clear);
        heard_all
    }
}
