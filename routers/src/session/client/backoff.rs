//! When to try again: soon at first, then less often, and never all clients at once.

/// The longest first wait.
const FIRST_NS: u64 = 100_000_000;
/// The longest wait.
pub const BACKOFF_MAX_NS: u64 = 2_000_000_000;
const DOUBLINGS_MAX: u32 = 16;

/// Delay before the next connection of one client.
#[derive(Clone, Debug)]
pub(super) struct Backoff {
    failures: u32,
    chance: u64,
}

impl Backoff {
    /// Clients with different seeds wait differently long.
    pub(super) fn new(seed: u64) -> Self {
        Self { failures: 0, chance: seed }
    }

    /// A connection lasted.
    pub(super) fn lasted(&mut self) {
        self.failures = 0;
    }

    /// It will not help to be quick.
    pub(super) fn hopeless(&mut self) {
        self.failures = DOUBLINGS_MAX;
    }

    /// A connection failed: wait so long, ns. From half of what doubles each time to all of it.
    pub(super) fn next_ns(&mut self) -> u64 {
        let longest_ns = (FIRST_NS << self.failures).min(BACKOFF_MAX_NS);
        self.failures = (self.failures + 1).min(DOUBLINGS_MAX);
        longest_ns / 2 + self.draw() % (longest_ns / 2)
    }

    /// SplitMix64: good enough for waits, and without state to share.
    fn draw(&mut self) -> u64 {
        self.chance = self.chance.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.chance ^ (self.chance >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_a_limit_and_differ_between_clients() {
        let waits = |seed| {
            let mut backoff = Backoff::new(seed);
            let mut longest_ns = FIRST_NS;
            let one = |_| {
                let wait_ns = backoff.next_ns();
                assert!((longest_ns / 2..longest_ns).contains(&wait_ns), "{wait_ns} of {longest_ns}");
                longest_ns = (2 * longest_ns).min(BACKOFF_MAX_NS);
                wait_ns
            };
            (0..40).map(one).collect::<Vec<_>>()
        };
        assert_ne!(waits(1), waits(2));
        let mut backoff = Backoff::new(3);
        backoff.hopeless();
        assert!(backoff.next_ns() >= BACKOFF_MAX_NS / 2);
        backoff.lasted();
        assert!(backoff.next_ns() <= FIRST_NS);
    }
}
