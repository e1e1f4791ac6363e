//! Explains time slots: a drawing of the cycle, the slots, the bounds of the flows, and what is left for replicas.

use super::{Page, timeline};
use crate::flow::Flow;
use crate::plan::{bounds, plan};
use crate::units::{duration_decimal, duration_text, rate_text, size_about, size_text};
use rohrpost_network::{Bound, FlowBound, GATE, LATE, Tdma, TimeSlot, round_up};
use std::time::Duration;

/// Below it some slots begin too late for their successors; see the book's chapter.
const GUARD_USUAL: Duration = Duration::from_micros(100);

impl Page<'_> {
    pub(super) fn slots(&mut self) {
        let Some(tdma) = &self.installation.tdma else { return };
        let masters = self.installation.time.masters();
        self.title("Time slots. A node sends in its own only; a cycle begins at each multiple of its length.");
        self.entry("cycle", &cycle(tdma));
        let (guard, late) = (duration_text(tdma.guard), duration_text(LATE));
        let mut words = format!(
            "the last {guard} of each slot, so that clocks may be off {} each",
            duration_decimal(tdma.guard / 2)
        );
        if tdma.guard < GUARD_USUAL {
            words += &format!(
                "; note: short for a computer without real-time kernel, better {}",
                duration_text(GUARD_USUAL)
            );
        }
        self.entry("guard", &words);
        let gate = duration_text(GATE);
        let words = format!("a slot noticed more than {gate} too late is left unused; bounds allow {late}");
        self.entry("late", &words);
        let names: Vec<&str> = masters.iter().map(|index| self.node_name(*index)).collect();
        let window = duration_text(tdma.synchronisation);
        self.entry("synchronised", &format!("in {window} at the beginning for each master: {}", names.join(", ")));
        if let Some(tunnel) = tdma.tunnel {
            let words = format!("ordinary traffic of {}/{}, behind all packages", tunnel.network, tunnel.prefix);
            self.entry("tunnel", &words);
        }
        self.line("");
        for row in timeline::rows(tdma, self.installation.lan_nodes(), masters) {
            self.line(row);
        }
        self.line("");
        self.table(tdma);
    }

    fn node_name(&self, index: u8) -> &str {
        self.installation.nodes.get(usize::from(index)).map_or("?", |node| node.name.as_str())
    }

    fn table(&mut self, tdma: &Tdma) {
        let width = self.installation.lan_nodes().iter().map(|node| node.name.len()).max().unwrap_or(0).max(4);
        self.line(format!("  {:width$}  {:>8}  {:>8}  {:>9}  there", "node", "offset", "length", "bytes"));
        for slot in &tdma.slots {
            let (offset, length) = (duration_decimal(slot.offset), duration_decimal(slot.length));
            let (node, bytes) = (self.node_name(slot.node), tdma.budget_bytes(slot.length));
            self.line(format!("  {node:width$}  {offset:>8}  {length:>8}  {bytes:>9}  {}", there(slot)));
        }
        self.line("bytes: what the link carries before the guard, the heads of Ethernet, IP and UDP counted.");
    }

    /// Whether all flows between nodes keep their deadlines, and which one is nearest to its own.
    pub(super) fn verdict(&mut self) {
        let bounds = bounds(self.installation);
        let all: Vec<(&FlowBound, &Flow)> =
            bounds.iter().map(|bound| (bound, &self.installation.flows[bound.flow])).collect();
        let worst = |bound: &FlowBound| bound.latency.as_ref().ok().map(|latency| latency.latency);
        let kept = all.iter().filter(|(bound, flow)| worst(bound).is_some_and(|worst| worst <= flow.deadline)).count();
        let share = |worst: Duration, flow: &Flow| worst.as_secs_f64() / flow.deadline.as_secs_f64();
        let tightest = all.iter().filter_map(|(bound, flow)| Some((worst(bound)?, *flow)));
        let Some((worst, flow)) = tightest.max_by(|a, b| share(a.0, a.1).total_cmp(&share(b.0, b.1))) else { return };
        let kept = if kept == all.len() { "kept".into() } else { format!("{} not kept", all.len() - kept) };
        let words = format!(
            "{} between nodes, {kept}; the tightest is {} → {}, at worst {} of {}",
            all.len(),
            self.name(flow.from),
            self.name(flow.to),
            round(worst),
            duration_decimal(flow.deadline)
        );
        self.entry("flows", &words);
    }

    /// The worst cases of flows.
    pub(super) fn at_worst(&mut self) {
        let bounds = bounds(self.installation);
        if bounds.is_empty() {
            return;
        }
        self.title("At worst, from publishing to the arrival at the other node; then a process has to wake up:");
        let flows: Vec<String> = bounds
            .iter()
            .map(|bound| {
                let flow = &self.installation.flows[bound.flow];
                let carries = flow.carries.map(|carries| format!(" {carries}")).unwrap_or_default();
                format!("{} → {}{carries}", self.name(flow.from), self.name(flow.to))
            })
            .collect();
        let width = flows.iter().map(|flow| flow.chars().count()).max().unwrap_or(0).max(4);
        let columns = "level   at worst     within  slots     waits    others    itself";
        self.line(format!("  {:width$}  {columns}", "flow"));
        for (bound, name) in bounds.iter().zip(flows) {
            let deadline = duration_decimal(self.installation.flows[bound.flow].deadline);
            let (worst, parts) = match &bound.latency {
                Ok(bound) => (round(bound.latency), parts(bound)),
                Err(why) => ("never".into(), why.to_string()),
            };
            self.line(format!("  {name:width$}  {:>5}  {worst:>9}  {deadline:>9}  {parts}", bound.level));
        }
        let said =
            bounds.iter().find_map(|bound| bound.latency.ok()).map(|bound| round(bound.said)).unwrap_or_default();
        self.entry(
            "",
            &format!(
                "slots: of its node that begin while it waits; waits: until the last of them; others: what goes before \
                 it meanwhile; itself: its own datagrams. In \"at worst\" besides: {said} said by routers in a slot, \
                 {} by which it may be begun late, what else is in the last datagram, and that once more through a \
                 switch.",
                duration_text(LATE)
            ),
        );
    }

    /// What replicas have of the slots.
    pub(super) fn replicas_in_slots(&mut self) {
        let Some(tdma) = &self.installation.tdma else { return };
        let Some(plan) = plan(self.installation, tdma) else { return };
        let all = plan.replicas.iter().zip(&self.installation.replicas);
        let all: Vec<_> = all.filter_map(|(planned, replica)| Some(((*planned)?, replica))).collect();
        let names: Vec<_> = all.iter().map(|(_, replica)| replica.text(self.installation)).collect();
        let Some(width) = names.iter().map(|name| name.chars().count()).max() else { return };
        self.title("Replicas have what packages leave of the slots of their node, the more important first:");
        let columns = "of node   left in 1 s    record  to   at least  records in 1 s";
        self.line(format!("  {:width$}  {columns}", "replica", width = width.max(7)));
        for ((planned, _), name) in all.into_iter().zip(names) {
            let left = plan.parts_left(tdma, planned.node);
            let bytes = size_about(left / 1000 * plan.link.part_bytes() as u64);
            let record = size_text(planned.record_bytes.into());
            let least = long(plan.record_least(tdma, &planned));
            let (node, receivers) = (self.node_name(planned.node), planned.receivers);
            let many = plan.records_left(tdma, &planned);
            self.line(format!(
                "  {name:width$}  {node:8}  {bytes:>11}  {record:>8}  {receivers:>2}  {least:>9}  {many:>14.2}",
                width = width.max(7)
            ));
        }
        self.entry(
            "",
            "left in 1 s: bytes of records that the slots carry for sure behind all declared flows; what is not \
             declared, and ordinary traffic through the tunnel, go before them as well. at least: the time of a record \
             of full size to all nodes that have it, if nothing else is sent. records in 1 s: so many of full size are \
             sure, if no other replica of the node sends any.",
        );
    }
}

