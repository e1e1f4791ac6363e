//! Bounds: the longest delay of a flow's packages, known before anything runs. The book's chapter "Time slots and
//! bounds" derives them.
//!
//! A bound covers the time from publishing, into the mailbox of the node's router, to the arrival of the last bit at
//! the other computer. Parts of replicas leave behind all packages, and so are in no bound; what slots leave for them
//! is reckoned with the same work and the same room. A bound holds under these conditions: flows send no more than they
//! declare; nothing else is sent at their priority or above (tools, calls and replies included); no slot is left out;
//! nothing is lost; every slot begins at most [`LATE`] late. The time in which a process wakes up and reads is not
//! included.

mod mistakes;
mod response;
#[cfg(test)]
mod simulation;
#[cfg(test)]
mod tests;

use crate::link::Link;
use crate::plan::{Plan, PlannedFlow, PlannedReplica};
use crate::setup::LEVEL_NOT_REAL_TIME;
use crate::sizes::{BEND_MAX_PER, RATE_MAX_PER};
use crate::table::{LATE, Tdma, TimeSlot, cycles};
use response::{Ahead, Never, Stream, Supply, Window};
use rohrpost_mailbox::Priority;
use std::time::Duration;

/// A package published later than this before a slot may have to wait for the next one.
pub const TAKEN_BEFORE: Duration = Duration::from_micros(100);
/// A package that waits longer in a router is dropped.
const LONGEST: Duration = Duration::from_millis(1500);

/// The longest delay of a flow's packages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FlowBound {
    /// The flow, by its place in [`Plan::flows`].
    pub flow: usize,
    /// The level on which it waits in its node's router, see [`Network::level`](crate::Network::level).
    pub level: u8,
    /// From publishing to the arrival of the last bit at the other node, at most.
    pub latency: Result<Bound, Unbounded>,
}

/// The worst case of a flow, and what it consists of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bound {
    /// All of it.
    pub latency: Duration,
    /// The slot in which the package leaves in that case, by its place in [`Tdma::slots`].
    pub slot: usize,
    /// From publishing to the beginning of that slot.
    pub waits: Duration,
    /// Slots of its node that begin until then, that one included.
    pub slots: u64,
    /// Time for packages of other flows before it.
    pub others: Duration,
    /// Packages of its own flow that leave before it.
    pub own_earlier: u64,
    /// Time for the routers' own messages at the beginning of a slot.
    pub said: Duration,
    /// Its own datagrams.
    pub own: Duration,
    /// Number of these.
    pub datagrams: u64,
    /// The last datagram once more, from a switch to the other node.
    pub forward: Duration,
}

/// Why a flow has no bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unbounded {
    /// Its priority is below `bulk-below`, so that it waits behind everything, ordinary traffic included.
    #[error("it is not real time")]
    NotRealTime,
    /// No slot of its node has room for a datagram of it, or of a package before it.
    #[error("a datagram has no room in any slot of its node")]
    TooShort,
    /// The demand exceeds the capacity.
    #[error(
        "with all that goes before it, it asks for {asked_permille} thousandths of the time, and the slots carry \
         {carried_permille}"
    )]
    TooMuch {
        /// Demand of this flow and all before it, in thousandths of the link's time.
        asked_permille: u64,
        /// Guaranteed capacity of the slots, in the same unit.
        carried_permille: u64,
    },
    /// Packages would be dropped before they leave.
    #[error("it may wait longer than the 1.5 s after which routers drop packages")]
    TooLong,
}

impl Plan {
    /// The bounds of all flows between nodes with this table, in their order.
    pub fn bounds(&self, tdma: &Tdma) -> Vec<FlowBound> {
        (0..self.flows.len()).filter_map(|flow| self.bound(tdma, flow)).collect()
    }

    /// The bound of a flow with this table.
    pub(crate) fn bound(&self, tdma: &Tdma, flow: usize) -> Option<FlowBound> {
        let own = self.flows[flow]?;
        let level = self.network.level(own.least);
        let latency = if level == LEVEL_NOT_REAL_TIME {
            Err(Unbounded::NotRealTime)
        } else {
            let all = self.flows.iter().enumerate().filter(|(index, _)| *index != flow);
            let others = all.filter_map(|(_, other)| {
                let other = other.as_ref()?;
                let ahead = other.ahead_of(&own, |priority| self.network.level(priority))?;
                Some((other.stream(&self.link), ahead))
            });
            let others: Vec<_> = others.collect();
            worst(tdma, &self.link, &own, &others)
        };
        Some(FlowBound { flow, level, latency })
    }

