//! The smallest change of a slot table by which a flow keeps its deadline.

use super::bound;
use crate::flow::Flow;
use crate::installation::Installation;
use crate::tdma::{Tdma, TimeSlot};
use crate::units::duration_decimal;
use crate::wire::Link;
use std::time::Duration;

/// Slots are changed in such steps.
const STEP: Duration = Duration::from_micros(10);
/// So many cycles as a period are tried.
const CYCLES_MAX: u32 = 64;

/// What to write instead, so that a flow keeps its deadline: found by trying, and tried.
pub(crate) fn remedy(installation: &Installation, tdma: &Tdma, flow: usize) -> String {
    let search = Search { installation, tdma, flow };
    let longer = search.longer().map(|(slot, length)| {
        let by = duration_decimal(length - slot.length);
        let (whose, length) = (search.whose(slot), duration_decimal(length));
        format!("lengthen {whose} by {by}: `length = \"{length}\"`")
    });
    let oftener = || {
        let (slot, oftener) = search.oftener()?;
        Some(format!("let {} come oftener: {}", search.whose(slot), oftener.period_text(slot)))
    };
    let another = || {
        let slot = search.another()?;
        let (offset, length) = (duration_decimal(slot.offset), duration_decimal(slot.length));
        let node = &installation.nodes[usize::from(slot.node)].name;
        Some(format!("add a [[slot]]: `node = \"{node}\"`, `offset = \"{offset}\"`, `length = \"{length}\"`"))
    };
    longer.or_else(oftener).or_else(another).unwrap_or_else(|| {
        let later = search.latency(tdma).map(round_up).filter(|bound| *bound <= installation.flows[flow].period);
        match later {
            Some(bound) => {
                format!("no change of one slot suffices; allow `deadline = \"{}\"`", duration_decimal(bound))
            }
            None => {
                let period = slower(installation, tdma, flow, |_| false).map(duration_decimal);
                let period = period.map_or_else(
                    || "a longer `period`".into(),
                    |period| format!("`period = \"{period}\"` and a `deadline` no shorter"),
                );
                format!("no change of one slot suffices; write a smaller `size`, or {period}, or let others send less")
            }
        }
    })
}

/// The fewest cycles that a flow keeps as its period and deadline, if these others become as slow: found by trying.
pub(crate) fn slower(
    installation: &Installation,
    tdma: &Tdma,
    flow: usize,
    others: impl Fn(&Flow) -> bool,
) -> Option<Duration> {
    let holds = |period: &Duration| {
        let mut slower = installation.clone();
        for (index, other) in slower.flows.iter_mut().enumerate() {
            if index == flow || others(other) {
                (other.period, other.deadline) = (*period, *period);
            }
        }
        Search { installation: &slower, tdma, flow }.keeps(tdma)
    };
    let longer = (1..=CYCLES_MAX).map(|cycles| tdma.cycle * cycles);
    longer.filter(|period| *period > installation.flows[flow].period).find(holds)
}

/// Up to a tenth of a millisecond.
fn round_up(duration: Duration) -> Duration {
    const TENTH_NS: u64 = 100_000;
    Duration::from_nanos((duration.as_nanos() as u64).div_ceil(TENTH_NS) * TENTH_NS)
}

struct Search<'a> {
    installation: &'a Installation,
    tdma: &'a Tdma,
    flow: usize,
}

impl<'a> Search<'a> {
    fn latency(&self, tdma: &Tdma) -> Option<Duration> {
        bound(self.installation, tdma, self.flow)?.latency.ok().map(|bound| bound.latency)
    }

    fn keeps(&self, tdma: &Tdma) -> bool {
        self.latency(tdma).is_some_and(|latency| latency <= self.installation.flows[self.flow].deadline)
    }

    fn whose(&self, slot: &TimeSlot) -> String {
        self.tdma.whose(slot, &self.installation.nodes)
    }

    /// Slots of the node that sends.
    fn own(&self) -> impl Iterator<Item = (usize, &'a TimeSlot)> {
        let from = self.installation.flows[self.flow].from;
        let node = self.installation.node_of(from).and_then(|node| self.installation.node_index(node));
        self.tdma.slots.iter().enumerate().filter(move |(_, slot)| Some(slot.node) == node)
    }

    /// The slot that has to grow least, and its length then.
    fn longer(&self) -> Option<(&'a TimeSlot, Duration)> {
        let tries = self.own().filter_map(|(index, slot)| {
            let free = self.tdma.free_behind(slot).saturating_sub(slot.length);
            let steps = (free.as_nanos() / STEP.as_nanos()) as u32;
            let length = |steps: u32| slot.length + STEP * steps;
            let suffices = |steps| self.keeps(&self.tdma.with(index, TimeSlot { length: length(steps), ..*slot }));
            least(steps, suffices).map(|steps| (slot, length(steps)))
        });
        tries.min_by_key(|(slot, length)| *length - slot.length)
    }

    /// The slot that has to come oftener, and how it is then, with its longest period.
    fn oftener(&self) -> Option<(&'a TimeSlot, TimeSlot)> {
        let tries = self.own().flat_map(|(index, slot)| {
            let shorter = (1..slot.period).rev().filter(|period| slot.period.is_multiple_of(*period));
            shorter.map(move |period| (index, slot, slot.with_period(period)))
        });
        let mut right = tries.filter(|(index, _, oftener)| {
            let tdma = self.tdma.with(*index, *oftener);
            tdma.collisions().is_empty() && self.keeps(&tdma)
        });
        right.next().map(|(_, slot, oftener)| (slot, oftener))
    }

    /// A slot where there is none yet.
    fn another(&self) -> Option<TimeSlot> {
        let (_, model) = self.own().next()?;
        let network = self.installation.network.as_ref()?;
        let link = Link::new(self.tdma, network, self.installation.lan_nodes());
        let length_min = self.tdma.length_min(self.installation, &link);
        let tries = self.tdma.gaps(self.installation.time.masters()).into_iter().filter_map(|(offset, free)| {
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

/// The least number from 1 to `most` that suffices, if more does not harm; whatever it gives does suffice.
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
