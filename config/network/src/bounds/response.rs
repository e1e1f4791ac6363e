//! Longest wait and transmission time of a package of a stream: response-time analysis of one node.
//!
//! ```text
//!        ▼ published just after this slot's packages were taken
//!  ──┬───────────┬───────────────────────┬───────────┬───────────────────────┬───────────┬──
//!    │ slot v    │                       │ slot v+1  │                       │ slot v+2  │
//!  ──┴───────────┴───────────────────────┴───────────┴───────────────────────┴───────────┴──
//!                                         ███ ▓▓▓▓▓░░                         ██ ▒▒▒
//!                        routers' messages ┘   │   └ the next head does not fit   └ the package
//!                                  ahead of it ─┘
//! ```
//!
//! A *chain* is a series of slots, each of which leaves something waiting. Slot v before it left nothing: so all
//! packages ahead of ours were published after slot v took its packages. A slot of a chain carries at least its room
//! less the largest datagram (and one ns), and as many datagrams as would fit if all were largest ones: had it carried
//! less, the head that ended it would have fitted. The chain ends with the slot that has room for all that is left and
//! our package. All choices of slot v are tried, and all relevant times from it to the publishing of our package.

use super::mistakes::mistake;

/// Moments of publishing that are tried for one slot v: a flow that needs more has no useful bound.
const TRIES_MAX: usize = 5_000;
/// Slots of a chain, at most, for the same reason.
const CHAIN_MAX: usize = 20_000;
const SECOND_NS: u64 = 1_000_000_000;

/// Room in the slots of a node, repeated forever.
#[derive(Clone, Debug)]
pub(crate) struct Supply {
    /// By their beginning; none overlaps the next.
    pub(crate) windows: Vec<Window>,
    /// From one round of them to the next, ns.
    pub(crate) repeats_ns: u64,
    /// Time of the routers' own messages at the beginning of each slot, ns.
    pub(crate) said_ns: u64,
    /// A package published later than this before a slot may miss it, ns.
    pub(crate) taken_before_ns: u64,
    /// Latest beginning of a slot, ns.
    pub(crate) late_ns: u64,
    /// Largest rate between slot time, which is slewed, and the publisher's clock, ns a second.
    pub(crate) bends_ns_s: u64,
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
    /// Time of one, see [`Parcel`](crate::Parcel).
    pub(crate) takes_ns: u64,
    pub(crate) datagrams: u64,
    pub(crate) largest_ns: u64,
    pub(crate) end_ns: u64,
    pub(crate) last_ns: u64,
}

/// Work that waits, or the least that a slot carries. It saturates: no slot carries the largest value.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct Work {
    ns: u64,
    datagrams: u64,
}

impl std::ops::AddAssign for Work {
    fn add_assign(&mut self, more: Self) {
        self.ns = self.ns.saturating_add(more.ns);
        self.datagrams = self.datagrams.saturating_add(more.datagrams);
    }
}

impl std::iter::Sum for Work {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |mut sum, work| {
            sum += work;
            sum
        })
    }
}

/// Order of other packages against ours.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Ahead {
    /// They go first, even those that are published later.
    Always,
    /// Packages that were published before go first.
    Earlier,
}

/// The worst case of a package.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Worst {
    /// From its publishing to the end of its last datagram, ns.
    pub(crate) latency_ns: u64,
    /// Up to the beginning of the slot in which it ends, ns.
    pub(crate) waits_ns: u64,
    /// The window of the round.
    pub(crate) window: usize,
    /// How many slots began while it waited, this one included.
    pub(crate) slots: u64,
    /// Time for other packages before it since slot v, ns.
    pub(crate) others_ns: u64,
    /// Packages of its own stream before it.
    pub(crate) own_earlier: u64,
}

/// Why there is no worst case.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Never {
    /// No slot has room for one of its datagrams, or of those before it.
    NoRoom,
    /// The demand exceeds the capacity; both in ns a second.
    Overload {
        /// Demand.
        asked_ns_s: u64,
        /// Capacity.
        carried_ns_s: u64,
    },
    /// It takes longer than any package may wait.
    Late,
}

