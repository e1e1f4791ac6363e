//! An attacker that has recorded all datagrams, and sends replays, alterations and mixtures. None of it is taken.

use super::*;
use crate::frame::SEQUENCE_MAX;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// Datagrams in a normal run; `HOSTILE_DATAGRAMS` says another number.
const NORMALLY: u64 = 30_000;
/// After so many, both routers say something true, which must be taken.
const TRUTH_EVERY: u64 = 500;

struct Hostile {
    chance: ChaCha8Rng,
    recorded: Vec<(Port, Vec<u8>)>,
}

impl Hostile {
    fn below(&mut self, limit: usize) -> usize {
        (self.chance.next_u64() % limit as u64) as usize
    }

    fn datagram(&mut self) -> (Port, Vec<u8>) {
        let one = self.below(self.recorded.len());
        let (port, mut datagram) = self.recorded[one].clone();
        match self.below(8) {
            // As it was.
            0 => return (port, datagram),
            // At another port.
            1 => return (Port::ALL[(port as usize + 1 + self.below(Port::ALL.len() - 1)) % Port::ALL.len()], datagram),
            // Some bits flipped.
            2 => {
                for _ in 0..=self.below(3) {
                    let bit = self.below(datagram.len() * 8);
                    datagram[bit / 8] ^= 1 << (bit % 8);
                }
            }
            // Cut, or with something behind it.
            3 => datagram.truncate(self.below(datagram.len())),
            4 => datagram.extend((0..=self.below(20)).map(|n| n as u8)),
            // The head of one, the rest of another.
            5 => {
                let other = self.below(self.recorded.len());
                let rest = self.recorded[other].1.get(HEAD_BYTES..).unwrap_or_default().to_vec();
                datagram.truncate(HEAD_BYTES);
                datagram.extend(rest);
            }
            // Another sequence, by which nothing came before.
            6 if datagram.len() > 32 => {
                let sequence = self.chance.next_u64() & SEQUENCE_MAX;
                datagram[24..32].copy_from_slice(&sequence.to_le_bytes());
            }
            // Another field of the head: kind, system, nodes, key, digest, incarnation.
            _ if datagram.len() > 32 => {
                let at = 3 + self.below(21);
                datagram[at] = if at < 8 { self.below(20) as u8 } else { self.chance.next_u64() as u8 };
            }
            _ => {}
        }
        (port, checked(datagram))
    }
}

/// All that can be seen of a router from outside, and of what it believes.
fn beliefs(router: &Router) -> [u64; 6] {
    let lives = [0, 1, 2].map(|peer| router.all.incarnation(peer).unwrap_or_default());
    let challenges = [0, 1, 2].map(|peer| router.all.challenge(peer));
    [lives[0], lives[1], lives[2], challenges[0], challenges[1], challenges[2]]
}

#[test]
fn of_what_was_recorded_and_altered_nothing_is_taken() {
    let wanted = std::env::var("HOSTILE_DATAGRAMS").ok();
    let datagrams = wanted.map_or(NORMALLY, |wanted| wanted.parse().expect("HOSTILE_DATAGRAMS is a number"));
    let mut hostile = Hostile { chance: ChaCha8Rng::seed_from_u64(4), recorded: Vec::new() };
    // Earlier incarnations, which said much that was never delivered; then two that stay.
    let mut routers = None;
    for incarnation in 0..20 {
        let (mut a, mut b) = (Router::new(0, 100 + incarnation), Router::new(1, 200 + incarnation / 3));
        hostile.recorded.extend(acquaint(&mut a, &mut b).into_iter().map(|hello| (Port::Packages, hello)));
        hostile.recorded.push((Port::Packages, a.ask(1)));
        for n in 0..50 {
            let port = Port::ALL[n % Port::ALL.len()];
            hostile.recorded.push((port, a.seal(port, 1, &[n as u8; 70]).unwrap()));
            hostile.recorded.push((port, b.seal(port, 0, &[n as u8; 72]).unwrap()));
        }
        routers = Some((a, b));
    }
    let (mut a, mut b) = routers.unwrap();
    // These two took what they said.
    for (port, datagram) in &hostile.recorded {
        let _ = [&mut a, &mut b].map(|router| router.opening[*port as usize].open(&mut datagram.clone()).is_ok());
    }
    let before = [&a, &b].map(beliefs);
    let mut room = [0; HELLO_DATAGRAM_BYTES];
    for number in 0..datagrams {
        let (port, sent) = hostile.datagram();
        for router in [&mut a, &mut b] {
            let mut datagram = sent.clone();
            match router.opening[port as usize].open(&mut datagram) {
                Ok(Opened::Frame(head, _)) => panic!("datagram {number} was taken: {head:?}, {sent:?}"),
                Ok(Opened::Hello(head, hello)) => {
                    let greeted = router.handshake.receive(number, &head, &hello, &mut room);
                    assert!(!greeted.begins, "an incarnation began by datagram {number}: {sent:?}");
                }
                Err(_) => {}
            }
        }
        if number % TRUTH_EVERY == 0 {
            assert_eq!([&a, &b].map(beliefs), before, "after datagram {number}");
            for port in Port::ALL {
                let (there, back) = (a.seal(port, 1, b"there").unwrap(), b.seal(port, 0, b"back").unwrap());
                assert!(b.open(port, &there).is_ok() && a.open(port, &back).is_ok(), "after datagram {number}");
                hostile.recorded.extend([(port, there), (port, back)]);
            }
        }
    }
}
