//! Measures how fast a connection takes bytes, and limits by that how many of them the kernel buffers: nothing more
//! important can pass them.
//!
//! ```text
//!  full ──── bytes that were taken meanwhile ──── full again          bytes / time = rate, if always wanted
//! ```
//!
//! While the rate is unknown, the limit is small. A connection that takes much more and never fills up counts as fast.

use crate::session::BATCH_BYTES;

/// Limits what the kernel has not sent yet: what leaves in this time.
const UNSENT_NS: u64 = 250_000_000;
/// Limits unsent and unacknowledged bytes together: what leaves in this time or in two round trips. With less than one
/// round trip the limit itself would slow the connection down, more and more; two let it grow.
const HELD_NS: u64 = 1_000_000_000;
const UNSENT_BYTES_MIN: u64 = 4 * 1024;
const UNSENT_BYTES_MAX: u64 = 32 * 1024;
/// Limit while the rate is unknown.
const UNSENT_BYTES_FIRST: u64 = 2 * 1024;
const HELD_BYTES_MIN: u64 = 4 * 1024;
/// Faster connections have as much on the way as the kernel thinks good.
const HELD_BYTES_MAX: u64 = 192 * 1024;
/// For a connection that was limited and is fast again: more than any kernel grants, so the most that this one does.
const HELD_BYTES_FREE: u64 = 64 * 1024 * 1024;
/// Below this rate a byte is acknowledged after a second or more, however little the kernel holds.
const SLOW_BYTES_S: u64 = 64 * 1024;
/// The rate is that over so long, or over a round trip, or over so many bytes: at first a connection takes more than
/// leaves.
const WINDOW_NS: u64 = 500_000_000;
const WINDOW_BYTES: u64 = 256 * 1024;
const SECOND_NS: u128 = 1_000_000_000;

/// Limits of what the kernel holds of a connection.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Holding {
    /// Bytes that have not been sent.
    pub(super) unsent: u64,
    /// Bytes that have not arrived; none: as it likes.
    pub(super) held: Option<u64>,
}

/// Pace of one connection, as measured.
#[derive(Debug)]
pub(super) struct ConnectionPace {
    /// When it was full first, ns; since then it was wanted all the time.
    full_ns: Option<u64>,
    /// Bytes taken since then.
    taken: u64,
    /// Bytes a second.
    rate: Option<u64>,
    /// It holds less than the kernel likes.
    is_bound: bool,
    /// The shortest round trip so far, ns: what waits on a slow line makes later ones longer.
    round_trip_ns: Option<u64>,
    unsent: u64,
}

impl Default for ConnectionPace {
    fn default() -> Self {
        Self { full_ns: None, taken: 0, rate: None, is_bound: false, round_trip_ns: None, unsent: UNSENT_BYTES_FIRST }
    }
}

impl ConnectionPace {
    /// What the kernel may keep before it has sent it.
    pub(super) fn unsent_bytes(&self) -> usize {
        self.unsent as usize
    }

    /// What is made ready at a time; without a rate, as much as usual.
    pub(super) fn batch_bytes(&self) -> usize {
        self.rate.map_or(BATCH_BYTES, |_| self.unsent_bytes())
    }

    /// Whether it is known to take little.
    pub(super) fn is_slow(&self) -> bool {
        self.rate.is_some_and(|rate| rate < SLOW_BYTES_S)
    }

    /// What the kernel takes at a time; none: as much as it likes.
    pub(super) fn piece_bytes(&self) -> Option<usize> {
        (self.unsent < UNSENT_BYTES_MAX).then_some(self.unsent as usize)
    }

    /// A round trip took so long, ns, as far as that is known.
    pub(super) fn set_round_trip(&mut self, took_ns: Option<u64>) {
        self.round_trip_ns = self.round_trip_ns.into_iter().chain(took_ns).min();
    }

    /// Records that the kernel took `bytes`, and whether those were all. Returns the new limits if they change.
    pub(super) fn wrote(&mut self, bytes: usize, is_all: bool, now_ns: impl FnOnce() -> u64) -> Option<Holding> {
        self.taken += bytes as u64;
        if !is_all {
            return self.full(now_ns());
        }
        // Not the connection was too slow.
        self.full_ns = None;
        if self.rate.is_some() || self.unsent == UNSENT_BYTES_MAX || (bytes as u64) <= 2 * self.unsent {
            return None;
        }
        self.unsent = (2 * self.unsent).min(UNSENT_BYTES_MAX);
        Some(Holding { unsent: self.unsent, held: None })
    }

    fn full(&mut self, now_ns: u64) -> Option<Holding> {
        let Some(since_ns) = self.full_ns else {
            (self.full_ns, self.taken) = (Some(now_ns), 0);
            return None;
        };
        let window_ns = now_ns.saturating_sub(since_ns);
        // Within one round what is held may leave all at once.
        if window_ns < self.round_trip_ns.unwrap_or(0).max(WINDOW_NS) && self.taken < WINDOW_BYTES {
            return None;
        }
        let rate = (u128::from(self.taken) * SECOND_NS / u128::from(window_ns.max(1))) as u64;
        (self.full_ns, self.taken) = (Some(now_ns), 0);
        let before = self.rate.replace(rate);
        let has_changed = before.is_none_or(|before| rate.abs_diff(before) > before / 4);
        has_changed.then(|| self.holding(rate))
    }

