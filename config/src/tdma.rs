//! The table of time slots, sections `[tdma]` and `[[slot]]`.

mod validate;

pub(crate) use validate::validate;

use crate::node::{self, Node};
use crate::reader::{Item, Section};
use rohrpost_network::{Tdma, TimeSlot, Tunnel};
use std::net::Ipv4Addr;
use std::ops::RangeInclusive;
use std::time::Duration;

const CYCLE: Duration = Duration::from_millis(5);
/// With a shorter cycle a Linux computer often wakes up too late; with a longer one packages wait for too long. A cycle
/// of more than half a second, in which nodes take each other for silent, is reported with other mistakes of the table.
const CYCLES: RangeInclusive<Duration> = Duration::from_millis(1)..=Duration::from_secs(1);
const SYNCHRONISATION: Duration = Duration::from_micros(500);
const GUARD: Duration = Duration::from_micros(150);
const LINK_BITS_S: u64 = 100_000_000;
const LINKS: RangeInclusive<u64> = 1_000_000..=100_000_000_000;
/// Longest period of the table in cycles: checks of all of them must end.
const PERIODS: RangeInclusive<u32> = 1..=64;
/// A network of so many bits leaves addresses for a node at least, and for all at most.
const PREFIXES: RangeInclusive<u8> = 8..=30;

fn read_tunnel(item: &Item<'_>, nodes: &[Node]) -> Option<Tunnel> {
    let text = item.text("10.78.0.0/24")?;
    let parts = text.split_once('/');
    let parts = parts.and_then(|(network, prefix)| Some((network.parse().ok()?, prefix.parse().ok()?)));
    let Some((network, prefix)): Option<(Ipv4Addr, u8)> = parts.filter(|(_, prefix)| PREFIXES.contains(prefix)) else {
        item.report(format!(
            "`tunnel` \"{text}\" is no IPv4 network of {} to {} bits; write for example `tunnel = \"10.78.0.0/24\"`",
            PREFIXES.start(),
            PREFIXES.end()
        ));
        return None;
    };
    let hosts = u32::MAX >> prefix;
    let begin = Ipv4Addr::from_bits(network.to_bits() & !hosts);
    if begin != network {
        item.report(format!("`tunnel` \"{text}\" is an address inside its network; write \"{begin}/{prefix}\""));
    }
    // The last one means all of them.
    if nodes.len() >= hosts as usize {
        item.report(format!(
            "`tunnel` \"{text}\" has {} addresses for {} nodes; write a larger one, such as \"10.78.0.0/24\"",
            hosts - 1,
            nodes.len()
        ));
    }
    let is_inside = |node: &&Node| {
        node.address.is_some_and(|address| match address {
            std::net::IpAddr::V4(v4) => v4.to_bits() & !hosts == begin.to_bits(),
            std::net::IpAddr::V6(_) => false,
        })
    };
    if let Some(node) = nodes.iter().find(is_inside) {
        item.report(format!(
            "`tunnel` \"{text}\" holds the address of node `{}`, where the slots themselves go; write a network of \
                 its own, such as \"10.78.0.0/24\"",
            node.name
        ));
    }
    Some(Tunnel { network: begin, prefix })
}

/// Lines in the file.
pub(crate) struct TdmaLines {
    /// Line of the section.
    table: usize,
    /// Lines of its slots, in their order.
    slots: Vec<usize>,
}