/// Up to ten microseconds, or ten milliseconds if it is long.
fn long(duration: Duration) -> String {
    const HUNDREDTH_NS: u64 = 10_000_000;
    if duration < Duration::from_secs(1) {
        return round(duration);
    }
    let ns = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
    duration_decimal(Duration::from_nanos(ns.div_ceil(HUNDREDTH_NS).saturating_mul(HUNDREDTH_NS)))
}

/// Components of a bound, as columns.
fn parts(bound: &Bound) -> String {
    let (waits, others, own) = (round(bound.waits), round(bound.others), round(bound.own));
    format!("{:>5}  {waits:>8}  {others:>8}  {own:>8}", bound.slots)
}

fn cycle(tdma: &Tdma) -> String {
    let (length, link) = (duration_text(tdma.cycle), rate_text(tdma.link_bytes_s * 8));
    let used: u128 = tdma.slots.iter().map(|slot| slot.length.as_nanos() / u128::from(slot.period)).sum();
    let share = used * 100 / tdma.cycle.as_nanos().max(1);
    let repeats = match tdma.cycles() {
        1 => String::new(),
        cycles => format!("; the table repeats itself after {cycles} cycles"),
    };
    format!("{length}, of which slots take {share} %, on links of {link}{repeats}")
}

fn there(slot: &TimeSlot) -> String {
    let (period, phase) = (slot.period, slot.phase);
    if period == 1 {
        return "in each cycle".into();
    }
    format!("in cycles {phase}, {}, {}, …", phase + period, phase + 2 * period)
}

/// Up to ten microseconds.
fn round(duration: Duration) -> String {
    duration_decimal(round_up(duration))
}
