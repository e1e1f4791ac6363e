//! Whether a slot table can be kept: who sends when, and whether there is room for what must be sent.

use super::{LATE, Tdma, TimeSlot, common};
use crate::bounds::{self, Unbounded};
use crate::flow::Flow;
use crate::installation::Installation;
use crate::node::Node;
use crate::reader::Reader;
use crate::units::{duration_decimal, size_text};
use crate::wire::{KEPT_IN_BYTES, Link, RATE_MAX_PER};
use std::time::Duration;

/// Clocks of two Linux computers that ask each other all the time are known to half of it.
const GUARD_MIN: Duration = Duration::from_micros(40);
/// A node that joins takes frames of time to arrive within half of the guard: this part of it for the links, as much for the computers. It is off
/// by as much at most, earlier or later.
const ARRIVES_WITHIN: u32 = 4;
/// Peers take a node of which nothing came for a second for silent: it has two chances in that time to say that it is there.
const SLOT_WITHIN: Duration = Duration::from_millis(500);
/// Who examines all cycles of a table must come to an end.
const CYCLES_MAX: u64 = 64;

/// Judges the table, then whether every flow keeps its deadline with it.
pub(crate) fn judge(installation: &Installation, reader: &Reader<'_>) {
    let (Some(tdma), Some(network)) = (&installation.tdma, &installation.network) else { return };
    let link = Link::new(tdma, network, installation.lan_nodes());
    let judge = Judge { installation, tdma, link, reader };
    judge.guard();
    judge.synchronisation();
    judge.periods();
    judge.places();
    judge.lengths();
    judge.joining();
    judge.silence();
    judge.nodes();
    if reader.is_content() {
        judge.periods_of_flows();
    }
    if reader.is_content() {
        judge.flows();
    }
    if reader.is_content() {
        judge.quotas();
    }
}

struct Judge<'a> {
    installation: &'a Installation,
    tdma: &'a Tdma,
    link: Link,
    reader: &'a Reader<'a>,
}

