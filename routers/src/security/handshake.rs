//! Finds out by challenge and response which incarnations live. A peer that has not answered takes no state.

use super::hello::Hello;
use super::opening::OpenedHello;
use super::peer_sessions::{PeerIncarnation, PeerSessions};
use crate::frame::{FrameHead, NodeIndex};
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};
use std::sync::Arc;

/// Challenges of one peer answered in [`PER_NS`], at most: replays must stay cheap. If more than half this many came in
/// the period before, a random share is answered.
pub const ANSWERS_MAX: u32 = 10;
/// See [`ANSWERS_MAX`].
pub const PER_NS: u64 = 100_000_000;
/// A challenge is drawn anew so often, ns.
const DRAW_EVERY_NS: u64 = 1_000_000_000;
/// How long a challenge can be answered after it was drawn: a response that was held back proves nothing when it comes.
pub const CHALLENGE_MAX_NS: u64 = 2 * DRAW_EVERY_NS;

/// Takes hellos, in the thread that receives packages.
pub struct Handshake {
    all: Arc<PeerSessions>,
    random: ChaCha20Rng,
    peers: Box<[PeerHandshake]>,
    /// An incarnation that has shown that it lives, and has not begun.
    begins: Option<(NodeIndex, PeerIncarnation)>,
}

#[derive(Clone, Copy, Default)]
struct PeerHandshake {
    /// When the present challenge was drawn, ns.
    drawn_ns: u64,
    /// The challenge before it, and when that was drawn; 0: none.
    before: (u64, u64),
    challenges: ChallengeRate,
}

#[derive(Clone, Copy, Default)]
struct ChallengeRate {
    since_ns: u64,
    came: u32,
    answered: u32,
    /// How many came in the time before.
    came_before: u32,
}

/// What a hello brought about.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct HelloOutcome {
    /// The peer has shown that it lives.
    pub proves: bool,
    /// An incarnation of the peer begins, with [`Handshake::begin`].
    pub begins: bool,
    /// Bytes of the hello to send back, in the buffer.
    pub reply_bytes: Option<usize>,
}

impl Handshake {
    /// There is one. `seed` comes from a source of random numbers that is fit for keys; each incarnation has another.
    pub fn new(all: &Arc<PeerSessions>, seed: [u8; 32]) -> Self {
        let peers = vec![PeerHandshake::default(); all.router.nodes.into()].into();
        let mut handshake = Self { all: all.clone(), random: ChaCha20Rng::from_seed(seed), peers, begins: None };
        (0..all.router.nodes).for_each(|peer| handshake.draw(0, peer));
        handshake
    }

    /// Takes a hello that was opened, if all else in its head is as it must be. `datagram` has room for a hello of
    /// [`HELLO_DATAGRAM_BYTES`](super::HELLO_DATAGRAM_BYTES). If an incarnation begins by it, [`Self::begin`] when the
    /// reply has left.
    pub fn receive(
        &mut self,
        now_ns: u64,
        head: &FrameHead,
        opened: &OpenedHello,
        datagram: &mut [u8],
    ) -> HelloOutcome {
        self.take(now_ns, head, opened, true, datagram)
    }

    /// Takes a hello as [`Self::receive`] does. Of a peer with another digest no incarnation may begin; its challenge
    /// is answered, so that it knows that this node lives, and by which configuration.
    pub(super) fn take(
        &mut self,
        now_ns: u64,
        head: &FrameHead,
        opened: &OpenedHello,
        may_begin: bool,
        datagram: &mut [u8],
    ) -> HelloOutcome {
        self.begin();
        let (peer, OpenedHello { hello, key }) = (head.from, *opened);
        self.refresh(now_ns, peer);
        let proves = self.is_answer(now_ns, peer, hello.answer);
        let begins = may_begin && proves && self.all.incarnation(peer) != Some(head.incarnation);
        if proves {
            // Each challenge serves once: what else was answered to it, or will be, proves nothing any more.
            self.draw(now_ns, peer);
            self.peers[usize::from(peer)].before = (0, 0);
        }
        if begins {
            self.begins = Some((peer, PeerIncarnation { incarnation: head.incarnation, key, next: hello.next }));
        }
        let is_challenge = hello.answer == 0;
        // Only a living peer can answer a challenge, and only once: such replies need no limit.
        let may = hello.challenge != 0 && (proves || is_challenge && self.may_answer(now_ns, peer));
        // A peer that has proved that it lives gets the final response; any other must prove it first.
        let challenge = if is_challenge { self.all.challenge(peer) } else { 0 };
        let reply = Hello { challenge, answer: hello.challenge, next: self.all.next(peer) };
        HelloOutcome { proves, begins, reply_bytes: may.then(|| self.all.hello(peer, key, reply, datagram)) }
    }

    /// Starts the session with the incarnation that proved that it lives, if there is one, and returns its peer. The
    /// reply was handed to the network before: it says from which sequence on we are to be heard, and what left before
    /// it would not be taken.
    pub fn begin(&mut self) -> Option<NodeIndex> {
        let (peer, session) = self.begins.take()?;
        self.all.begin(peer, session);
        Some(peer)
    }

    /// Draws a peer's challenge anew if it is old. To be done before it is asked, or it has less time to answer.
    pub fn refresh(&mut self, now_ns: u64, peer: NodeIndex) {
        let drawn_ns = self.peers[usize::from(peer)].drawn_ns;
        if now_ns.saturating_sub(drawn_ns) >= DRAW_EVERY_NS {
            self.peers[usize::from(peer)].before = (self.all.challenge(peer), drawn_ns);
            self.draw(now_ns, peer);
        }
    }

    fn draw(&mut self, now_ns: u64, peer: NodeIndex) {
        self.peers[usize::from(peer)].drawn_ns = now_ns;
        self.all.set_challenge(peer, self.random.next_u64().max(1));
    }

    /// Whether this answers a challenge of ours that may still be answered.
    fn is_answer(&self, now_ns: u64, peer: NodeIndex, answer: u64) -> bool {
        let (before, drawn_ns) = self.peers[usize::from(peer)].before;
        let is_before = before != 0 && answer == before && now_ns.saturating_sub(drawn_ns) < CHALLENGE_MAX_NS;
        answer == self.all.challenge(peer) || is_before
    }

    /// In a flood each challenge has the same chance, not only the first: one of them may come from a living peer.
    fn may_answer(&mut self, now_ns: u64, peer: NodeIndex) -> bool {
        let challenges = &mut self.peers[usize::from(peer)].challenges;
        let passed_ns = now_ns.saturating_sub(challenges.since_ns);
        if passed_ns >= PER_NS {
            let came_before = if passed_ns < 2 * PER_NS { challenges.came } else { 0 };
            *challenges = ChallengeRate { since_ns: now_ns, came_before, ..ChallengeRate::default() };
        }
        challenges.came = challenges.came.saturating_add(1);
        let share = ANSWERS_MAX / 2;
        let is_drawn = challenges.came_before <= share || self.random.next_u32() % challenges.came_before < share;
        let may = is_drawn && challenges.answered < ANSWERS_MAX;
        challenges.answered += u32::from(may);
        may
    }
}
