//! Who lives is found out by challenge and answer; no state is kept for who has not answered.

use super::acquaintances::{Acquaintances, Life};
use super::hello::Hello;
use super::opening::Greeting;
use crate::broken::broken;
use crate::frame::{FrameHead, NodeIndex};
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use std::sync::Arc;

/// Hellos that one peer is sent back in [`PER_NS`], at most: recorded questions that are sent again must not cost more than they are worth.
pub const ANSWERS_MAX: u32 = 100;
/// See [`ANSWERS_MAX`].
pub const PER_NS: u64 = 100_000_000;

/// Takes hellos, in the thread that receives packages.
pub struct Greeter {
    all: Arc<Acquaintances>,
    random: ChaCha20Rng,
    answered: Box<[Answered]>,
}

#[derive(Clone, Copy, Default)]
struct Answered {
    since_ns: u64,
    times: u32,
}

/// What a hello brought about.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Greeted {
    /// A life of the peer has begun.
    pub began: bool,
    /// Bytes of the hello to send back, in the buffer.
    pub reply_bytes: Option<usize>,
}

impl Greeter {
    /// There is one. `seed` comes from a source of random numbers that is fit for keys; each life has another.
    pub fn new(all: &Arc<Acquaintances>, seed: [u8; 32]) -> Self {
        let answered = vec![Answered::default(); all.who.nodes.into()].into();
        let mut greeter = Self { all: all.clone(), random: ChaCha20Rng::from_seed(seed), answered };
        (0..all.who.nodes).for_each(|peer| greeter.draw(peer));
        greeter
    }

    /// Takes a hello that was opened, if all else in its head is as it must be. `datagram` has room for a hello of
    /// [`HELLO_DATAGRAM_BYTES`](super::HELLO_DATAGRAM_BYTES).
    pub fn greet(&mut self, now_ns: u64, head: &FrameHead, greeting: &Greeting, datagram: &mut [u8]) -> Greeted {
        let (peer, Greeting { hello, key }) = (head.from, *greeting);
        let proves = hello.answer == self.all.challenge(peer) || broken!(BeginsUnproven);
        let began = proves && self.all.incarnation(peer) != Some(head.incarnation);
        if proves {
            // Each challenge serves once: what else was answered to it, or will be, proves nothing any more.
            self.draw(peer);
        }
        if began {
            self.all.begin(peer, Life { incarnation: head.incarnation, key, next: hello.next });
        }
        let is_question = hello.answer == 0;
        let may = hello.challenge != 0 && (proves || is_question) && self.may_answer(now_ns, peer);
        // Who has shown that it lives is told that we do, and that is the last word; who has not must show it first.
        let challenge = if is_question { self.all.challenge(peer) } else { 0 };
        let reply = Hello { challenge, answer: hello.challenge, next: self.all.next(peer) };
        Greeted { began, reply_bytes: if may { self.all.hello(peer, key, reply, datagram) } else { None } }
    }

    fn draw(&mut self, peer: NodeIndex) {
        self.all.set_challenge(peer, self.random.next_u64().max(1));
    }

    fn may_answer(&mut self, now_ns: u64, peer: NodeIndex) -> bool {
        let answered = &mut self.answered[usize::from(peer)];
        if now_ns.saturating_sub(answered.since_ns) >= PER_NS {
            *answered = Answered { since_ns: now_ns, times: 0 };
        }
        answered.times += 1;
        answered.times <= ANSWERS_MAX
    }
}
