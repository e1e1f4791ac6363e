//! The challenges of this router: random numbers that others repeat, each for a short time.

use rand::Rng;
use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::SeedableRng;

/// A challenge is said for so long, and then another one; so long again its echo proves something.
const CHALLENGE_NS: u64 = 5_000_000_000;

/// The present challenge and the one before.
pub(super) struct Challenges {
    random: ChaCha20Rng,
    present: u64,
    before: u64,
    since_ns: u64,
}

impl Challenges {
    pub(super) fn new(seed: [u8; 32], now_ns: u64) -> Self {
        let mut random = ChaCha20Rng::from_seed(seed);
        let (present, before) = (random.random(), random.random());
        Self { random, present, before, since_ns: now_ns }
    }

    /// The challenge to say now.
    pub(super) fn present(&mut self, now_ns: u64) -> u64 {
        self.renew(now_ns);
        self.present
    }

    /// Whether an echo shows that its sender has lived since a short time ago.
    pub(super) fn proves(&mut self, now_ns: u64, echo: u64) -> bool {
        self.renew(now_ns);
        echo == self.present || echo == self.before
    }

    /// A random time below `most_ns`: beats of several systems are not to meet.
    pub(super) fn jitter(&mut self, most_ns: u64) -> u64 {
        self.random.random_range(0..most_ns)
    }

    fn renew(&mut self, now_ns: u64) {
        let age_ns = now_ns.saturating_sub(self.since_ns);
        if age_ns < CHALLENGE_NS {
            return;
        }
        let next = self.random.random();
        // One that was not said for long proves nothing any more.
        self.before = if age_ns < 2 * CHALLENGE_NS { self.present } else { self.random.random() };
        (self.present, self.since_ns) = (next, now_ns);
    }
}
