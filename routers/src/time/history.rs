//! A slave's measurements, and what follows from them: an interval that holds the truth, and the best guess within it.
//!
//! A sample is an interval for `system time − local time`: no frame arrives before it left, in either direction. Each
//! *bucket* of time keeps the narrowest sample, which is the one with the least queueing. (In time slots the bound of
//! each moment matters. So samples are compared as of now, with the drift since they came.) Rate and guess are medians,
//! so single bad samples do not matter. The interval assumes nothing of delays.

use super::{RATE_MAX_PPB, WANDER_PPB_S};

/// Buckets that bound the truth, and the number of the newest that make the guess.
const BUCKETS: usize = 16;
const GUESS_BUCKETS: usize = 8;
const SLOPES: usize = GUESS_BUCKETS * (GUESS_BUCKETS - 1) / 2;
/// A bucket is left out of the guess if its best delay is this many times the best of all, and this much more.
const WAITED_TIMES: i64 = 2;
const WAITED_NS: i64 = 1_000;
/// [`RATE_MAX_PPB`] as a fraction of 1.
pub(super) const RATE_MAX: f64 = RATE_MAX_PPB as f64 * 1e-9;
/// Per nanosecond, so that times a span in ns it is a rate.
const WANDER: f64 = WANDER_PPB_S as f64 * 1e-18;

/// One exchange: `system − local` lay between these when the local clock showed this.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct OffsetSample {
    pub(super) local_ns: u64,
    pub(super) low_ns: i64,
    pub(super) high_ns: i64,
}

impl OffsetSample {
    pub(super) fn width_ns(&self) -> i64 {
        self.high_ns.saturating_sub(self.low_ns)
    }

    fn middle_ns(&self) -> i64 {
        self.low_ns.saturating_add(self.width_ns() / 2)
    }
}

/// What is known of `system − local` at one moment.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Estimate {
    /// The guess, and the interval that holds the truth, ns.
    pub(super) offset_ns: i64,
    pub(super) low_ns: i64,
    pub(super) high_ns: i64,
    /// How much system time is faster than the local clock: the guess, and its interval.
    pub(super) rate: f64,
    pub(super) rate_low: f64,
    pub(super) rate_high: f64,
}

/// The samples of one timeline of one master.
#[derive(Debug)]
pub(super) struct History {
    bucket_ns: u64,
    /// Oldest first; the last is still being filled.
    buckets: Vec<OffsetSample>,
    samples: u32,
    /// How fast a sample widens with age when the narrowest is chosen.
    fade: f64,
}

impl History {
    pub(super) fn new(bucket_ns: u64) -> Self {
        Self { bucket_ns, buckets: Vec::with_capacity(BUCKETS), samples: 0, fade: 0.0 }
    }

    pub(super) fn clear(&mut self) {
        self.buckets.clear();
        self.samples = 0;
    }

    /// Widens samples by this fraction of their age from now on.
    pub(super) fn fades(&mut self, fade: f64) {
        self.fade = fade;
    }

    /// Samples since the last clearing.
    pub(super) fn samples(&self) -> u32 {
        self.samples
    }

    /// Round-trip delay of the best exchange that is kept, ns.
    pub(super) fn delay_ns(&self) -> Option<u64> {
        self.buckets.iter().map(|sample| sample.width_ns().unsigned_abs()).min()
    }

    pub(super) fn add(&mut self, sample: OffsetSample) {
        self.samples = self.samples.saturating_add(1);
        let bucket = sample.local_ns / self.bucket_ns;
        match self.buckets.last_mut() {
            Some(last) if last.local_ns / self.bucket_ns >= bucket => {
                let faded_ns = (self.fade * span_ns(last.local_ns, sample.local_ns)) as i64;
                if sample.width_ns() < last.width_ns().saturating_add(faded_ns) {
                    *last = sample;
                }
            }
            _ => {
                if self.buckets.len() == BUCKETS {
                    self.buckets.remove(0);
                }
                self.buckets.push(sample);
            }
        }
    }

