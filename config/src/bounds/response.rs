//! How long a package of a stream waits and takes at worst: response-time analysis of one node.
//!
//! ```text
//!        ▼ published just after this slot took what it sends
//!  ──┬───────────┬───────────────────────┬───────────┬───────────────────────┬───────────┬──
//!    │ slot v    │                       │ slot v+1  │                       │ slot v+2  │
//!  ──┴───────────┴───────────────────────┴───────────┴───────────────────────┴───────────┴──
//!                                         ███ ▓▓▓▓▓░░                         ██ ▒▒▒
//!                           said by routers ┘   │   └ the next head does not fit   └ the package
//!                                  ahead of it ─┘
//! ```
//!
//! A *chain* is a series of slots each of which leaves something of what it found. Before it comes slot v, which left nothing; so whatever
//! is ahead of our package was published after slot v took what it sends. A slot of a chain carries at least its room less the largest
//! datagram (and one ns): had it carried less, the head that ended it would have fitted. The chain ends with the slot that has room for all that
//! is left and our package. Which slot was v, and how long after it our package was published, are tried out.

use super::mistakes::mistake;

/// What slots of a node have room for, over and over.
#[derive(Clone, Debug)]
pub(crate) struct Supply {
    /// By their beginning; none overlaps the next.
    pub(crate) windows: Vec<Window>,
    /// From one round of them to the next, ns.
    pub(crate) repeats_ns: u64,
    /// Taken at the beginning of each slot by what routers say to each other, ns.
    pub(crate) said_ns: u64,
    /// What is published less than this before a slot may miss it, ns.
    pub(crate) taken_before_ns: u64,
    /// A slot may be begun so late, ns.
    pub(crate) late_ns: u64,
}

/// One slot of a round.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Window {
    /// From the beginning of the round, ns.
    pub(crate) begin_ns: u64,
    /// Up to its guard, ns.
    pub(crate) sends_ns: u64,
    /// Its place in [`Tdma::slots`](crate::Tdma::slots).
    pub(crate) slot: usize,
}

/// Packages that come no faster than one a period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stream {
    pub(crate) period_ns: u64,
    /// What one takes, see [`Parcel`](crate::wire::Parcel).
    pub(crate) takes_ns: u64,
    pub(crate) largest_ns: u64,
    pub(crate) end_ns: u64,
    pub(crate) last_ns: u64,
}

/// How other packages stand to ours.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Ahead {
    /// They go first, even those that are published later.
    Always,
    /// Those go first that are published before.
    Earlier,
}

/// The worst that can happen to a package.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Worst {
    /// From its publishing to the end of its last datagram, ns.
    pub(crate) latency_ns: u64,
    /// Up to the beginning of the slot in which it ends, ns.
    pub(crate) waits_ns: u64,
    /// Which window of the round that is.
    pub(crate) window: usize,
    /// How many slots began while it waited, this one included.
    pub(crate) slots: u64,
    /// What of others went before it since slot v, ns.
    pub(crate) others_ns: u64,
    /// How many packages of its own stream went before it.
    pub(crate) own_earlier: u64,
}

/// Why there is no worst.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Never {
    /// No slot has room for one of its datagrams, or of those before it.
    TooShort,
    /// More comes than leaves; both in ns a second.
    TooMuch {
        /// Comes.
        asked_ns_s: u64,
        /// Leaves.
        carried_ns_s: u64,
    },
    /// It takes longer than any package may wait.
    TooLong,
}

impl Supply {
    fn begin_ns(&self, index: usize) -> u64 {
        let round = index / self.windows.len();
        // One round ahead, so that what is taken before the first slot is no negative time.
        (round as u64 + 1) * self.repeats_ns + self.windows[index % self.windows.len()].begin_ns
    }

    /// Up to this time, what is published is found by a slot.
    fn takes_until_ns(&self, index: usize) -> u64 {
        self.begin_ns(index).saturating_sub(self.taken_before_ns)
    }

    fn sends_ns(&self, index: usize) -> u64 {
        self.windows[index % self.windows.len()].sends_ns
    }

    /// Time for packages.
    fn room_ns(&self, index: usize) -> u64 {
        let said_ns = if mistake!(SaysNothing) { 0 } else { self.said_ns + self.late_ns };
        self.sends_ns(index).saturating_sub(said_ns)
    }
}

/// The worst for a package of a stream beside others of the same node; none waits longer than `longest_ns`.
pub(crate) fn worst(
    supply: &Supply,
    own: &Stream,
    others: &[(Stream, Ahead)],
    longest_ns: u64,
) -> Result<Worst, Never> {
    let analysis = Analysis { supply, own, others, longest_ns };
    analysis.judge()?;
    let mut worst: Option<Worst> = None;
    let firsts = if mistake!(OneSlotFirst) { 1 } else { supply.windows.len() };
    for first in 0..firsts {
        let found = analysis.after(first)?;
        worst = Some(worst.filter(|worst| worst.latency_ns >= found.latency_ns).unwrap_or(found));
    }
    worst.ok_or(Never::TooShort)
}

struct Analysis<'a> {
    supply: &'a Supply,
    own: &'a Stream,
    others: &'a [(Stream, Ahead)],
    longest_ns: u64,
}

