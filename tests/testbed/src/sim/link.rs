//! One direction between two computers: what it loses, delays, copies, reorders and damages.

use super::chance::Chance;
use super::spans::WIRE_NS_MAX;

/// How a link treats datagrams. Shares are of a million.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Quality {
    /// Shortest way, ns.
    pub delay_ns: u64,
    /// Added by chance, up to so much, ns; alone it reorders nothing.
    pub jitter_ns: u64,
    /// Lost.
    pub loss_ppm: u32,
    /// Sent twice.
    pub copy_ppm: u32,
    /// Reordered: delayed by up to ten times delay and jitter.
    pub reorder_ppm: u32,
    /// Bits flipped.
    pub damage_ppm: u32,
    /// Bytes a second; 0: no limit.
    pub rate_bytes_s: u64,
}

impl Quality {
    /// What comes out at all has been on its way for so long at most, ns.
    pub(crate) fn way_ns_max(&self) -> u64 {
        let way_ns = self.delay_ns + self.jitter_ns;
        let reordered_ns = if self.reorder_ppm > 0 { (11 * way_ns).min(WIRE_NS_MAX / 2) } else { 0 };
        way_ns.max(reordered_ns) + if self.rate_bytes_s > 0 { WAIT_NS_MAX } else { 0 }
    }
}

/// Before a link with a rate a datagram waits so long at most; else it is lost.
const WAIT_NS_MAX: u64 = WIRE_NS_MAX / 2;

/// What becomes of a datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Passage {
    /// When it comes out, true ns.
    pub at_ns: u64,
    /// Whether bits of it were flipped on the way.
    pub damaged: bool,
}

/// A direction with its present state.
#[derive(Clone, Debug)]
pub struct Link {
    /// How it is now.
    pub quality: Quality,
    /// How many faults cut it now.
    pub cuts: u32,
    free_at_ns: u64,
    last_at_ns: u64,
}

impl Link {
    /// A link that is whole.
    pub fn new(quality: Quality) -> Self {
        Self { quality, cuts: 0, free_at_ns: 0, last_at_ns: 0 }
    }

    /// Where a datagram comes out: never, once, or twice.
    pub fn pass(&mut self, now_ns: u64, bytes: usize, chance: &mut Chance) -> [Option<Passage>; 2] {
        let quality = self.quality;
        if self.cuts > 0 || chance.per_million(quality.loss_ppm) {
            return [None, None];
        }
        let left_ns = match quality.rate_bytes_s {
            0 => now_ns,
            rate => {
                let begin_ns = self.free_at_ns.max(now_ns);
                if begin_ns - now_ns > WAIT_NS_MAX {
                    return [None, None];
                }
                self.free_at_ns = begin_ns + bytes as u64 * 1_000_000_000 / rate;
                self.free_at_ns
            }
        };
        let first = self.arrival(left_ns, chance);
        let second = chance.per_million(quality.copy_ppm).then(|| self.arrival(left_ns, chance));
        [Some(first), second]
    }

    fn arrival(&mut self, left_ns: u64, chance: &mut Chance) -> Passage {
        let quality = self.quality;
        let at_ns = left_ns + quality.delay_ns + chance.below(quality.jitter_ns + 1);
        let damaged = chance.per_million(quality.damage_ppm);
        if chance.per_million(quality.reorder_ppm) {
            let behind_ns = chance.below(10 * (quality.delay_ns + quality.jitter_ns) + 1);
            return Passage { at_ns: (at_ns + behind_ns).min(left_ns + WIRE_NS_MAX / 2), damaged };
        }
        self.last_at_ns = self.last_at_ns.max(at_ns);
        Passage { at_ns: self.last_at_ns, damaged }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Quality = Quality {
        delay_ns: 1000,
        jitter_ns: 0,
        loss_ppm: 0,
        copy_ppm: 0,
        reorder_ppm: 0,
        damage_ppm: 0,
        rate_bytes_s: 0,
    };

    fn passed(quality: Quality, count: u64) -> Vec<Passage> {
        let (mut link, mut chance) = (Link::new(quality), Chance::new(3));
        (0..count).flat_map(|n| link.pass(n, 100, &mut chance)).flatten().collect()
    }

    #[test]
    fn a_link_does_what_its_quality_says() {
        assert_eq!(passed(PLAIN, 3).iter().map(|p| p.at_ns).collect::<Vec<_>>(), [1000, 1001, 1002]);
        let lossy = passed(Quality { loss_ppm: 100_000, ..PLAIN }, 10_000).len();
        assert!((8800..9200).contains(&lossy), "{lossy}");
        let copied = passed(Quality { copy_ppm: 100_000, ..PLAIN }, 10_000).len();
        assert!((10_800..11_200).contains(&copied), "{copied}");
        let slow = passed(Quality { rate_bytes_s: 1_000_000, ..PLAIN }, 5);
        assert_eq!(slow.last().map(|p| p.at_ns), Some(500_000 + 1000), "a byte a microsecond");
        let jitter = passed(Quality { jitter_ns: 50_000, ..PLAIN }, 1000);
        assert!(jitter.is_sorted_by_key(|p| p.at_ns), "jitter alone reorders nothing");
        assert!(!passed(Quality { reorder_ppm: 50_000, ..PLAIN }, 1000).is_sorted_by_key(|p| p.at_ns));
    }

    #[test]
    fn nothing_passes_a_cut_link() {
        let mut link = Link::new(PLAIN);
        link.cuts = 1;
        assert_eq!(link.pass(0, 1, &mut Chance::new(0)), [None, None]);
    }
}
