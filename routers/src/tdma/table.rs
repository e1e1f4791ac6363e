//! The slot table of a system as one node sees it: arithmetic over system time, without state.
//!
//! ```text
//!  cycle n begins at n × cycle                                                                       cycle n + 1
//!  ├── rank 0 ───┬── rank 1 ───┬─ … ─┬──── slot ─────────┬── slot ───────┬── free ──┬──── slot ────────┬─ … ─┤
//!  │ send  guard │ send  guard │     │ send        guard │ send    guard │          │ send       guard │
//! ```
//!
//! A *window* is one node's time to send, without a pause: its synchronisation window, or a slot. Here it ends where
//! its guard begins. Configuration has checked that windows do not overlap (`rohrpost check`).

use super::wire::Wire;
use crate::frame::NodeIndex;
use crate::time::InSlots;
use rohrpost_network::Tdma;
use rohrpost_network::TimeShare;
use std::time::Duration;

/// While the time is unverified, a hello leaves in one of this many cycles, since that time may be wrong.
pub const UNPROVEN_CYCLES: u64 = 4;

/// Purpose of a window.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum WindowKind {
    /// Synchronisation by the master at this place in their order.
    Synchronisation {
        /// From 0.
        rank: u8,
    },
    /// The slot with this place in [`Tdma::slots`].
    Slot {
        /// From 0.
        index: u16,
    },
}

/// A node's time to send, in system time.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Window {
    /// Purpose.
    pub kind: WindowKind,
    /// Counts cycles of system time since 1970.
    pub cycle: u64,
    /// The first frame is on the wire no earlier than this, system ns.
    pub begin_ns: u64,
    /// The last frame is off the wire by then, system ns: here the guard begins.
    pub end_ns: u64,
}

/// The owner of a moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Owner {
    /// The node.
    pub node: NodeIndex,
    /// Its window.
    pub window: Window,
    /// The moment lies in the guard behind the window.
    pub is_guard: bool,
}

/// The slots of a system, and this node's windows among them.
#[derive(Clone, Debug)]
pub struct SlotTable {
    own: NodeIndex,
    masters: Vec<NodeIndex>,
    cycle_ns: u64,
    synchronisation_ns: u64,
    guard_ns: u64,
    wire: Wire,
    share: TimeShare,
    slots: Vec<Slot>,
}

#[derive(Clone, Copy, Debug)]
struct Slot {
    node: NodeIndex,
    offset_ns: u64,
    length_ns: u64,
    period: u64,
    phase: u64,
}

impl SlotTable {
    /// The table of `nodes` nodes as `own` sees it. `masters` in their order. `heads_bytes`: bytes of IP and UDP
    /// headers for each datagram, see [`Settings::overhead_bytes`](crate::settings::Settings::overhead_bytes).
    pub fn new(tdma: &Tdma, masters: &[NodeIndex], own: NodeIndex, nodes: u8, heads_bytes: usize) -> Self {
        let slots = tdma.slots.iter().map(|slot| Slot {
            node: slot.node,
            offset_ns: ns(slot.offset),
            length_ns: ns(slot.length),
            period: u64::from(slot.period.max(1)),
            phase: u64::from(slot.phase % slot.period.max(1)),
        });
        Self {
            own,
            masters: masters.to_vec(),
            cycle_ns: ns(tdma.cycle).max(1),
            synchronisation_ns: ns(tdma.synchronisation),
            guard_ns: ns(tdma.guard),
            wire: Wire::new(tdma, heads_bytes),
            share: TimeShare::new(tdma, heads_bytes, nodes.into(), masters.len()),
            slots: slots.collect(),
        }
    }

    /// This node.
    pub fn own(&self) -> NodeIndex {
        self.own
    }

    /// Its place among the masters.
    pub fn rank(&self) -> Option<u8> {
        self.masters.iter().position(|master| *master == self.own).map(|rank| rank as u8)
    }

    /// Time from the beginning of one cycle to that of the next, ns.
    pub fn cycle_ns(&self) -> u64 {
        self.cycle_ns
    }

    /// Largest clock error at which a node may send, ns: two nodes that are off in opposite directions then use the
    /// whole guard.
    pub fn allowance_ns(&self) -> u64 {
        self.guard_ns / 2
    }

    /// The first window of this node that begins at `from_ns`, system time, or later. None if it has none.
    pub fn next_window(&self, from_ns: u64) -> Option<Window> {
        let windows = self.next_slot(from_ns).into_iter().chain(self.next_synchronisation(from_ns));
        windows.min_by_key(|window| window.begin_ns)
    }

    /// The first slot of this node that begins at `from_ns`, system time, or later. None if it has none.
    pub fn next_slot(&self, from_ns: u64) -> Option<Window> {
        let slots = self.own_slots().filter_map(|(index, slot)| {
            let cycle = slot.cycle_from(self.cycles_begun(from_ns, slot.offset_ns));
            self.slot_window(index, slot, cycle)
        });
        slots.min_by_key(|window| window.begin_ns)
    }