    /// The estimate for a moment that is not before the last sample. None without samples, or when they contradict each
    /// other: then a clock broke its [`LIMITS`](super::LIMITS).
    pub(super) fn estimate(&self, local_ns: u64, usual_rate: f64) -> Option<Estimate> {
        let newest = self.buckets.last()?;
        let (rate_low, rate_high) = self.rate_interval(local_ns)?;
        let (low_ns, high_ns) = self.interval(local_ns, rate_low, rate_high)?;
        let mut recent = [OffsetSample::default(); GUESS_BUCKETS];
        let recent = self.recent(&mut recent);
        let rate = self.slope(recent).unwrap_or(usual_rate).clamp(rate_low, rate_high);
        let mut guesses = [0.0; GUESS_BUCKETS];
        for (guess, sample) in guesses.iter_mut().zip(recent) {
            // Relative to the newest: a double cannot hold the absolute values.
            let middle = sample.middle_ns().saturating_sub(newest.low_ns) as f64;
            *guess = middle + rate * span_ns(sample.local_ns, local_ns);
        }
        let guess_ns = newest.low_ns.saturating_add(median(&mut guesses[..recent.len()]).round() as i64);
        Some(Estimate { offset_ns: guess_ns.clamp(low_ns, high_ns), low_ns, high_ns, rate, rate_low, rate_high })
    }

    /// The newest buckets, without those in which all frames were delayed: these say little of where in their interval
    /// the truth is.
    fn recent<'a>(&self, room: &'a mut [OffsetSample; GUESS_BUCKETS]) -> &'a [OffsetSample] {
        let newest = &self.buckets[self.buckets.len().saturating_sub(GUESS_BUCKETS)..];
        let narrowest_ns = newest.iter().map(OffsetSample::width_ns).min().unwrap_or(0);
        let waited = |sample: &&OffsetSample| {
            sample.width_ns() > narrowest_ns.saturating_mul(WAITED_TIMES).saturating_add(WAITED_NS)
        };
        let mut count = 0;
        for (place, sample) in room.iter_mut().zip(newest.iter().filter(|sample| !waited(sample))) {
            *place = *sample;
            count += 1;
        }
        &room[..count]
    }

    /// Theil and Sen: the median of the slopes between all pairs.
    fn slope(&self, recent: &[OffsetSample]) -> Option<f64> {
        let (mut slopes, mut count) = ([0.0; SLOPES], 0);
        for (at, later) in recent.iter().enumerate() {
            for earlier in &recent[..at] {
                let span = span_ns(earlier.local_ns, later.local_ns);
                // Two samples at one edge between buckets say nothing of the rate.
                if span >= self.bucket_ns as f64 / 2.0 {
                    slopes[count] = later.middle_ns().saturating_sub(earlier.middle_ns()) as f64 / span;
                    count += 1;
                }
            }
        }
        (count > 0).then(|| median(&mut slopes[..count]))
    }

    /// The interval of the rate now: what any two samples allow, and its possible change since.
    fn rate_interval(&self, local_ns: u64) -> Option<(f64, f64)> {
        let (mut rate_low, mut rate_high) = (-RATE_MAX, RATE_MAX);
        for (at, later) in self.buckets.iter().enumerate() {
            for earlier in &self.buckets[..at] {
                let span = span_ns(earlier.local_ns, later.local_ns);
                if span >= 1.0 {
                    let change = WANDER * (span / 2.0 + span_ns(later.local_ns, local_ns));
                    rate_low = rate_low.max(later.low_ns.saturating_sub(earlier.high_ns) as f64 / span - change);
                    rate_high = rate_high.min(later.high_ns.saturating_sub(earlier.low_ns) as f64 / span + change);
                }
            }
        }
        (rate_low <= rate_high).then_some((rate_low, rate_high))
    }

    /// The interval of `system − local` now: what each sample allows, carried forward.
    fn interval(&self, local_ns: u64, rate_low: f64, rate_high: f64) -> Option<(i64, i64)> {
        let (mut low_ns, mut high_ns) = (i64::MIN, i64::MAX);
        for sample in &self.buckets {
            let age = span_ns(sample.local_ns, local_ns);
            let change = WANDER * age / 2.0;
            low_ns =
                low_ns.max(sample.low_ns.saturating_add(((rate_low - change).max(-RATE_MAX) * age).floor() as i64));
            high_ns =
                high_ns.min(sample.high_ns.saturating_add(((rate_high + change).min(RATE_MAX) * age).ceil() as i64));
        }
        (low_ns <= high_ns).then_some((low_ns, high_ns))
    }
}

fn span_ns(earlier_ns: u64, later_ns: u64) -> f64 {
    later_ns.saturating_sub(earlier_ns) as f64
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let half = values.len() / 2;
    if values.len().is_multiple_of(2) { f64::midpoint(values[half - 1], values[half]) } else { values[half] }
}