impl Judge<'_> {
    fn report(&self, slot: &TimeSlot, message: impl std::fmt::Display) {
        let at = duration_decimal(slot.offset);
        let node = &self.installation.nodes[usize::from(slot.node)].name;
        self.reader.report(slot.line, format!("[[slot]] of `{node}` at {at} {message}"));
    }

    fn masters(&self) -> &[u8] {
        self.installation.time.masters()
    }

    fn report_table(&self, message: impl std::fmt::Display) {
        self.reader.report(self.tdma.line, format!("[tdma]: {message}"));
    }

    fn guard(&self) {
        let guard = self.tdma.guard;
        // From a node to a switch and on. What the node takes before that is not in it: of eight frames the quickest counts, and from the call
        // to the wire that takes some microseconds, not the 20 that bounds are computed with.
        let way = Duration::from_nanos(2 * self.link.time_wire_ns());
        let least = round_up(GUARD_MIN.max(way * ARRIVES_WITHIN));
        if guard >= least {
            return;
        }
        let why = if guard < GUARD_MIN {
            "is less than clocks of Linux computers are known to be off each other".into()
        } else {
            let way = duration_decimal(round_up(way));
            format!(
                "is too short for such a link: who joins takes it that a frame of time passes two links within a quarter of it, and that takes \
                 {way}"
            )
        };
        let (guard, least) = (duration_decimal(guard), duration_decimal(least));
        self.report_table(format!("`guard` {guard} {why}; write `guard = \"{least}\"` or more"));
    }

    fn synchronisation(&self) {
        let Tdma { cycle, synchronisation, guard, .. } = self.tdma;
        let others = self.installation.lan_nodes().len() - 1;
        let frames = Duration::from_nanos(2 * others as u64 * self.link.time_ns());
        let needed = round_up(*guard + LATE + frames);
        if *synchronisation < needed {
            self.report_table(format!(
                "`synchronisation` {} has no room for a warm-up and a Sync to each of {others} other nodes before its guard; write \
                 `synchronisation = \"{}\"` or more",
                duration_decimal(*synchronisation),
                duration_decimal(needed)
            ));
        }
        let masters = self.masters().len() as u32;
        let end = *synchronisation * masters;
        if end >= *cycle {
            self.report_table(format!(
                "the synchronisation windows of {masters} masters, {} each, leave nothing of the cycle of {}; write a longer `cycle`, or \
                 fewer `masters` in [time]",
                duration_decimal(*synchronisation),
                duration_decimal(*cycle)
            ));
        }
    }

    fn periods(&self) {
        let cycles = self.tdma.cycles();
        if cycles > CYCLES_MAX {
            let longest = self.tdma.slots.iter().max_by_key(|slot| slot.period).map_or(1, |slot| slot.period);
            self.report_table(format!(
                "slots with such periods come together again after {cycles} cycles, and it may be {CYCLES_MAX}; write periods that divide each \
                 other, such as {} in place of {longest}",
                longest.next_power_of_two().min(CYCLES_MAX as u32)
            ));
        }
    }

    /// Who joins knows the time by a Sync alone, so that it may be off by a quarter of the guard, and by what its clock has drifted since: it
    /// must be sure to half of the guard until its slot ends, or it never asks for more.
    fn joining(&self) {
        let guard = self.tdma.guard;
        for slot in &self.tdma.slots {
            let end = slot.offset + slot.length;
            let least = round_up(end / RATE_MAX_PER * ARRIVES_WITHIN);
            if guard < least {
                let known = duration_decimal(guard / ARRIVES_WITHIN + end / RATE_MAX_PER);
                let end = duration_decimal(end);
                self.report(slot, format!(
                    "ends {end} after the cycle begins, and until then a node that joins knows the time to {known} only, which is more than half of \
                     the guard: it could never send; put it earlier, or write `guard = \"{}\"` or more in [tdma]",
                    duration_decimal(least)
                ));
            }
        }
    }

    /// Each node sends often enough that nobody takes it for silent.
    fn silence(&self) {
        let pause = |slot: &TimeSlot| self.tdma.cycle * slot.period;
        for node in 0..self.installation.lan_nodes().len() {
            let own = self.tdma.slots.iter().filter(|slot| usize::from(slot.node) == node);
            let Some(slot) = own.min_by_key(|slot| slot.period).filter(|slot| pause(slot) > SLOT_WITHIN) else {
                continue;
            };
            let most = SLOT_WITHIN.as_nanos() / self.tdma.cycle.as_nanos().max(1);
            let right =
                if most > 0 { format!("write `period = {most}` or less") } else { "write a shorter `cycle`".into() };
            self.report(slot, format!(
                "comes once in {}, and none of that node sooner: others would take it for silent in between; {right}",
                duration_decimal(pause(slot))
            ));
        }
    }

    /// Each slot lies in the cycle, behind synchronisation, and alone.
    fn places(&self) {
        let Tdma { cycle, synchronisation, slots, .. } = self.tdma;
        let begin = *synchronisation * self.masters().len() as u32;
        for slot in slots {
            let end = slot.offset + slot.length;
            if slot.offset < begin {
                let masters = self.masters().len();
                let windows = if masters == 1 {
                    "the synchronisation window of the master, which ends".into()
                } else {
                    format!("the synchronisation windows of {masters} masters, which end")
                };
                let begin = duration_decimal(begin);
                self.report(slot, format!("lies in {windows} at {begin}; write `offset = \"{begin}\"` or later"));
            }
            if slot.offset >= *cycle {
                let right = duration_decimal(cycle.saturating_sub(slot.length));
                let cycle = duration_decimal(*cycle);
                self.report(
                    slot,
                    format!("begins when the cycle of {cycle} is over; write `offset = \"{right}\"` or earlier"),
                );
            } else if end > *cycle {
                let (over, right) = (duration_decimal(end - *cycle), duration_decimal(*cycle - slot.offset));
                self.report(
                    slot,
                    format!(
                        "ends {over} after the cycle does; write `length = \"{right}\"`, or begin it {over} earlier"
                    ),
                );
            }
        }
        for (first, second) in self.tdma.collisions() {
            let (first, second) = (&slots[first], &slots[second]);
            let end = first.offset + first.length;
            let cycles = self.tdma.cycles();
            let both = (0..cycles).find(|cycle| first.is_in(*cycle) && second.is_in(*cycle));
            let when = both.filter(|_| cycles > 1).map(|cycle| format!(", in cycle {cycle} of {cycles}"));
            let shorter = second.offset - first.offset;
            let or_shorter = if shorter < self.tdma.length_min(self.installation, &self.link) {
                String::new()
            } else {
                format!(", or `length = \"{}\"` there", duration_decimal(shorter))
            };
            self.report(
                second,
                format!(
                    "begins {} before {} ends{}; write `offset = \"{}\"` or later{or_shorter}",
                    duration_decimal(end - second.offset),
                    self.tdma.whose(first, &self.installation.nodes),
                    when.unwrap_or_default(),
                    duration_decimal(end)
                ),
            );
        }
    }

    fn lengths(&self) {
        let needed = self.tdma.length_min(self.installation, &self.link);
        for slot in self.tdma.slots.iter().filter(|slot| slot.length < needed) {
            let (length, guard) = (duration_decimal(slot.length), duration_decimal(self.tdma.guard));
            let lacking = duration_decimal(needed - slot.length);
            let what = if slot.length <= self.tdma.guard {
                format!("is {length} long, all of it guard: nobody ever sends in the last {guard} of a slot")
            } else {
                format!(
                    "is {length} long, {guard} of it guard, which leaves no room for what routers say to each other and one largest datagram"
                )
            };
            self.report(slot, format!("{what}; lengthen it by {lacking}: `length = \"{}\"`", duration_decimal(needed)));
        }
    }

    /// Each node has a slot.
    fn nodes(&self) {
        let has_one = |index: u8| self.tdma.slots.iter().any(|slot| slot.node == index);
        for (node, index) in self.installation.lan_nodes().iter().zip(0..).filter(|(_, index)| !has_one(*index)) {
            let master = if self.masters().contains(&index) { ", although it may be master of time" } else { "" };
            let needed = self.tdma.length_min(self.installation, &self.link);
            let gap = self.tdma.gaps(self.masters()).into_iter().find(|(_, free)| *free >= needed);
            let right = gap.map_or_else(
                || format!("no {} of the cycle are free for one: shorten others", duration_decimal(needed)),
                |(offset, _)| {
                    let (offset, length) = (duration_decimal(offset), duration_decimal(needed));
                    format!(
                        "add a [[slot]]: `node = \"{}\"`, `offset = \"{offset}\"`, `length = \"{length}\"`",
                        node.name
                    )
                },
            );
            let message = format!("node `{}` has no slot{master}, so it can send nothing; {right}", node.name);
            self.reader.report(node.line, message);
        }
    }

    /// No flow publishes so quickly that a package could not even be sure of a slot that begins when the next one comes.
    fn periods_of_flows(&self) {
        let node = |name| self.installation.node_of(name);
        let is_too_quick = |flow: &Flow| flow.period < bounds::TAKEN_BEFORE && node(flow.from) != node(flow.to);
        let flows = self.installation.flows.iter().enumerate();
        for (index, flow) in flows.filter(|(_, flow)| is_too_quick(flow)) {
            let right = bounds::slower(self.installation, self.tdma, index, is_too_quick).map_or_else(
                || "a longer `period`".into(),
                |period| format!("`period = \"{}\"`", duration_decimal(period)),
            );
            let text = |name| self.installation.classes.format(name);
            let message = format!(
                "[[flow]] from `{}` to `{}`: `period` {} is less than the {} that a package must be there before its slot, and a cycle is {}; put \
                 what comes meanwhile into one package, and write {right}",
                text(flow.from),
                text(flow.to),
                duration_decimal(flow.period),
                duration_decimal(bounds::TAKEN_BEFORE),
                duration_decimal(self.tdma.cycle)
            );
            self.reader.report(flow.line, message);
        }
    }

    /// Each flow keeps its deadline.
    fn flows(&self) {
        for bound in bounds::bounds(self.installation) {
            let flow = &self.installation.flows[bound.flow];
            let deadline = duration_decimal(flow.deadline);
            let why = match bound.latency {
                Ok(bound) if bound.latency <= flow.deadline => continue,
                Ok(bound) => format!(
                    "a package may take {}, and must be there within {deadline}",
                    duration_decimal(round_up(bound.latency))
                ),
                Err(why) => format!("nothing says that a package is there within {deadline}: {why}"),
            };
            let right = match bound.latency {
                Err(Unbounded::NotRealTime) => {
                    "give the module that sends or subscribes a class from `bulk-below` of [network] up".into()
                }
                _ => bounds::remedy(self.installation, self.tdma, bound.flow),
            };
            let text = |name| self.installation.classes.format(name);
            let what = format!("[[flow]] from `{}` to `{}`", text(flow.from), text(flow.to));
            self.reader.report(flow.line, format!("{what}: {why}; {right}"));
        }
    }

    /// Of each flow one package may wait: it is there before the next. All those of a module have room, since what gives way has no bound.
    fn quotas(&self) {
        let quota = self.installation.network.map_or(usize::MAX, |network| network.quota_bytes) as u64;
        let flows = bounds::bounds(self.installation).into_iter().map(|bound| &self.installation.flows[bound.flow]);
        let flows: Vec<_> = flows.collect();
        for module in &self.installation.modules {
            let own = || flows.iter().filter(|flow| module.names().any(|name| name == flow.from));
            let bytes: u64 = own().map(|flow| kept_bytes(flow.size)).sum();
            if let Some(flow) = own().next().filter(|_| bytes > quota) {
                let message = format!(
                    "[[flow]]s of `{}`: {} of them may wait at once, and its router keeps {} of a sender; write `quota = \"{}\"` in \
                     [network]",
                    self.installation.classes.format(module.name),
                    size_text(bytes.next_multiple_of(1 << 10)),
                    size_text(quota),
                    size_text(bytes.next_power_of_two())
                );
                self.reader.report(flow.line, message);
            }
        }
    }
}