    /// The first window of this node's synchronisation that begins at `from_ns`, system time, or later. None if it is
    /// no master.
    pub fn next_synchronisation(&self, from_ns: u64) -> Option<Window> {
        let rank = self.rank()?;
        let offset_ns = u64::from(rank) * self.synchronisation_ns;
        self.synchronisation(rank, self.cycles_begun(from_ns, offset_ns))
    }

    /// How many slots of this node begin from `from_ns` on and before `to_ns`, system time.
    pub fn slots_between(&self, from_ns: u64, to_ns: u64) -> u64 {
        let slots = self.own_slots().map(|(_, slot)| {
            let begun = |at_ns| {
                let cycles = self.cycles_begun(at_ns, slot.offset_ns);
                cycles.saturating_sub(slot.phase).div_ceil(slot.period)
            };
            begun(to_ns).saturating_sub(begun(from_ns))
        });
        slots.sum()
    }

    /// How many cycles have this offset before a moment.
    fn cycles_begun(&self, before_ns: u64, offset_ns: u64) -> u64 {
        before_ns.saturating_sub(offset_ns).div_ceil(self.cycle_ns)
    }

    /// The owner of a moment of system time; none between slots.
    pub fn owner(&self, system_ns: u64) -> Option<Owner> {
        let (cycle, in_cycle_ns) = (system_ns / self.cycle_ns, system_ns % self.cycle_ns);
        let rank = in_cycle_ns.checked_div(self.synchronisation_ns).filter(|rank| *rank < self.masters.len() as u64);
        let (node, window) = match rank {
            Some(rank) => (self.masters[rank as usize], self.synchronisation(rank as u8, cycle)?),
            None => {
                let mut slots = self.slots.iter().enumerate();
                let (index, slot) = slots.find(|(_, slot)| slot.holds(cycle, in_cycle_ns))?;
                (slot.node, self.slot_window(index, slot, cycle)?)
            }
        };
        Some(Owner { node, window, is_guard: system_ns >= window.end_ns })
    }

    /// The link that all nodes share.
    pub fn wire(&self) -> &Wire {
        &self.wire
    }

    /// What a clock needs to know of the slots.
    pub fn for_clock(&self) -> InSlots {
        let asks = |node| node == self.own || self.masters.contains(&node);
        InSlots {
            warm_ups: self.share.warm_ups,
            replies_in_synchronisation: self.share.replies_in_synchronisation,
            delay_max_ns: self.guard_ns / 2,
            allowance_ns: self.allowance_ns(),
            slot_every_ns: self.cycle_ns.saturating_mul(self.rarest_cycles(|_| true)),
            asks_every_ns: self.cycle_ns.saturating_mul(self.rarest_cycles(asks)),
            hello_every_ns: self.cycle_ns.saturating_mul(UNPROVEN_CYCLES.max(self.rarest_cycles(|_| true))),
        }
    }

    /// The longest distance between slots of these nodes, in cycles.
    fn rarest_cycles(&self, of: impl Fn(NodeIndex) -> bool) -> u64 {
        let periods = |node| self.slots.iter().filter(move |slot| slot.node == node).map(|slot| slot.period);
        let nodes = self.slots.iter().map(|slot| slot.node).filter(|node| of(*node));
        nodes.filter_map(|node| periods(node).min()).max().unwrap_or(1)
    }

    fn own_slots(&self) -> impl Iterator<Item = (usize, &Slot)> {
        self.slots.iter().enumerate().filter(|(_, slot)| slot.node == self.own)
    }

    fn synchronisation(&self, rank: u8, cycle: u64) -> Option<Window> {
        self.window(
            WindowKind::Synchronisation { rank },
            cycle,
            u64::from(rank) * self.synchronisation_ns,
            self.synchronisation_ns,
        )
    }

    fn slot_window(&self, index: usize, slot: &Slot, cycle: u64) -> Option<Window> {
        self.window(WindowKind::Slot { index: index as u16 }, cycle, slot.offset_ns, slot.length_ns)
    }

    /// None after the year 2554.
    fn window(&self, kind: WindowKind, cycle: u64, offset_ns: u64, length_ns: u64) -> Option<Window> {
        let begin_ns = cycle.checked_mul(self.cycle_ns)?.checked_add(offset_ns)?;
        let guard_ns = self.guard_ns;
        let end_ns = begin_ns.checked_add(length_ns.saturating_sub(guard_ns))?;
        Some(Window { kind, cycle, begin_ns, end_ns })
    }
}

impl Slot {
    /// The first cycle from this one on that has it.
    fn cycle_from(&self, cycle: u64) -> u64 {
        let ahead = (self.phase + self.period - cycle % self.period) % self.period;
        cycle.saturating_add(ahead)
    }

    fn holds(&self, cycle: u64, in_cycle_ns: u64) -> bool {
        let is_there = cycle % self.period == self.phase;
        is_there && in_cycle_ns >= self.offset_ns && in_cycle_ns - self.offset_ns < self.length_ns
    }
}

fn ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
