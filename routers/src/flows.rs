//! Declared flows that leave a node, and the measured delays of their packages.
//!
//! ```text
//!  published ──▶ transit mailbox ─▶ queue ─▶ slot ─▶ handed over ──▶ wire ──▶ switch ──▶ last bit at the receiver
//!     └───────────── by the sender's clock ─────────────┘ └──── lead, bytes of the link ───┘
//! ```
//!
//! The sending router measures the delay that `check` computes a bound for. So one clock suffices, and packages without
//! a stamp, such as commands, are measured as well. Without time slots no link is known, and the time ends with the
//! handover.

use crate::counts::{Cause, Count};
use crate::latencies::Latencies;
use rohrpost_config::{Contents, Installation, Module, bounds};
use rohrpost_mailbox::{Head, Kind, Latency, Name};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// A flow from a module of this node to one of another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flow {
    /// The sending module: the declared name first, then the others of its process.
    pub from: Vec<Name>,
    /// The receiving module, in the same way.
    pub to: Vec<Name>,
    /// What it carries, if that is declared.
    pub carries: Option<Contents>,
    /// Bytes of a body, at most.
    pub size: u32,
    /// Shortest time from one package to the next.
    pub period: Duration,
    /// Time within which a package has to arrive.
    pub deadline: Duration,
    /// Guaranteed arrival; none without a guarantee.
    pub bound: Option<Duration>,
}

impl Flow {
    /// All flows that leave a node, in their order in the file.
    pub(crate) fn all_from(installation: &Installation, node: &str) -> Vec<Self> {
        let bounds = bounds(installation);
        let flow = |(index, flow): (usize, &rohrpost_config::Flow)| {
            let (from, to) = (installation.module(flow.from)?, installation.module(flow.to)?);
            let bound = bounds.iter().find(|bound| bound.flow == index);
            // Traffic through the TCP router never comes to this one.
            let on_lan = installation.lan_index(&to.node).is_some();
            (from.node == node && to.node != node && on_lan).then(|| Self {
                from: names(flow.from, from),
                to: names(flow.to, to),
                carries: flow.carries,
                size: flow.size,
                period: flow.period,
                deadline: flow.deadline,
                bound: bound.and_then(|bound| bound.latency.ok()).map(|bound| bound.latency),
            })
        };
        installation.flows.iter().enumerate().filter_map(flow).collect()
    }

    fn entries(&self, flow: u16) -> impl Iterator<Item = FlowEntry> {
        let pairs = self.from.iter().flat_map(|from| self.to.iter().map(move |to| (from, to)));
        pairs.enumerate().map(move |(place, (from, to))| FlowEntry {
            ends: (from.module().raw(), to.module().raw()),
            carries: self.carries,
            is_other: place > 0,
            size: self.size,
            period_ns: ns(self.period),
            flow,
        })
    }
}

/// All names of a module, the declared one first.
fn names(declared: Name, module: &Module) -> Vec<Name> {
    std::iter::once(declared).chain(module.names().filter(|name| *name != declared)).collect()
}

/// Counters of a flow's packages since the router began.
#[derive(Debug)]
pub struct FlowCounts {
    deadline_ns: u64,
    bound_ns: u64,
    latency: Latencies,
    /// The slowest package with all slots kept, ns.
    kept_worst_ns: AtomicU64,
    /// Packages that took longer than the bound.
    pub over_bound: Count,
    /// Those with all slots kept: there should be none.
    pub kept_over_bound: Count,
    /// Packages that took longer than the deadline.
    pub over_deadline: Count,
    lost: [Count; Cause::ALL.len()],
}

impl FlowCounts {
    fn new(flow: &Flow) -> Self {
        Self {
            deadline_ns: ns(flow.deadline),
            bound_ns: flow.bound.map_or(u64::MAX, ns),
            latency: Latencies::default(),
            kept_worst_ns: AtomicU64::new(0),
            over_bound: Count::default(),
            kept_over_bound: Count::default(),
            over_deadline: Count::default(),
            lost: Default::default(),
        }
    }