impl Analysis<'_> {
    fn streams(&self) -> impl Iterator<Item = &Stream> {
        self.others.iter().map(|(stream, _)| stream).chain([self.own])
    }

    /// What a slot of a chain carries at least.
    fn carries_ns(&self, index: usize) -> u64 {
        if mistake!(WastesNothing) {
            return self.supply.room_ns(index);
        }
        let largest_ns = self.streams().map(|stream| stream.largest_ns).max().unwrap_or(0);
        self.supply.room_ns(index).saturating_sub(largest_ns - 1)
    }

    /// Whether all that comes can leave in the long run.
    fn judge(&self) -> Result<(), Never> {
        let count = self.supply.windows.len();
        let carried_ns: u64 = (0..count).map(|index| self.carries_ns(index)).sum();
        if carried_ns == 0 {
            return Err(Never::TooShort);
        }
        let a_second = |ns: u64, period_ns: u64| (u128::from(ns) * 1_000_000_000 / u128::from(period_ns)) as u64;
        let asked_ns_s = self.streams().map(|stream| a_second(stream.takes_ns, stream.period_ns)).sum();
        let carried_ns_s = a_second(carried_ns, self.supply.repeats_ns);
        if asked_ns_s >= carried_ns_s { Err(Never::TooMuch { asked_ns_s, carried_ns_s }) } else { Ok(()) }
    }

    /// The worst if the slot before the chain is this one.
    fn after(&self, first: usize) -> Result<Worst, Never> {
        let from_ns = self.supply.takes_until_ns(first);
        let misses = usize::from(!mistake!(CatchesTheSlot));
        let (mut carried_ns, mut index) = (0, first + misses);
        let mut worst: Option<Worst> = None;
        let mut later_ns = 0;
        loop {
            // What slots found and left before ours was published.
            while self.supply.takes_until_ns(index) < from_ns + later_ns + misses as u64 {
                let found_ns = self.published_ns(self.supply.takes_until_ns(index) - from_ns);
                if found_ns.saturating_sub(carried_ns) <= self.supply.room_ns(index) {
                    return worst.ok_or(Never::TooShort);
                }
                carried_ns += self.carries_ns(index);
                index += 1;
            }
            if later_ns > self.longest_ns {
                return Err(Never::TooLong);
            }
            let found = self.ends(first, index, carried_ns, from_ns, later_ns)?;
            worst = Some(worst.filter(|worst| worst.latency_ns >= found.latency_ns).unwrap_or(found));
            later_ns = self.next_ns(later_ns);
            if mistake!(FirstOnly) {
                return worst.ok_or(Never::TooShort);
            }
        }
    }

    /// When the next package could be published that goes before later ones of ours: nothing else makes it worse to be later.
    fn next_ns(&self, later_ns: u64) -> u64 {
        let earlier = self.others.iter().filter(|(_, ahead)| *ahead == Ahead::Earlier).map(|(stream, _)| stream);
        let next = |stream: &Stream| (later_ns / stream.period_ns + 1) * stream.period_ns;
        earlier.chain([self.own]).map(next).min().unwrap_or(u64::MAX)
    }

    /// All that could be published within a time after slot v.
    fn published_ns(&self, within_ns: u64) -> u64 {
        self.streams().map(|stream| within_ns.div_ceil(stream.period_ns) * stream.takes_ns).sum()
    }

    /// The end of the package that is published `later_ns` after slot v took what it sends, if the first slot that finds it is `index`.
    fn ends(&self, first: usize, index: usize, carried_ns: u64, from_ns: u64, later_ns: u64) -> Result<Worst, Never> {
        let published_ns = from_ns + later_ns;
        let own_earlier = if mistake!(ForgetsOwn) { 0 } else { later_ns / self.own.period_ns };
        let (mut carried_ns, mut last) = (carried_ns, index);
        loop {
            let begin_ns = self.supply.begin_ns(last);
            if begin_ns > published_ns + self.longest_ns {
                return Err(Never::TooLong);
            }
            if let Some((others_ns, starts_ns)) = self.fits(last, carried_ns, from_ns, later_ns, own_earlier) {
                let end_ns = (starts_ns + self.own.last_ns).min(self.supply.sends_ns(last));
                return Ok(Worst {
                    latency_ns: begin_ns + end_ns - published_ns,
                    waits_ns: begin_ns.saturating_sub(published_ns),
                    window: last % self.supply.windows.len(),
                    slots: (last - first).max(1) as u64,
                    others_ns,
                    own_earlier,
                });
            }
            carried_ns += self.carries_ns(last);
            last += 1;
        }
    }

    /// Whether all that is left, and our package, have room in a slot; what of others was ahead, and when its last datagram starts at the
    /// latest, counted from the slot's beginning.
    fn fits(&self, index: usize, carried_ns: u64, from_ns: u64, later_ns: u64, own_earlier: u64) -> Option<(u64, u64)> {
        let (begin_ns, room_ns) = (self.supply.begin_ns(index), self.supply.room_ns(index));
        let said_ns = if mistake!(SaysNothing) { 0 } else { self.supply.said_ns + self.supply.late_ns };
        let mut starts_ns = said_ns;
        loop {
            let until_ns = begin_ns + starts_ns - from_ns;
            let others_ns = self.others.iter().map(|(stream, ahead)| {
                let count = match ahead {
                    _ if mistake!(ComesOnce) => 1,
                    Ahead::Always => until_ns.div_ceil(stream.period_ns),
                    Ahead::Earlier if mistake!(ForgetsEqual) => 0,
                    Ahead::Earlier => later_ns / stream.period_ns + 1,
                };
                count * stream.takes_ns
            });
            let others_ns: u64 = others_ns.sum();
            let left_ns = (others_ns + (own_earlier + 1) * self.own.takes_ns).saturating_sub(carried_ns);
            let left_ns = left_ns.max(self.own.end_ns);
            if left_ns > room_ns {
                return None;
            }
            let starts = said_ns + left_ns - self.own.end_ns;
            if starts <= starts_ns {
                return Some((others_ns, starts_ns));
            }
            starts_ns = starts;
        }
    }
}
