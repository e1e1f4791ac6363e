//! Networks with time slots: their tables, drawn from a seed, and how late their timing threads wake.

use super::chance::Chance;
use super::divided::Divisions;
use super::spans::{MS, S, US};
use rohrpost_network::Tdma;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::tdma::GATE_NS;
use rohrpost_routers::time::Term;
use std::ops::Range;
use std::time::Duration;

/// What Ethernet, IPv4 and UDP put around each datagram, bytes.
pub(crate) const AROUND_BYTES: usize = 8 + 14 + 4 + 12 + 20 + 8;
/// Wake-ups beyond what the late gate lets through, of a million.
pub(super) const LATE_PPM: u32 = 2000;
/// A thread wakes so late at most, unless it is frozen.
const LATE_NS_MAX: u64 = 5 * MS;
/// A thread stands still so long at most before it hands over what it made: longer than a datagram waits for a slot.
const STILL_NS_MAX: u64 = 200 * MS;

/// What a network with time slots has besides.
#[derive(Clone, Debug)]
pub struct Slots {
    /// Which node may send when.
    pub table: Tdma,
    /// The nodes that may be master, in order.
    pub masters: Vec<NodeIndex>,
    /// Wake-ups beyond what the late gate lets through, of a million.
    pub(crate) late_ppm: u32,
    /// Datagrams that the thread makes, and then stands still before it hands them over, of a million.
    pub(crate) still_ppm: u32,
    /// Windows for which the thread wakes up so late that it takes nothing before the call, of a hundred.
    pub(crate) oversleeps_percent: u64,
    /// The faults that divide the network.
    pub(crate) divisions: Divisions,
    /// A router has system time and may send so long after it began, where nothing goes wrong but that others begin
    /// too; none: it is not asked.
    pub(crate) joins_ns: Option<u64>,
}

impl Slots {
    /// How long a datagram of so many bytes takes on a link.
    pub(crate) fn takes_ns(&self, bytes: usize) -> u64 {
        takes_ns(bytes + AROUND_BYTES, self.table.link_bytes_s)
    }

    /// The master of a term.
    pub(crate) fn master(&self, term: Term) -> Option<usize> {
        self.masters.get(usize::from(term.rank())).map(|master| usize::from(*master)).filter(|_| !term.is_none())
    }

    /// The window of a node in which a moment of system time is, from its beginning to its guard, system ns; and how
    /// late it may be begun.
    pub(crate) fn window(&self, node: usize, system_ns: u64) -> Option<(Range<u64>, u64)> {
        let ns = |duration: Duration| duration.as_nanos() as u64;
        let table = &self.table;
        let (cycle, in_cycle_ns) = (system_ns / ns(table.cycle), system_ns % ns(table.cycle));
        let sync_ns = ns(table.synchronisation);
        let rank = self.masters.iter().position(|master| usize::from(*master) == node);
        let synchronisation = rank.map(|rank| (rank as u64 * sync_ns, sync_ns, sync_ns));
        let own = table.slots.iter().filter(|slot| usize::from(slot.node) == node);
        let own = own.filter(|slot| cycle % u64::from(slot.period) == u64::from(slot.phase));
        let mut all = own.map(|slot| (ns(slot.offset), ns(slot.length), GATE_NS)).chain(synchronisation);
        let is_there = |(offset, length, _): &(u64, u64, u64)| (*offset..offset + length).contains(&in_cycle_ns);
        let (offset_ns, length_ns, late_ns) = all.find(is_there)?;
        let begin_ns = system_ns - in_cycle_ns + offset_ns;
        Some((begin_ns..begin_ns + length_ns - ns(table.guard), late_ns))
    }

    /// How late a timing thread wakes: it sleeps to shortly before its time, then spins. When the faults are over, not
    /// so late nor so often that others take over from a master: not again before it `has_rested`.
    pub(crate) fn late_ns(&self, fixed: bool, has_rested: bool, chance: &mut Chance) -> u64 {
        if chance.per_million(if fixed { self.late_ppm.min(LATE_PPM) } else { self.late_ppm }) {
            let late_ns = chance.scale(50 * US, LATE_NS_MAX);
            match fixed {
                false => return late_ns,
                true if has_rested => return late_ns.min(self.table.cycle.as_nanos() as u64),
                true => {}
            }
        }
        if chance.percent(5) { chance.below(45 * US) } else { chance.below(3 * US) }
    }

    /// For how long it stands still with a datagram in its hand, while something may go wrong.
    pub(crate) fn still_ns(&self, fixed: bool, chance: &mut Chance) -> u64 {
        if !fixed && chance.per_million(self.still_ppm) { chance.scale(50 * US, STILL_NS_MAX) } else { 0 }
    }

    /// A thread that woke too late does so again no sooner than after this, when the faults are over: a master then
    /// misses one Sync of four.
    pub(crate) fn rest_ns(&self) -> u64 {
        4 * self.table.cycle.as_nanos() as u64
    }
}

pub(super) fn takes_ns(bytes: usize, link_bytes_s: u64) -> u64 {
    (bytes as u64 * S).div_ceil(link_bytes_s)
}

/// What a node's slots carry.
pub(crate) fn node_bytes_s(table: &Tdma, node: usize) -> u64 {
    let slots = table.slots.iter().filter(|slot| usize::from(slot.node) == node);
    let per_cycle_ns: u64 =
        slots.map(|slot| (slot.length - table.guard).as_nanos() as u64 / u64::from(slot.period)).sum();
    per_cycle_ns * (table.link_bytes_s / 1000) / (table.cycle.as_nanos() as u64 / 1000)
}