    /// Parts of replicas, of full length, that the slots of a node carry in a second behind all of its flows, for sure,
    /// in thousandths.
    pub fn parts_left(&self, tdma: &Tdma, node: u8) -> u64 {
        let own = self.flows.iter().flatten().filter(|flow| flow.node == node);
        let streams: Vec<_> = own.map(|flow| flow.stream(&self.link)).collect();
        supply(tdma, &self.link, node).leaves(&streams, self.link.largest_ns())
    }

    /// Records of full size that the slots carry in a second for sure, if no other replica of the node sends any.
    pub fn records_left(&self, tdma: &Tdma, replica: &PlannedReplica) -> f64 {
        self.parts_left(tdma, replica.node) as f64 / (1000 * replica.parts(&self.link)) as f64
    }

    /// The least time in which a record of full size leaves, to all nodes that have the replica.
    pub fn record_least(&self, tdma: &Tdma, replica: &PlannedReplica) -> Duration {
        let supply = supply(tdma, &self.link, replica.node);
        Duration::from_nanos(supply.least_ns(replica.parts(&self.link), self.link.largest_ns()))
    }
}

fn worst(tdma: &Tdma, link: &Link, own: &PlannedFlow, others: &[(Stream, Ahead)]) -> Result<Bound, Unbounded> {
    let supply = supply(tdma, link, own.node);
    if supply.windows.is_empty() {
        return Err(Unbounded::TooShort);
    }
    let longest_ns = ns(LONGEST);
    let worst = response::worst(&supply, &own.stream(link), others, longest_ns).map_err(|never| match never {
        Never::NoRoom => Unbounded::TooShort,
        Never::Overload { asked_ns_s, carried_ns_s } => Unbounded::TooMuch {
            asked_permille: asked_ns_s.div_ceil(1_000_000),
            carried_permille: carried_ns_s / 1_000_000,
        },
        Never::Late => Unbounded::TooLong,
    })?;
    let parcel = link.package(own.size as usize);
    Ok(Bound {
        latency: Duration::from_nanos(worst.latency_ns + parcel.forward_ns),
        slot: supply.windows[worst.window].slot,
        waits: Duration::from_nanos(worst.waits_ns),
        slots: worst.slots,
        others: Duration::from_nanos(worst.others_ns),
        own_earlier: worst.own_earlier,
        said: Duration::from_nanos(supply.said_ns),
        own: Duration::from_nanos(parcel.takes_ns),
        datagrams: parcel.datagrams,
        forward: Duration::from_nanos(parcel.forward_ns),
    })
}

/// What the slots of a node have room for.
fn supply(tdma: &Tdma, link: &Link, node: u8) -> Supply {
    let is_own = |slot: &&TimeSlot| slot.node == node;
    let cycles = cycles(tdma.slots.iter().filter(is_own));
    let own = tdma.slots.iter().enumerate().filter(|(_, slot)| is_own(slot));
    let window = |(index, slot): (usize, &TimeSlot), cycle: u64| Window {
        begin_ns: cycle * ns(tdma.cycle) + ns(slot.offset),
        sends_ns: ns(slot.length.saturating_sub(tdma.guard)),
        slot: index,
    };
    let windows = (0..cycles).flat_map(|cycle| {
        let there = own.clone().filter(move |(_, slot)| slot.is_in(cycle));
        there.map(move |slot| window(slot, cycle))
    });
    Supply {
        windows: windows.collect(),
        repeats_ns: cycles * ns(tdma.cycle),
        said_ns: link.said_ns(tdma),
        taken_before_ns: ns(TAKEN_BEFORE),
        late_ns: ns(LATE),
        bends_ns_s: (1_000_000_000 / BEND_MAX_PER + 1_000_000_000 / RATE_MAX_PER).into(),
    }
}

impl PlannedFlow {
    fn stream(&self, link: &Link) -> Stream {
        let parcel = link.package(self.size as usize);
        Stream {
            period_ns: ns(self.period).max(1),
            takes_ns: parcel.takes_ns,
            datagrams: parcel.datagrams,
            largest_ns: parcel.largest_ns,
            end_ns: parcel.end_ns,
            last_ns: parcel.last_ns,
        }
    }

    /// How this one's packages stand to another's.
    fn ahead_of(&self, own: &Self, level: impl Fn(Priority) -> u8) -> Option<Ahead> {
        if self.node != own.node || level(self.most) > level(own.least) {
            return None;
        }
        // What is to another peer may leave in company of what is ahead; of one level the more important leave the
        // mailbox first.
        let is_beside = self.peer == own.peer && level(self.most) == level(own.least);
        Some(if is_beside && !self.most.outranks(own.least) { Ahead::Earlier } else { Ahead::Always })
    }
}

fn ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