impl Supply {
    /// By the fastest clock against slot time: then most is published between two slots, and it waits longest.
    fn begin_ns(&self, index: usize) -> u64 {
        let round = index / self.windows.len();
        // One round ahead, so that the publishing before the first slot has no negative time.
        let begin_ns = (round as u64 + 1) * self.repeats_ns + self.windows[index % self.windows.len()].begin_ns;
        begin_ns + self.bent_by_ns(begin_ns)
    }

    fn bent_by_ns(&self, for_ns: u64) -> u64 {
        let bends_ns_s = if mistake!(ForgetsBend) { 0 } else { self.bends_ns_s };
        (u128::from(for_ns) * u128::from(bends_ns_s)).div_ceil(u128::from(SECOND_NS)) as u64
    }

    /// A slot takes packages published until then.
    fn takes_until_ns(&self, index: usize) -> u64 {
        self.begin_ns(index).saturating_sub(self.taken_before_ns)
    }

    /// By the slowest clock: then a slot holds least.
    fn sends_ns(&self, index: usize) -> u64 {
        let sends_ns = self.windows[index % self.windows.len()].sends_ns;
        sends_ns - self.bent_by_ns(sends_ns)
    }

    /// Latest beginning of a slot's guard, counted from the slot's beginning.
    fn ends_ns(&self, index: usize) -> u64 {
        let sends_ns = self.windows[index % self.windows.len()].sends_ns;
        sends_ns + self.bent_by_ns(sends_ns)
    }

    /// Time for packages.
    fn room_ns(&self, index: usize) -> u64 {
        let said_ns = if mistake!(SaysNothing) { 0 } else { self.said_ns + self.late_ns };
        self.sends_ns(index).saturating_sub(said_ns)
    }

    /// The least that a slot carries while something waits. No datagram takes longer than `largest_ns`.
    fn carries(&self, index: usize, largest_ns: u64) -> Work {
        let room_ns = self.room_ns(index);
        let wasted_ns = if mistake!(WastesNothing) { 0 } else { largest_ns - 1 };
        Work { ns: room_ns.saturating_sub(wasted_ns), datagrams: room_ns / largest_ns }
    }

    /// The same of all slots in a second, in thousandths.
    fn carries_a_second(&self, largest_ns: u64) -> Work {
        let carried = (0..self.windows.len()).map(|index| self.carries(index, largest_ns)).sum();
        a_second(carried, self.repeats_ns + self.bent_by_ns(self.repeats_ns), std::ops::Div::div)
    }

    /// Datagrams of the largest size that the slots carry in a second behind all packages of these streams, in
    /// thousandths: as many as their time or their number leaves for sure.
    pub(crate) fn leaves(&self, streams: &[Stream], largest_ns: u64) -> u64 {
        let carried = self.carries_a_second(largest_ns);
        let asked = if mistake!(ForgetsFlows) { Work::default() } else { asked_a_second(streams.iter()) };
        let by_time = carried.ns.saturating_sub(asked.ns) / largest_ns;
        by_time.max(carried.datagrams.saturating_sub(asked.datagrams))
    }

    /// The least time in which so many datagrams of the largest size leave, if nothing else does, ns.
    pub(crate) fn least_ns(&self, datagrams: u64, largest_ns: u64) -> u64 {
        let a_round: u64 = (0..self.windows.len()).map(|index| self.ends_ns(index) / largest_ns).sum();
        let rounds = datagrams.saturating_sub(1) / a_round.max(1);
        let left = datagrams - rounds * a_round;
        rounds * (self.repeats_ns - self.bent_by_ns(self.repeats_ns)) + left * largest_ns
    }
}

impl Stream {
    fn work(&self, packages: u64) -> Work {
        Work { ns: packages.saturating_mul(self.takes_ns), datagrams: packages.saturating_mul(self.datagrams) }
    }
}