/// The table of a file, if its nodes send in time slots.
pub(crate) fn read(file: &Section<'_>, slots: Vec<Section<'_>>, nodes: &[Node]) -> Option<(Tdma, TdmaLines)> {
    let mode = file.section("network", "[network]").and_then(|network| network.get("mode"));
    let is_tdma = mode.map_or(Some(false), |item| item.choice(&[("free", false), ("tdma", true)]));
    let section = file.section("tdma", "[tdma]");
    // Consequences of a wrong word are not reported.
    if !is_tdma? {
        for unused in section.iter().chain(&slots) {
            unused.report("time slots go only with `mode = \"tdma\"` in [network]; write that there, or drop this");
        }
        return None;
    }
    let Some(section) = section else {
        file.report(
            "section `[tdma]` is missing; with `mode = \"tdma\"` add `[tdma]` with `cycle = \"5 ms\"` and `link = \
                 \"100 Mbit/s\"`, and a `[[slot]]` for each node",
        );
        return None;
    };
    let cycle = section.required("cycle", "cycle = \"5 ms\"").and_then(|item| read_cycle(&item));
    let link = section.required("link", "link = \"100 Mbit/s\"");
    let link = link.and_then(|item| item.rate(LINKS, "100 Mbit/s")).unwrap_or(LINK_BITS_S);
    let synchronisation = section.or("synchronisation", SYNCHRONISATION, |item| item.duration_above_zero("500 us"));
    let guard = section.or("guard", GUARD, |item| item.duration_above_zero("150 us"));
    let tunnel = section.get("tunnel").and_then(|item| read_tunnel(&item, nodes));
    let mut slots: Vec<_> = slots.into_iter().filter_map(|slot| read_slot(slot, nodes)).collect();
    slots.sort_by_key(|(slot, _)| (slot.offset, slot.phase));
    let (slots, slot_lines) = slots.into_iter().unzip();
    let lines = TdmaLines { table: section.line, slots: slot_lines };
    section.finish();
    let cycle = cycle.unwrap_or(CYCLE);
    let tdma = Tdma { cycle, synchronisation, guard, link_bytes_s: link / 8, slots, tunnel };
    Some((tdma, lines))
}

/// The part that must be equal at both ends of the wire.
pub(crate) fn lan_text(tdma: &Tdma) -> String {
    let slot = |slot: &TimeSlot| {
        let (offset, length) = (slot.offset.as_nanos(), slot.length.as_nanos());
        format!(" slot {} {offset} {length} {} {}", slot.node, slot.period, slot.phase)
    };
    let tunnel = tdma.tunnel.map_or("-".into(), |tunnel| format!("{}/{}", tunnel.network, tunnel.prefix));
    format!(
        "tdma cycle {} synchronisation {} guard {} link {} tunnel {tunnel}{}",
        tdma.cycle.as_nanos(),
        tdma.synchronisation.as_nanos(),
        tdma.guard.as_nanos(),
        tdma.link_bytes_s,
        tdma.slots.iter().map(slot).collect::<String>()
    )
}
fn read_cycle(item: &Item<'_>) -> Option<Duration> {
    let cycle = item.duration("5 ms")?;
    if CYCLES.contains(&cycle) {
        return Some(cycle);
    }
    item.report("`cycle` is from \"1 ms\" to \"500 ms\"; write for example `cycle = \"5 ms\"`");
    None
}

fn read_slot(section: Section<'_>, nodes: &[Node]) -> Option<(TimeSlot, usize)> {
    let node = section.required("node", "node = \"base\"").and_then(|item| read_node(&item, nodes));
    let offset = section.required("offset", "offset = \"1 ms\"").and_then(|item| item.duration("1 ms"));
    let length = section.required("length", "length = \"500 us\"");
    let length = length.and_then(|item| item.duration_above_zero("500 us"));
    let period = section.get("period").map_or(Some(1), |item| item.whole(PERIODS, 1));
    let phase = section.get("phase").map(|item| (item.whole(0..=*PERIODS.end() - 1, 0), item));
    if let (Some(period), Some((Some(read), item))) = (period, &phase)
        && *read >= period
    {
        item.report(if period == 1 {
            format!(
                "`phase` {read} says in which of several cycles the slot is, but it is in each; write `period \
                         = {}` or more, or drop `phase`",
                read + 1
            )
        } else {
            format!(
                "`phase` is {read}, but of {period} cycles the last is {}; write 0 to {}, or a longer \
                         `period`",
                period - 1,
                period - 1
            )
        });
    }
    let line = section.line;
    section.finish();
    let phase = phase.map_or(Some(0), |(phase, _)| phase);
    let (node, offset, length) = (node?, offset?, length?);
    Some((TimeSlot { node, offset, length, period: period?, phase: phase? }, line))
}
fn read_node(item: &Item<'_>, nodes: &[Node]) -> Option<u8> {
    let text = item.text("base")?;
    node::place(nodes, text).inspect_err(|missing| item.report(format!("`node`: {missing}"))).ok()
}
