//! One way of a stream through a bad network: all bytes arrive, in their order, but late.
//!
//! ```text
//!  push ──▶ segments ──▶ line of `rate` ──▶ delay ± jitter ──▶ lost? sent again, later each time ──▶ in order ──▶ arrived
//! ```
//!
//! A segment that is lost, or changed, is sent again after a retransmission time, and what is behind it waits with it.
//! One that is held back makes the others wait as well. Copies are nothing to a stream.

use super::{BYTES_MAX, Drawn, ImpairmentSettings, nanos};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;

/// Size of a segment, bytes.
const SEGMENT_BYTES: usize = 1448;
/// A segment is sent again after this time and the round trip; after twice that the next time, and so on.
const SENT_AGAIN_NS: u64 = 200_000_000;
/// Retransmissions at most: nobody waits longer for a stream.
const TRIES_MAX: u32 = 16;
/// Limit of what waits to be sent: what leaves in this time, and no less than a segment.
const WAITS_NS: u64 = 20_000_000;

/// Bytes on their way.
pub struct BandwidthQueue {
    settings: ImpairmentSettings,
    random: ChaCha8Rng,
    /// When the line has sent what it was given.
    free_ns: u64,
    /// Segments: when each arrives, and its bytes.
    on_way: VecDeque<(u64, usize)>,
    last_due_ns: u64,
    bytes: VecDeque<u8>,
    /// How many of these have arrived.
    arrived: usize,
}

impl BandwidthQueue {
    /// `stream` tells users of one seed apart.
    pub fn new(settings: ImpairmentSettings, stream: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
        random.set_stream(stream);
        let (on_way, bytes) = (VecDeque::new(), VecDeque::new());
        Self { settings, random, free_ns: 0, on_way, last_due_ns: 0, bytes, arrived: 0 }
    }

    /// Bytes that it takes now; the sender keeps the rest.
    pub fn room(&self, now_ns: u64) -> usize {
        let kept = BYTES_MAX.saturating_sub(self.bytes.len());
        let Some(rate) = self.settings.rate_bytes_s else { return kept };
        let waits_ns = self.free_ns.saturating_sub(now_ns);
        if waits_ns >= WAITS_NS {
            return 0;
        }
        let bytes = u128::from(rate) * u128::from(WAITS_NS - waits_ns) / 1_000_000_000;
        kept.min(SEGMENT_BYTES.max(usize::try_from(bytes).unwrap_or(usize::MAX)))
    }

    /// Takes bytes.
    pub fn push(&mut self, now_ns: u64, bytes: &[u8]) {
        for segment in bytes.chunks(SEGMENT_BYTES) {
            self.free_ns = self.settings.sent_ns(self.free_ns.max(now_ns), segment.len());
            let drawn = Drawn::new(&mut self.random);
            let mut due_ns = self.free_ns.saturating_add(self.settings.delay_ns(drawn.jitter));
            if self.settings.reorder.holds(drawn.reorder) {
                due_ns = due_ns.saturating_add(self.settings.later_ns(drawn.later));
            }
            due_ns = due_ns.saturating_add(self.again_ns(&drawn)).max(self.last_due_ns);
            self.last_due_ns = due_ns;
            self.on_way.push_back((due_ns, segment.len()));
            self.bytes.extend(segment);
        }
    }

    /// How much later a segment arrives because it did not at once, ns.
    fn again_ns(&mut self, first: &Drawn) -> u64 {
        let ImpairmentSettings { loss, corrupt, delay, .. } = self.settings;
        let fails = |drawn: &Drawn| loss.holds(drawn.loss) || corrupt.holds(drawn.corrupt);
        let (mut fails_now, mut later_ns) = (fails(first), 0);
        for tries in 0..TRIES_MAX {
            if !fails_now {
                break;
            }
            later_ns += (SENT_AGAIN_NS + 2 * nanos(delay)) << tries;
            fails_now = fails(&Drawn::new(&mut self.random));
        }
        later_ns
    }

    /// What has arrived by now and was not taken out.
    pub fn arrived(&mut self, now_ns: u64) -> &[u8] {
        while let Some((_, bytes)) = self.on_way.pop_front_if(|(due_ns, _)| *due_ns <= now_ns) {
            self.arrived += bytes;
        }
        let (front, _) = self.bytes.as_slices();
        &front[..self.arrived.min(front.len())]
    }