/// What a router takes of a quota for a body.
fn kept_bytes(body_bytes: u32) -> u64 {
    u64::from(body_bytes).next_multiple_of(KEPT_IN_BYTES).max(KEPT_IN_BYTES)
}

/// Up to ten microseconds, as people write.
fn round_up(duration: Duration) -> Duration {
    Duration::from_micros(duration.as_nanos().div_ceil(10_000) as u64 * 10)
}

impl Tdma {
    /// A slot as messages name it.
    pub(crate) fn whose(&self, slot: &TimeSlot, nodes: &[Node]) -> String {
        let node = nodes.get(usize::from(slot.node)).map_or("?", |node| node.name.as_str());
        format!("that of `{node}` at {} (line {})", duration_decimal(slot.offset), slot.line)
    }

    /// What a slot needs at least: its guard, what routers say to each other, and a largest datagram.
    pub(crate) fn length_min(&self, installation: &Installation, link: &Link) -> Duration {
        let said_ns = link.said_ns(self, installation.lan_nodes().len(), installation.time.masters().len());
        round_up(self.guard + LATE + Duration::from_nanos(said_ns + link.largest_ns()))
    }

    /// Slots that are there at the same time, the one that begins first before the other.
    pub(crate) fn collisions(&self) -> Vec<(usize, usize)> {
        let slots = self.slots.iter().enumerate();
        let pairs = slots.flat_map(|(first, a)| {
            let later = self.slots.iter().enumerate().skip(first + 1);
            later.filter(|(_, b)| a.meets(b) && a.offset + a.length > b.offset).map(move |(second, _)| (first, second))
        });
        pairs.collect()
    }

    /// How long a slot may be, at most.
    pub(crate) fn free_behind(&self, slot: &TimeSlot) -> Duration {
        let next = self.slots.iter().filter(|next| next.offset > slot.offset && next.meets(slot));
        let end = next.map(|next| next.offset).min().unwrap_or(self.cycle);
        end.saturating_sub(slot.offset)
    }

    /// What is nobody's in any cycle: where it begins, and for how long.
    pub(crate) fn gaps(&self, masters: &[u8]) -> Vec<(Duration, Duration)> {
        let mut free_from = self.synchronisation * masters.len() as u32;
        let mut gaps = Vec::new();
        let ends = self.slots.iter().map(|slot| (slot.offset, slot.offset + slot.length));
        for (begin, end) in ends.chain([(self.cycle, self.cycle)]) {
            if begin > free_from {
                gaps.push((free_from, begin - free_from));
            }
            free_from = free_from.max(end);
        }
        gaps
    }
}

impl TimeSlot {
    /// Whether there are cycles with both.
    fn meets(&self, other: &Self) -> bool {
        let apart = u64::from(self.phase.abs_diff(other.phase));
        apart.is_multiple_of(common(self.period.into(), other.period.into()))
    }
}