/// The worst case of a package of a stream beside others of the same node; none waits longer than `longest_ns`.
pub(crate) fn worst(
    supply: &Supply,
    own: &Stream,
    others: &[(Stream, Ahead)],
    longest_ns: u64,
) -> Result<Worst, Never> {
    let largest_ns = others.iter().map(|(stream, _)| stream).chain([own]).map(|stream| stream.largest_ns).max();
    let analysis = Analysis { supply, own, others, largest_ns: largest_ns.unwrap_or(1).max(1), longest_ns };
    analysis.validate()?;
    let mut worst: Option<Worst> = None;
    let firsts = if mistake!(OneSlotFirst) { 1 } else { supply.windows.len() };
    for first in 0..firsts {
        worst = worse(worst, analysis.after(first)?);
    }
    worst.ok_or(Never::NoRoom)
}

fn worse(one: Option<Worst>, other: Worst) -> Option<Worst> {
    Some(one.filter(|one| one.latency_ns >= other.latency_ns).unwrap_or(other))
}

/// Work in a second, in thousandths since there may be less than one datagram, rounded by `divide`.
fn a_second(work: Work, period_ns: u64, divide: impl Fn(u128, u128) -> u128) -> Work {
    let thousandths = |all: u64| {
        let all = divide(u128::from(all) * u128::from(1000 * SECOND_NS), period_ns.into());
        u64::try_from(all).unwrap_or(u64::MAX)
    };
    Work { ns: thousandths(work.ns), datagrams: thousandths(work.datagrams) }
}

/// What streams ask for in a second, in thousandths.
fn asked_a_second<'s>(streams: impl Iterator<Item = &'s Stream>) -> Work {
    streams.map(|stream| a_second(stream.work(1), stream.period_ns, u128::div_ceil)).sum()
}

struct Analysis<'a> {
    supply: &'a Supply,
    own: &'a Stream,
    others: &'a [(Stream, Ahead)],
    /// Time on the wire of the largest datagram, ns.
    largest_ns: u64,
    longest_ns: u64,
}

/// State of a chain.
#[derive(Clone, Copy)]
struct Chain {
    /// Slot v took packages published until then, ns.
    from_ns: u64,
    /// The next slot.
    index: usize,
    /// Work that the slots before carried.
    carried: Work,
}