    /// Delays of sent packages.
    pub fn latency(&self) -> Latency {
        self.latency.get()
    }

    /// Delay of the slowest package with all slots kept: the bound is about these.
    pub fn kept_worst(&self) -> Duration {
        Duration::from_nanos(self.kept_worst_ns.load(Ordering::Relaxed))
    }

    /// Packages lost in this router for a cause.
    pub fn lost(&self, cause: Cause) -> u64 {
        self.lost[cause as usize].get()
    }

    /// Packages lost in this router for any cause.
    pub fn lost_in_all(&self) -> u64 {
        self.lost.iter().map(Count::get).sum()
    }

    fn took(&self, took_ns: u64, kept: bool) {
        self.latency.note(took_ns);
        self.over_bound.add(u64::from(took_ns > self.bound_ns));
        if kept {
            // One thread writes.
            let worst_ns = self.kept_worst_ns.load(Ordering::Relaxed).max(took_ns);
            self.kept_worst_ns.store(worst_ns, Ordering::Relaxed);
            self.kept_over_bound.add(u64::from(took_ns > self.bound_ns));
        }
        self.over_deadline.add(u64::from(took_ns > self.deadline_ns));
    }
}

/// All flows of a router, and the assignment of packages to them.
#[derive(Debug)]
pub struct Flows {
    /// By the names of both ends, then by what they carry (undeclared first), size and period.
    entries: Box<[FlowEntry]>,
    counts: Box<[FlowCounts]>,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct FlowEntry {
    ends: (u32, u32),
    carries: Option<Contents>,
    /// By another name than the declared one.
    is_other: bool,
    size: u32,
    period_ns: u64,
    flow: u16,
}

impl Flows {
    pub(crate) fn new(flows: &[Flow]) -> Self {
        let entries = flows.iter().zip(0..).flat_map(|(flow, index)| flow.entries(index));
        let mut entries: Vec<FlowEntry> = entries.collect();
        entries.sort_unstable();
        // The other names of a process share the flows that are declared for it, unless they have their own.
        let declared: Vec<_> = entries.iter().filter(|entry| !entry.is_other).map(|entry| entry.ends).collect();
        entries.retain(|entry| !entry.is_other || declared.binary_search(&entry.ends).is_err());
        Self { entries: entries.into(), counts: flows.iter().map(FlowCounts::new).collect() }
    }

    /// The counts of all flows, in their order in the settings.
    pub fn counts(&self) -> &[FlowCounts] {
        &self.counts
    }

    /// The flow of a package. Among several between the same modules, the one that declares its type is chosen, then
    /// the one that declares its kind. If none does, a flow without such a declaration: the smallest that holds the
    /// package. Among those of one size, replies belong to the rarest, and all else to the most frequent.
    pub(crate) fn of(&self, head: &Head) -> Option<u16> {
        let ends = (head.from.module().raw(), head.to.module().raw());
        let behind = &self.entries[self.entries.partition_point(|entry| entry.ends < ends)..];
        let between = &behind[..behind.partition_point(|entry| entry.ends == ends)];
        let (unsaid, said) = between.split_at(between.partition_point(|entry| entry.carries.is_none()));
        let carrying = |contents| said.iter().find(|entry| entry.carries == Some(contents));
        let exact = Contents::of(head.kind.kind());
        let carrying = exact.and_then(|exact| carrying(exact).or_else(|| carrying(exact.without_number())));
        carrying.or_else(|| by_size(unsaid, head)).map(|entry| entry.flow)
    }

    /// `kept`: no slot was left out since its publishing.
    pub(crate) fn took(&self, flow: u16, took_ns: u64, kept: bool) {
        self.counts[usize::from(flow)].took(took_ns, kept);
    }