    fn holding(&mut self, rate: u64) -> Holding {
        let leaving = |ns: u64| (u128::from(rate) * u128::from(ns) / SECOND_NS) as u64;
        let held_ns = self.round_trip_ns.map_or(HELD_NS, |ns| HELD_NS.max(ns.saturating_mul(2)));
        let held = leaving(held_ns).max(HELD_BYTES_MIN);
        let was_bound = std::mem::replace(&mut self.is_bound, held < HELD_BYTES_MAX);
        self.unsent = leaving(UNSENT_NS).clamp(UNSENT_BYTES_MIN, UNSENT_BYTES_MAX);
        let freed = was_bound.then_some(HELD_BYTES_FREE);
        Holding { unsent: self.unsent, held: if self.is_bound { Some(held) } else { freed } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// A connection that is always full, at so many bytes a ms; what it was told last.
    fn run(pace: &mut ConnectionPace, from_ms: u64, ms: u64, bytes_ms: usize) -> Option<Holding> {
        let mut last = None;
        for at in from_ms..from_ms + ms {
            last = pace.wrote(bytes_ms, false, || at * MS).or(last);
        }
        last
    }

    #[test]
    fn what_is_held_follows_the_rate_within_bounds() {
        for (bytes_ms, unsent, held, why) in [
            (8, 4 * 1024, Some(8 * 1024), "64 kbit/s: a second of it, or little more"),
            (1, 4 * 1024, Some(4 * 1024), "never less than a few frames"),
            (60, 15 * 1024, Some(60 * 1024), "half a Mbit/s"),
            (10_000, 32 * 1024, None, "fast: the kernel knows best"),
        ] {
            let mut pace = ConnectionPace::default();
            assert_eq!(pace.batch_bytes(), BATCH_BYTES, "as long as nothing is known");
            let told = run(&mut pace, 0, 2000, bytes_ms).unwrap();
            assert_eq!(
                pace.batch_bytes() as u64,
                told.unsent,
                "what is made ready waits no longer than what is unsent"
            );
            assert!(told.unsent.abs_diff(unsent) < 2048, "{why}: {told:?}");
            assert_eq!(told.held.is_some(), held.is_some(), "{why}: {told:?}");
            assert!(told.held.unwrap_or(0).abs_diff(held.unwrap_or(0)) < 4096, "{why}: {told:?}");
        }
    }

    #[test]
    fn a_connection_is_soon_fast_again_after_a_pause_and_not_slow_for_lack_of_data() {
        let mut pace = ConnectionPace::default();
        run(&mut pace, 0, 2000, 1000);
        // It takes nothing for seven seconds.
        assert!(pace.wrote(0, false, || 9000 * MS).unwrap().unsent < UNSENT_BYTES_MAX / 2);
        run(&mut pace, 9000, 2000, 1000);
        assert!(pace.rate > Some(900_000) && pace.piece_bytes().is_none(), "{pace:?}");
        let mut pace = ConnectionPace::default();
        for at in 0..100 {
            assert_eq!(pace.wrote(10, false, || at * 200 * MS), None, "it had all that there was in between");
            pace.wrote(10, true, || at * 200 * MS);
        }
        assert_eq!(pace.rate, None);
    }

    /// A line that carries so many bytes a ms, so long there and back, of which no more is under way than is held: what
    /// is held at the end.
    fn run_held(bytes_ms: u64, round_trip_ms: u64) -> u64 {
        let (mut pace, mut held) = (ConnectionPace::default(), 8 * 1024);
        pace.set_round_trip(Some(round_trip_ms * MS));
        for round in 0..40 {
            let bytes = held.min(bytes_ms * round_trip_ms);
            let told = pace.wrote(bytes as usize, false, || round * round_trip_ms * MS);
            held = told.and_then(|holding| holding.held).unwrap_or(held);
        }
        held
    }

    #[test]
    fn with_a_long_way_there_and_back_what_is_held_grows_to_what_the_line_carries() {
        for (bytes_ms, round_trip_ms, held, why) in [
            (1000, 2000, HELD_BYTES_FREE, "fast: until the kernel knows best"),
            (20, 2000, 20 * 4000, "slow: what is under way, and as much again"),
            (8, 600, 8 * 1200, "a little more than a second"),
            (8, 50, 8 * 1000, "a second of it"),
        ] {
            let ends = run_held(bytes_ms, round_trip_ms);
            assert!(ends.abs_diff(held) <= held / 4, "{why}: {ends}");
        }
    }

    #[test]
    fn what_was_bound_in_a_pause_is_free_when_it_is_fast_again() {
        let mut pace = ConnectionPace::default();
        run(&mut pace, 0, 2000, 1000);
        let paused = pace.wrote(0, false, || 9000 * MS).unwrap();
        assert!(paused.held.is_some_and(|held| held < HELD_BYTES_MAX), "{paused:?}");
        let again = run(&mut pace, 9000, 2000, 1000).unwrap();
        assert_eq!((again.held, pace.is_bound), (Some(HELD_BYTES_FREE), false));
    }

    #[test]
    fn what_takes_all_at_once_is_fast() {
        let mut pace = ConnectionPace::default();
        let told: Vec<_> = (0..9).filter_map(|_| pace.wrote(65_000, true, || unreachable!())).collect();
        let unsent: Vec<_> = told.iter().map(|holding| holding.unsent).collect();
        assert_eq!((unsent, pace.piece_bytes()), (vec![4096, 8192, 16_384, 32_768], None));
    }
}