impl Analysis<'_> {
    fn streams(&self) -> impl Iterator<Item = &Stream> {
        self.others.iter().map(|(stream, _)| stream).chain([self.own])
    }

    /// The least that a slot of a chain carries.
    fn carries(&self, index: usize) -> Work {
        self.supply.carries(index, self.largest_ns)
    }

    /// The most that may be left of work after some was carried, ns.
    fn left_ns(&self, all: Work, carried: Work) -> u64 {
        let datagrams = all.datagrams.saturating_sub(carried.datagrams);
        all.ns.saturating_sub(carried.ns).min(datagrams.saturating_mul(self.largest_ns))
    }

    /// Whether the capacity suffices in the long run.
    fn validate(&self) -> Result<(), Never> {
        let carried = self.supply.carries_a_second(self.largest_ns);
        if carried.datagrams == 0 {
            return Err(Never::NoRoom);
        }
        let asked = asked_a_second(self.streams());
        if asked.ns >= carried.ns && asked.datagrams >= carried.datagrams {
            return Err(Never::Overload { asked_ns_s: asked.ns / 1000, carried_ns_s: carried.ns / 1000 });
        }
        Ok(())
    }

    /// The worst case if this slot precedes the chain.
    fn after(&self, first: usize) -> Result<Worst, Never> {
        let misses = usize::from(!mistake!(CatchesTheSlot));
        let from_ns = self.supply.takes_until_ns(first);
        let mut chain = Chain { from_ns, index: first + misses, carried: Work::default() };
        let (mut worst, mut later_ns) = (None, 0_u64);
        for _ in 0..TRIES_MAX {
            let published_ns = from_ns.saturating_add(later_ns);
            // Slots that ended before our package was published.
            while self.supply.takes_until_ns(chain.index) < published_ns.saturating_add(misses as u64) {
                if chain.index - first > CHAIN_MAX {
                    return Err(Never::Late);
                }
                let found = self.published(self.supply.takes_until_ns(chain.index) - from_ns);
                if self.left_ns(found, chain.carried) <= self.supply.room_ns(chain.index) {
                    return worst.ok_or(Never::NoRoom);
                }
                chain.carried += self.carries(chain.index);
                chain.index += 1;
            }
            if later_ns > self.longest_ns {
                return Err(Never::Late);
            }
            worst = worse(worst, self.ends(chain, later_ns)?);
            later_ns = self.next_ns(later_ns);
            if mistake!(FirstOnly) {
                return worst.ok_or(Never::NoRoom);
            }
        }
        Err(Never::Late)
    }

    /// The next time of publishing at which another package gets ahead of ours: between these a later time is never
    /// worse.
    fn next_ns(&self, later_ns: u64) -> u64 {
        let earlier = self.others.iter().filter(|(_, ahead)| *ahead == Ahead::Earlier).map(|(stream, _)| stream);
        let next = |stream: &Stream| (later_ns / stream.period_ns + 1).saturating_mul(stream.period_ns);
        earlier.chain([self.own]).map(next).min().unwrap_or(u64::MAX)
    }

    /// All that could be published within a time after slot v.
    fn published(&self, within_ns: u64) -> Work {
        self.streams().map(|stream| stream.work(within_ns.div_ceil(stream.period_ns))).sum()
    }

    /// The end of our package, published `later_ns` after slot v took its packages, if the chain's next slot is the
    /// first to find it.
    fn ends(&self, chain: Chain, later_ns: u64) -> Result<Worst, Never> {
        let published_ns = chain.from_ns + later_ns;
        let own_earlier = if mistake!(ForgetsOwn) { 0 } else { later_ns / self.own.period_ns };
        let mut at = chain;
        loop {
            let begin_ns = self.supply.begin_ns(at.index);
            if begin_ns > published_ns + self.longest_ns {
                return Err(Never::Late);
            }
            if let Some((others_ns, starts_ns)) = self.fits(at, later_ns, own_earlier) {
                let end_ns = (starts_ns + self.own.last_ns).min(self.supply.ends_ns(at.index));
                return Ok(Worst {
                    latency_ns: begin_ns + end_ns - published_ns,
                    waits_ns: begin_ns.saturating_sub(published_ns),
                    window: at.index % self.supply.windows.len(),
                    slots: (at.index + 1 - chain.index) as u64,
                    others_ns,
                    own_earlier,
                });
            }
            at.carried += self.carries(at.index);
            at.index += 1;
        }
    }

    /// Whether all that is left, and our package, fit into the next slot. Returns the others' work ahead, and the
    /// latest start of our last datagram, counted from the slot's beginning.
    fn fits(&self, chain: Chain, later_ns: u64, own_earlier: u64) -> Option<(u64, u64)> {
        let (begin_ns, room_ns) = (self.supply.begin_ns(chain.index), self.supply.room_ns(chain.index));
        let said_ns = if mistake!(SaysNothing) { 0 } else { self.supply.said_ns + self.supply.late_ns };
        let mut starts_ns = said_ns;
        loop {
            let others = self.others_ahead(begin_ns + starts_ns - chain.from_ns, later_ns);
            // All but the last datagram of ours.
            let mut ahead = self.own.work(own_earlier);
            ahead += others;
            ahead += Work { ns: self.own.takes_ns - self.own.end_ns, datagrams: self.own.datagrams - 1 };
            let left_ns = self.left_ns(ahead, chain.carried);
            if left_ns.saturating_add(self.own.end_ns) > room_ns {
                return None;
            }
            if said_ns + left_ns <= starts_ns {
                return Some((others.ns, starts_ns));
            }
            starts_ns = said_ns + left_ns;
        }
    }

    /// Others' work that goes before our package, if our last datagram starts `within_ns` after slot v.
    fn others_ahead(&self, within_ns: u64, later_ns: u64) -> Work {
        let ahead = |(stream, ahead): &(Stream, Ahead)| {
            stream.work(match ahead {
                _ if mistake!(ComesOnce) => 1,
                Ahead::Always => within_ns.div_ceil(stream.period_ns),
                Ahead::Earlier if mistake!(ForgetsEqual) => 0,
                Ahead::Earlier => later_ns / stream.period_ns + 1,
            })
        };
        self.others.iter().map(ahead).sum()
    }
}