    pub(crate) fn lost(&self, head: &Head, cause: Cause) {
        if let Some(flow) = self.of(head) {
            self.counts[usize::from(flow)].lost[cause as usize].add(1);
        }
    }
}

/// Among flows without a declaration of what they carry.
fn by_size<'a>(entries: &'a [FlowEntry], head: &Head) -> Option<&'a FlowEntry> {
    let largest = entries.last()?;
    let size = entries.iter().map(|entry| entry.size).find(|size| *size >= u32::from(head.len));
    let size = size.unwrap_or(largest.size);
    let mut fitting = entries.iter().filter(|entry| entry.size == size);
    if matches!(head.kind.kind(), Kind::Reply(_)) { fitting.next_back() } else { fitting.next() }
}

fn ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::{flow, head, module};
    use rohrpost_mailbox::Type;

    #[test]
    fn flows_of_one_pair_are_told_apart_by_size_and_then_by_kind() {
        let ms = Duration::from_millis;
        let (laser, wheels, pilot, alias) = (module(200, 0), module(201, 0), module(50, 1), module(51, 1));
        let mut flows = [
            flow(laser, pilot, 800),
            flow(laser, pilot, 64),
            flow(laser, pilot, 64),
            flow(pilot, laser, 8),
            flow(pilot, wheels, 8),
        ];
        flows[1].period = ms(900);
        flows[0].to.push(alias);
        flows[3].to.push(wheels);
        let flows = Flows::new(&flows);
        let (data, reply) = (Type::data(1), Type::reply(16));
        for (from, to, kind, len, expected, why) in [
            (laser, pilot, data, 700, Some(0), "the one that holds it"),
            (laser, pilot.with_local(1), data, 65, Some(0), "whichever mailbox of the module"),
            (laser, pilot, data, 64, Some(2), "the more frequent"),
            (laser, pilot.with_local(1), reply, 10, Some(1), "the rarer"),
            (laser, pilot, data, 900, Some(0), "larger than declared"),
            (laser, alias, data, 10, Some(0), "declared for all names of the process"),
            (pilot, laser, data, 1, Some(3), "the other way is another"),
            (pilot, wheels, data, 1, Some(4), "declared for this name"),
            (laser, module(52, 1), data, 1, None, "not declared"),
            (wheels, pilot, data, 1, None, "not declared either"),
        ] {
            let head = Head { len, kind, ..head(to, from, 90) };
            assert_eq!(flows.of(&head), expected, "{why}");
        }
    }

    #[test]
    fn flows_of_one_pair_and_one_size_are_told_apart_by_what_they_carry() {
        use Contents::{Command, Data, Reply};
        let (laser, pilot, planner) = (module(200, 0), module(50, 1), module(52, 1));
        let carrying = |to, carries, size| Flow { carries, ..flow(laser, to, size) };
        let flows = Flows::new(&[
            carrying(pilot, Some(Data(Some(2))), 64),
            carrying(pilot, Some(Data(Some(1))), 64),
            carrying(pilot, Some(Reply(None)), 64),
            carrying(pilot, None, 800),
            carrying(pilot, Some(Reply(Some(16))), 64),
            carrying(pilot, None, 16),
            carrying(planner, Some(Data(None)), 64),
            carrying(planner, Some(Command(Some(16))), 64),
        ]);
        for (to, kind, len, expected, why) in [
            (pilot, Type::data(1), 64, Some(1), "this data"),
            (pilot, Type::data(2), 64, Some(0), "and that"),
            (pilot, Type::data(2), 900, Some(0), "whatever its size"),
            (pilot, Type::reply(16), 64, Some(4), "this reply, though a flow carries all replies"),
            (pilot, Type::reply(1), 64, Some(2), "no reply of a number of its own"),
            (pilot, Type::data(3), 10, Some(5), "what none carries, by size"),
            (pilot, Type::command(1), 64, Some(3), "a command, which none carries, by size"),
            (planner, Type::data(7), 10, Some(6), "any data"),
            (planner, Type::command(16), 10, Some(7), "this command"),
            (planner, Type::command(17), 10, None, "another command is of none"),
            (planner, Type::reply(16), 10, None, "nor is a reply"),
            (planner, Type::default(), 10, None, "nor what has no type"),
        ] {
            let head = Head { len, kind, ..head(to, laser, 90) };
            assert_eq!(flows.of(&head), expected, "{why}");
        }
    }
}