    /// Takes out so many bytes of what has arrived.
    pub fn took(&mut self, bytes: usize) {
        self.arrived -= bytes;
        self.bytes.drain(..bytes);
    }

    /// Whether nothing is on its way.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// When more arrives, or there is room again.
    pub fn until_ns(&self, now_ns: u64) -> u64 {
        let due_ns = self.on_way.front().map_or(u64::MAX, |(due_ns, _)| *due_ns);
        let room_ns = self.free_ns.saturating_sub(WAITS_NS) + 1;
        if room_ns > now_ns { due_ns.min(room_ns) } else { due_ns }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Sends so many bytes as fast as they are taken: what arrives, and when the last does.
    fn carry(text: &str, bytes: usize) -> (Vec<u8>, u64) {
        let mut line = BandwidthQueue::new(text.parse().unwrap(), 0);
        let all: Vec<u8> = (0..bytes).map(|at| (at / 7) as u8).collect();
        let (mut sent, mut came, mut now_ns) = (0, Vec::new(), 0);
        while came.len() < bytes {
            let count = line.room(now_ns).min(bytes - sent);
            line.push(now_ns, &all[sent..sent + count]);
            sent += count;
            let arrived = line.arrived(now_ns).to_vec();
            line.took(arrived.len());
            came.extend(&arrived);
            if arrived.is_empty() {
                let until_ns = line.until_ns(now_ns);
                assert!(until_ns > now_ns && until_ns < u64::MAX, "something is on its way, at {now_ns}: {until_ns}");
                now_ns = until_ns;
            }
        }
        assert!(line.is_empty());
        assert_eq!(came, all, "all of it, in its order");
        (came, now_ns)
    }

    #[test]
    fn all_arrives_in_order_and_as_late_as_the_network_makes_it() {
        for (text, bytes, least_ms, most_ms, why) in [
            ("", 1 << 20, 0, 0, "nothing is in its way"),
            ("delay=30ms", 1 << 20, 30, 30, "all of it at once"),
            ("delay=30ms,jitter=10ms", 1 << 20, 35, 40, "as late as the latest in front"),
            ("rate=100KiB", 100 << 10, 999, 1001, "what the line carries"),
            ("rate=100KiB,delay=50ms", 100 << 10, 1049, 1051, "both"),
            ("loss=1%,seed=3", 1 << 20, 200, 1500, "sent again, most of them once, all at the same time"),
            ("corrupt=1%,seed=3", 1 << 20, 200, 1500, "a sum is wrong, and it is sent again"),
            ("reorder=5%,seed=3", 1 << 20, 1, 2, "the others wait for what was held back"),
            ("duplicate=50%", 1 << 20, 0, 0, "duplicates are dropped"),
        ] {
            let (_, took_ns) = carry(text, bytes);
            assert!((least_ms * MS..=most_ms * MS).contains(&took_ns), "{text}: {took_ns} ns: {why}");
        }
    }

    #[test]
    fn what_is_behind_a_lost_segment_waits_for_it() {
        // The fourth of these is lost first.
        let mut line = BandwidthQueue::new("loss=20%,delay=10ms,seed=1".parse().unwrap(), 0);
        let mut due = Vec::new();
        for at in 0..20 {
            line.push(at * MS, &[at as u8; 100]);
            due.push(line.last_due_ns);
        }
        assert!(due.is_sorted());
        let stalls = due.iter().zip(0..).filter(|(due_ns, at)| **due_ns > (at + 10) * MS).count();
        assert!((1..20).contains(&stalls), "{stalls} of 20");
    }

    #[test]
    fn a_line_that_carries_nothing_takes_no_more_than_waits_for_it() {
        let mut line = BandwidthQueue::new("rate=10KiB".parse().unwrap(), 0);
        assert_eq!(line.room(0), SEGMENT_BYTES);
        line.push(0, &[0; SEGMENT_BYTES]);
        assert_eq!(line.room(0), 0);
        let mut dead = BandwidthQueue::new("loss=100%".parse().unwrap(), 0);
        dead.push(0, &[1; 10]);
        assert_eq!(dead.arrived(3600 * 1000 * MS), [0; 0], "not in an hour");
    }
}
