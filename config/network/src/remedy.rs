//! The smallest change of a slot table with which a flow keeps its deadline.

use crate::plan::{Plan, PlannedFlow};
use crate::table::{Tdma, TimeSlot};
use std::time::Duration;

/// Step of changes of slots.
const STEP: Duration = Duration::from_micros(10);
/// Longest period that is tried, in cycles.
const CYCLES_MAX: u32 = 64;

/// A change with which a flow keeps its deadline. Slots are given by their places in [`Tdma::slots`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Remedy {
    /// A slot of its node that is longer.
    Longer(usize, TimeSlot),
    /// A slot of its node with a shorter period.
    Oftener(usize, TimeSlot),
    /// An additional slot.
    Another(TimeSlot),
    /// No change of one slot suffices, but this later deadline does.
    Later(Duration),
    /// No deadline suffices, either; the longer period that does, if there is one.
    Slower(Option<Duration>),
}

impl Plan {
    /// The change with which a flow keeps its deadline: found by trying, and verified.
    pub fn remedy(&self, tdma: &Tdma, flow: usize) -> Remedy {
        let search = Search { plan: self, tdma, flow };
        let change = search.longer().or_else(|| search.oftener()).or_else(|| search.another().map(Remedy::Another));
        let later = || {
            let period = self.flows[flow]?.period;
            search.latency(tdma).map(round_up).filter(|bound| *bound <= period).map(Remedy::Later)
        };
        change.or_else(later).unwrap_or_else(|| Remedy::Slower(self.slower(tdma, flow, |_| false)))
    }

    /// The fewest cycles that a flow keeps as its period and deadline if these others become as slow: found by trying.
    pub fn slower(&self, tdma: &Tdma, flow: usize, others: impl Fn(&PlannedFlow) -> bool) -> Option<Duration> {
        let own = self.flows[flow]?;
        let holds = |period: &Duration| {
            let mut slower = self.clone();
            for (index, other) in slower.flows.iter_mut().enumerate() {
                if let Some(other) = other.as_mut().filter(|other| index == flow || others(other)) {
                    (other.period, other.deadline) = (*period, *period);
                }
            }
            Search { plan: &slower, tdma, flow }.keeps(tdma)
        };
        (1..=CYCLES_MAX).map(|cycles| tdma.cycle * cycles).filter(|period| *period > own.period).find(holds)
    }

    /// The slot of a node that has to grow least, until its slots leave so many parts of replicas a second, in
    /// thousandths.
    pub fn longer_for_parts(&self, tdma: &Tdma, node: u8, parts: u64) -> Option<(usize, TimeSlot)> {
        longer(tdma, node, |tdma| self.parts_left(tdma, node) >= parts)
    }
}

/// Up to a tenth of a millisecond.
fn round_up(duration: Duration) -> Duration {
    const TENTH_NS: u64 = 100_000;
    Duration::from_nanos((duration.as_nanos() as u64).div_ceil(TENTH_NS) * TENTH_NS)
}

struct Search<'a> {
    plan: &'a Plan,
    tdma: &'a Tdma,
    flow: usize,
}

impl<'a> Search<'a> {
    fn latency(&self, tdma: &Tdma) -> Option<Duration> {
        self.plan.bound(tdma, self.flow)?.latency.ok().map(|bound| bound.latency)
    }

    fn keeps(&self, tdma: &Tdma) -> bool {
        let deadline = self.plan.flows[self.flow].map(|flow| flow.deadline);
        self.latency(tdma).zip(deadline).is_some_and(|(latency, deadline)| latency <= deadline)
    }

    /// Slots of the sending node.
    fn own(&self) -> impl Iterator<Item = (usize, &'a TimeSlot)> {
        let node = self.plan.flows[self.flow].map(|flow| flow.node);
        self.tdma.slots.iter().enumerate().filter(move |(_, slot)| Some(slot.node) == node)
    }

    /// The slot with the least growth.
    fn longer(&self) -> Option<Remedy> {
        let node = self.plan.flows[self.flow]?.node;
        longer(self.tdma, node, |tdma| self.keeps(tdma)).map(|(index, longer)| Remedy::Longer(index, longer))
    }

    /// The slot with a shorter period, the longest that suffices.
    fn oftener(&self) -> Option<Remedy> {
        let mut tries = self.own().flat_map(|(index, slot)| {
            let shorter = (1..slot.period).rev().filter(|period| slot.period.is_multiple_of(*period));
            shorter.map(move |period| (index, slot.with_period(period)))
        });
        let suffices = |(index, oftener): &(usize, TimeSlot)| {
            let tdma = self.tdma.with(*index, *oftener);
            tdma.collisions().is_empty() && self.keeps(&tdma)
        };
        tries.find(suffices).map(|(index, oftener)| Remedy::Oftener(index, oftener))
    }

    /// A new slot.
    fn another(&self) -> Option<TimeSlot> {
        let (_, model) = self.own().next()?;
        let link = &self.plan.link;
        let length_min = self.tdma.length_min(link);
        let tries = self.tdma.gaps(link.masters()).into_iter().filter_map(|(offset, free)| {
            let length = |steps: u32| length_min + STEP * (steps - 1);
            let slot = |steps: u32| TimeSlot { offset, length: length(steps), period: 1, phase: 0, ..*model };
            let suffices = |steps| {
                let mut tdma = self.tdma.clone();
                tdma.slots.push(slot(steps));
                tdma.slots.sort_by_key(|slot| (slot.offset, slot.phase));
                self.keeps(&tdma)
            };
            let longer = free.checked_sub(length_min)?;
            least((longer.as_nanos() / STEP.as_nanos()) as u32 + 1, suffices).map(slot)
        });
        tries.min_by_key(|slot| slot.length)
    }
}

/// The slot of a node that has to grow least until this holds.
fn longer(tdma: &Tdma, node: u8, holds: impl Fn(&Tdma) -> bool) -> Option<(usize, TimeSlot)> {
    let own = tdma.slots.iter().enumerate().filter(|(_, slot)| slot.node == node);
    let tries = own.filter_map(|(index, slot)| {
        let free = tdma.free_behind(slot).saturating_sub(slot.length);
        let steps = (free.as_nanos() / STEP.as_nanos()) as u32;
        let longer = |steps: u32| TimeSlot { length: slot.length + STEP * steps, ..*slot };
        let suffices = |steps| holds(&tdma.with(index, longer(steps)));
        least(steps, suffices).map(|steps| (steps, index, longer(steps)))
    });
    tries.min_by_key(|(steps, ..)| *steps).map(|(_, index, longer)| (index, longer))
}

/// The least number from 1 to `most` that suffices, if larger ones do no harm; the result always suffices.
fn least(most: u32, suffices: impl Fn(u32) -> bool) -> Option<u32> {
    if most == 0 || !suffices(most) {
        return None;
    }
    let (mut below, mut enough) = (0, most);
    while enough - below > 1 {
        let middle = below.midpoint(enough);
        if suffices(middle) {
            enough = middle;
        } else {
            below = middle;
        }
    }
    Some(enough)
}
