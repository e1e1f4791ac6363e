//! The table, and the inverse of the line, against their definitions.

use super::world::{CYCLE, HEADS, MASTERS, MS, US, table, tdma};
use crate::tdma::{SlotTable, Window, WindowKind};
use crate::time::TimeEstimate;
use proptest::prelude::*;
use rohrpost_mailbox::{TimeRecord, TimeSource};
use rohrpost_network::{Tdma, TimeSlot};
use std::time::Duration;

const NODES: u8 = 4;

/// A table without overlap: places one behind the other, each taken by one slot or shared by slots of different phases.
fn any_tdma() -> impl Strategy<Value = (Tdma, Vec<u8>)> {
    let place = (0..60_u64, 200..500_u64, 1..5_u32, prop::collection::vec(prop::option::of(0..NODES), 1..5));
    (prop::collection::vec(place, 1..6), 0..3_usize, 160..400_u64, 0..150_u64).prop_map(
        |(places, masters, synchronisation_us, guard_us)| {
            let masters: Vec<u8> = [2, 0, 3][..masters + 1].to_vec();
            let mut at_us = masters.len() as u64 * synchronisation_us;
            let mut slots = Vec::new();
            for (gap_us, length_us, period, owners) in places {
                at_us += gap_us;
                let (offset, length) = (Duration::from_micros(at_us), Duration::from_micros(length_us));
                for (phase, node) in (0..period).zip(owners) {
                    slots.extend(node.map(|node| TimeSlot { node, offset, length, period, phase }));
                }
                at_us += length_us;
            }
            let tdma = Tdma {
                cycle: Duration::from_micros(at_us + 7),
                synchronisation: Duration::from_micros(synchronisation_us),
                guard: Duration::from_micros(guard_us),
                link_bytes_s: 12_500_000,
                slots,
                tunnel: None,
            };
            (tdma, masters)
        },
    )
}

/// All windows of a node that begin in a span, by asking for one after the other.
fn windows(table: &SlotTable, from_ns: u64, to_ns: u64) -> Vec<Window> {
    let next = |from_ns| table.next_window(from_ns).filter(|window| window.begin_ns < to_ns);
    std::iter::successors(next(from_ns), |window| next(window.begin_ns + 1)).collect()
}

