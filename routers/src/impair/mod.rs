//! A bad network between a router and its socket, from a seed: loss, delay, jitter, duplicates, changed order, a slow
//! line, changed bits. And what the same network is to a stream: a [`BandwidthQueue`].
//!
//! ```text
//!  push ──▶ lost? ──▶ line of `rate` ──▶ delay ± jitter ──▶ held back? ──▶ changed bit? ──▶ due, in order of time ──▶ poll
//!                                                                            └─ duplicated? ──▶ once more, a little later
//! ```
//!
//! Each fault can be had alone: jitter never changes the order (as queues of switches do not), only `reorder` does.
//! What is drawn for a datagram depends on the seed, the stream and how many came before it, not on the time or on
//! other faults: raising the loss leaves the same datagrams late. The kernel's netem does the same where it exists;
//! this is everywhere, and in the simulator too.

mod bandwidth_queue;
mod text;

pub use bandwidth_queue::BandwidthQueue;
pub use text::ImpairmentSettingsError;

use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::Duration;

/// Names the settings to a router; empty or missing: none.
pub const ENVIRONMENT: &str = "ROHRPOST_IMPAIR";
/// Datagrams that are on their way at once, and their bytes; what comes then is lost, and counted `full`.
pub const DATAGRAMS_MAX: usize = 4096;
/// See [`DATAGRAMS_MAX`].
pub const BYTES_MAX: usize = 16 << 20;
/// No delay or jitter is longer.
pub const DELAY_MAX: Duration = Duration::from_secs(10);

/// Longest extra delay of what is held back or duplicated; twice the delay, if that is longer.
const LATER_NS: u64 = 2_000_000;

/// Probability that something happens to a datagram, in millionths.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Probability(u32);

impl Probability {
    /// All of them, in millionths.
    pub const ALL: u32 = 1_000_000;

    /// This many in a million; more than [`ALL`](Self::ALL) is all.
    pub const fn per_million(millionths: u32) -> Self {
        Self(if millionths > Self::ALL { Self::ALL } else { millionths })
    }

    fn holds(self, drawn: u32) -> bool {
        (u64::from(drawn) * u64::from(Self::ALL)) >> 32 < u64::from(self.0)
    }
}

/// How bad the network is. The text form, `loss=5%,delay=2ms,seed=7`, has each key at most once, in any order; see
/// [`ImpairmentSettings::from_str`].
///
/// ```
/// # use rohrpost_routers::impair::ImpairmentSettings;
/// let settings: ImpairmentSettings = "loss=5%,delay=2ms,jitter=1ms,rate=10MiB,seed=7".parse().unwrap();
/// assert_eq!(settings.to_string(), "loss=5%,delay=2ms,jitter=1ms,rate=10MiB,seed=7");
/// let wrong = "loss=5".parse::<ImpairmentSettings>().unwrap_err();
/// assert_eq!(wrong.to_string(), "`loss=5`: write a share from 0% to 100%, such as loss=5%");
/// ```
///
/// [`ImpairmentSettings::from_str`]: std::str::FromStr::from_str
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ImpairmentSettings {
    /// Never arrive.
    pub loss: Probability,
    /// How long all are on their way, on top of the real one.
    pub delay: Duration,
    /// More or less than that, evenly spread; never less than nothing.
    pub jitter: Duration,
    /// Arrive twice.
    pub duplicate: Probability,
    /// Are held back, so that later ones go before them.
    pub reorder: Probability,
    /// Bytes a second that the line carries; others wait.
    pub rate_bytes_s: Option<u64>,
    /// Have one bit changed.
    pub corrupt: Probability,
    /// What is drawn follows from it.
    pub seed: u64,
}

impl Default for ImpairmentSettings {
    fn default() -> Self {
        Self {
            loss: Probability::default(),
            delay: Duration::ZERO,
            jitter: Duration::ZERO,
            duplicate: Probability::default(),
            reorder: Probability::default(),
            rate_bytes_s: None,
            corrupt: Probability::default(),
            seed: 1,
        }
    }
}

impl ImpairmentSettings {
    /// When the line has sent so many bytes that it began then.
    fn sent_ns(&self, begin_ns: u64, bytes: usize) -> u64 {
        let Some(rate) = self.rate_bytes_s else { return begin_ns };
        let takes_ns = u128::from(bytes as u64) * 1_000_000_000 / u128::from(rate.max(1));
        begin_ns.saturating_add(u64::try_from(takes_ns).unwrap_or(u64::MAX))
    }

    fn delay_ns(&self, drawn: u32) -> u64 {
        let (delay, jitter) = (nanos(self.delay), nanos(self.jitter));
        (delay + part(2 * jitter, drawn)).saturating_sub(jitter)
    }

    fn later_ns(&self, drawn: u32) -> u64 {
        1 + part(LATER_NS.max(2 * nanos(self.delay)), drawn)
    }
}

/// What became of the datagrams so far. Pushed + duplicated = passed + lost + full + those still on their way.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ImpairmentCounts {
    /// Given to [`Impairment::push`].
    pub pushed: u64,
    /// Given out by [`Impairment::poll`].
    pub passed: u64,
    /// Lost as the settings say.
    pub lost: u64,
    /// Lost because too many were on their way.
    pub full: u64,
    /// Duplicates made.
    pub duplicated: u64,
    /// Held back.
    pub held_back: u64,
    /// Changed.
    pub corrupted: u64,
}

/// Next step, from [`Impairment::poll`].
#[derive(PartialEq, Eq, Debug)]
pub enum ImpairmentStep<'a, T> {
    /// This one has arrived; ask again.
    Send {
        /// Where it was to go.
        to: T,
        /// Its bytes.
        datagram: &'a [u8],
    },
    /// Nothing until this time, [`u64::MAX`] if none is on its way.
    Wait {
        /// By the clock of the caller.
        until_ns: u64,
    },
}