proptest! {
    #[test]
    fn windows_of_all_nodes_lie_one_behind_the_other(
        (tdma, masters) in any_tdma(),
        cycles in 0..1_000_000_u64,
        shift_ns in 0..10 * MS,
    ) {
        let cycle_ns = tdma.cycle.as_nanos() as u64;
        let from_ns = cycles * cycle_ns + shift_ns;
        let to_ns = from_ns + 13 * cycle_ns;
        let mut all = Vec::new();
        for own in 0..NODES {
            let table = SlotTable::new(&tdma, &masters, own, NODES, HEADS);
            let own_windows = windows(&table, from_ns, to_ns);
            let slots = own_windows.iter().filter(|window| matches!(window.kind, WindowKind::Slot { .. })).count();
            prop_assert_eq!(table.slots_between(from_ns, to_ns), slots as u64);
            for window in own_windows {
                // The view from the wire agrees.
                for (at_ns, is_guard) in [(window.begin_ns, false), (window.end_ns - 1, false), (window.end_ns, true)] {
                    let owner = table.owner(at_ns).filter(|owner| owner.is_guard == is_guard || tdma.guard.is_zero());
                    let seen = owner.map(|owner| (owner.node, owner.window));
                    if tdma.guard.is_zero() && is_guard {
                        continue;
                    }
                    prop_assert_eq!(seen, Some((own, window)), "at {}", at_ns);
                }
                all.push((own, window));
            }
        }
        all.sort_by_key(|(_, window)| window.begin_ns);
        for pair in all.windows(2) {
            let [(_, before), (_, after)] = pair else { unreachable!() };
            let guard_ns = tdma.guard.as_nanos() as u64;
            prop_assert!(before.end_ns + guard_ns <= after.begin_ns, "{:?} {:?}", before, after);
        }
        // Complete: each owned moment lies in a window that was found, unless it is at the edges.
        let owners = (from_ns + cycle_ns..to_ns - cycle_ns).step_by(97_000);
        let any = SlotTable::new(&tdma, &masters, 0, NODES, HEADS);
        for owner in owners.filter_map(|at_ns| any.owner(at_ns)) {
            prop_assert!(all.contains(&(owner.node, owner.window)), "{:?}", owner);
        }
    }

    #[test]
    fn the_inverse_of_a_line_is_exact(
        monotonic_ns in 0..1_u64 << 50,
        system_ns in 1_u64 << 40..1 << 61,
        pace_ppb in prop_oneof![Just(1_000_000_000_u64), 990_000_000..1_010_000_000_u64],
        away_ns in -1_000_000_000_000..1_000_000_000_000_i64,
    ) {
        let source = TimeSource::Master;
        let record = TimeRecord { epoch: 1, source, monotonic_ns, system_ns, pace_ppb, error_ns: 0, drift_ns_s: 0 };
        let line = TimeEstimate::new(record);
        let wanted_ns = system_ns.saturating_add_signed(away_ns);
        let first_ns = line.first_ns(wanted_ns).unwrap();
        prop_assert!(line.system_ns(first_ns) >= wanted_ns);
        prop_assert!(first_ns == 0 || line.system_ns(first_ns - 1) < wanted_ns);
        if first_ns > 0 {
            let last_ns = line.last_ns(wanted_ns).unwrap();
            prop_assert!(line.system_ns(last_ns) <= wanted_ns && line.system_ns(last_ns + 1) > wanted_ns);
        }
    }

    #[test]
    fn a_datagram_of_the_largest_size_that_fits_takes_no_longer(for_ns in 0..2_000_000_u64) {
        let table = table(0);
        let wire = table.wire();
        match wire.datagram_bytes_in(for_ns) {
            Some(bytes) => prop_assert!(wire.ns(bytes) <= for_ns && wire.ns(bytes + 1) > for_ns),
            None => prop_assert!(wire.ns(0) > for_ns),
        }
    }
}

#[test]
fn moments_have_owners() {
    let table = table(0);
    for (at_us, node, is_guard, why) in [
        (0, Some(0), false, "a cycle begins with the first master"),
        (149, Some(0), false, "the last microsecond before its guard"),
        (150, Some(0), true, "its guard"),
        (300, Some(1), false, "the second master's window"),
        (600, Some(0), false, "the edge belongs to the next owner"),
        (1_949, Some(2), false, "the last slot"),
        (2_100, None, false, "nobody's"),
        (3_000, None, false, "not in this cycle"),
        (3_000 + 5_000, Some(2), false, "each third cycle has another"),
    ] {
        let owner = table.owner(3 * CYCLE + at_us * US);
        assert_eq!(owner.map(|owner| owner.node), node, "{at_us} µs: {why}");
        assert!(owner.is_none_or(|owner| owner.is_guard == is_guard), "{at_us} µs: {why}");
    }
}

#[test]
fn windows_end_where_their_guard_begins() {
    let window = table(0).next_window(7 * CYCLE).unwrap();
    let expected = Window {
        kind: WindowKind::Synchronisation { rank: 0 },
        cycle: 7,
        begin_ns: 7 * CYCLE,
        end_ns: 7 * CYCLE + 150 * US,
    };
    assert_eq!(window, expected);
    let slot = table(2).next_slot(7 * CYCLE + 2 * MS).unwrap();
    assert_eq!((slot.begin_ns, slot.end_ns), (7 * CYCLE + 3 * MS, 7 * CYCLE + 3_250 * US));
}

#[test]
fn time_takes_what_the_table_says() {
    // 150 µs, of which 50 are for a late beginning; 20 µs for each frame.
    let many = |nodes| SlotTable::new(&tdma(), &MASTERS, 0, nodes, HEADS).for_clock();
    assert!(many(2).warm_ups && many(2).replies_in_synchronisation, "one other node");
    assert!(many(3).warm_ups && !many(3).replies_in_synchronisation, "two others");
    assert!(!many(4).warm_ups, "three others");
    assert_eq!(table(0).wire().ns(108), 13_920);
    assert_eq!(table(0).wire().bytes(0), 84, "a packet is filled up to 46 bytes");
}