/// Datagrams on a bad way. `T` says where each is to go.
pub struct Impairment<T> {
    settings: ImpairmentSettings,
    random: ChaCha8Rng,
    /// When the line has sent what it was given.
    line_free_ns: u64,
    /// When the last one arrives that is not held back.
    last_due_ns: u64,
    on_way: BinaryHeap<Reverse<(u64, u64, usize)>>,
    /// Ones that are due at the same time keep their order.
    count: u64,
    slots: Vec<PoolEntry<T>>,
    free: Vec<usize>,
    bytes: usize,
    counts: ImpairmentCounts,
}

struct PoolEntry<T> {
    to: Option<T>,
    datagram: Vec<u8>,
}

/// All that is drawn for one datagram, whether it is needed or not.
struct Drawn {
    loss: u32,
    duplicate: u32,
    reorder: u32,
    corrupt: u32,
    jitter: u32,
    later: u32,
    copy_later: u32,
    bit: u32,
}

impl Drawn {
    fn new(random: &mut ChaCha8Rng) -> Self {
        let [loss, duplicate, reorder, corrupt, jitter, later, copy_later, bit] =
            std::array::from_fn(|_| random.next_u32());
        Self { loss, duplicate, reorder, corrupt, jitter, later, copy_later, bit }
    }
}

/// A part of `whole` as large as `drawn` is of all that can be drawn.
fn part(whole: u64, drawn: u32) -> u64 {
    ((u128::from(whole) * u128::from(drawn)) >> 32) as u64
}

impl<T: Clone> Impairment<T> {
    /// `stream` tells users of one seed apart: each socket of each node has its own, or all would lose the same
    /// datagrams.
    pub fn new(settings: ImpairmentSettings, stream: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
        random.set_stream(stream);
        Self {
            settings,
            random,
            line_free_ns: 0,
            last_due_ns: 0,
            on_way: BinaryHeap::new(),
            count: 0,
            slots: Vec::new(),
            free: Vec::new(),
            bytes: 0,
            counts: ImpairmentCounts::default(),
        }
    }

    /// Takes a datagram; a copy of it is given out later, or not.
    pub fn push(&mut self, now_ns: u64, to: T, datagram: &[u8]) {
        self.counts.pushed += 1;
        let drawn = Drawn::new(&mut self.random);
        if self.settings.loss.holds(drawn.loss) {
            self.counts.lost += 1;
            return;
        }
        self.line_free_ns = self.settings.sent_ns(self.line_free_ns.max(now_ns), datagram.len());
        let due_ns = self.line_free_ns.saturating_add(self.settings.delay_ns(drawn.jitter));
        let mut due_ns = due_ns.max(self.last_due_ns);
        self.last_due_ns = due_ns;
        if self.settings.reorder.holds(drawn.reorder) {
            self.counts.held_back += 1;
            due_ns = due_ns.saturating_add(self.settings.later_ns(drawn.later));
        }
        let bit = self.settings.corrupt.holds(drawn.corrupt).then_some(drawn.bit);
        if self.settings.duplicate.holds(drawn.duplicate) {
            self.counts.duplicated += 1;
            let copy_due_ns = due_ns.saturating_add(self.settings.later_ns(drawn.copy_later));
            self.hold(copy_due_ns, to.clone(), datagram, None);
        }
        self.hold(due_ns, to, datagram, bit);
    }

    /// The next that has arrived by now, or when to ask again.
    pub fn poll(&mut self, now_ns: u64) -> ImpairmentStep<'_, T> {
        loop {
            let Some(Reverse((due_ns, _, index))) = self.on_way.peek().copied() else {
                return ImpairmentStep::Wait { until_ns: u64::MAX };
            };
            if due_ns > now_ns {
                return ImpairmentStep::Wait { until_ns: due_ns };
            }
            self.on_way.pop();
            self.free.push(index);
            // The slot is free, and keeps its bytes until the next push.
            let Some(to) = self.slots[index].to.take() else { continue };
            let datagram = &self.slots[index].datagram;
            self.bytes -= datagram.len();
            self.counts.passed += 1;
            return ImpairmentStep::Send { to, datagram };
        }
    }

    /// What became of all so far.
    pub fn counts(&self) -> ImpairmentCounts {
        self.counts
    }

    /// Datagrams on their way.
    pub fn on_way(&self) -> usize {
        self.on_way.len()
    }

    /// Keeps a copy until it is due, with a bit changed if one is named.
    fn hold(&mut self, due_ns: u64, to: T, datagram: &[u8], bit: Option<u32>) {
        if self.on_way.len() == DATAGRAMS_MAX || self.bytes + datagram.len() > BYTES_MAX {
            self.counts.full += 1;
            return;
        }
        let index = self.free.pop().unwrap_or_else(|| {
            self.slots.push(PoolEntry { to: None, datagram: Vec::new() });
            self.slots.len() - 1
        });
        let slot = &mut self.slots[index];
        slot.to = Some(to);
        slot.datagram.clear();
        slot.datagram.extend_from_slice(datagram);
        if let Some(bit) = bit.filter(|_| !datagram.is_empty()) {
            let at = part(8 * datagram.len() as u64, bit) as usize;
            slot.datagram[at / 8] ^= 1 << (at % 8);
            self.counts.corrupted += 1;
        }
        self.bytes += datagram.len();
        self.on_way.push(Reverse((due_ns, self.count, index)));
        self.count += 1;
    }
}

/// Durations of the settings are at most [`DELAY_MAX`].
fn nanos(duration: Duration) -> u64 {
    duration.min(DELAY_MAX).as_nanos() as u64
}

#[cfg(test)]
mod tests;
