//! Each part of the incoming half.

mod incarnations;
mod names;
mod pair;
mod ports;
mod refusals;

use super::order::Order;
use super::window::{Arrival, SequenceWindow};
use super::*;
use crate::harness::{End, MS, S, START, head, module};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

#[test]
fn a_window_knows_gaps_and_copies() {
    use Arrival::{Duplicate, Newest, Reordered, Returned};
    let mut window = SequenceWindow::joining(3);
    let mut lost_in_all = 0;
    for (sequence, arrival, lost, why) in [
        (3, Newest, 0, "the first"),
        (0, Reordered, 0, "both have just begun"),
        (3, Duplicate, 0, "came before"),
        (5, Newest, 0, "a gap"),
        (4, Reordered, 0, "closes it"),
        (4, Duplicate, 0, "once"),
        (70, Newest, 3, "1, 2 and 6 are given up: the last is 64 behind"),
        (2, Returned, 0, "late, but not a copy"),
        (2, Duplicate, 0, "once"),
        (7, Reordered, 0, "may still come"),
        (2000, Newest, 1937 - 7 - 2, "a window is skipped: all from 7 to 1936 but 7 and 70"),
        (977, Returned, 0, "the oldest of which is known whether it came"),
        (976, Duplicate, 0, "cannot be told"),
        (1999, Reordered, 0, "may still come"),
    ] {
        let mut more = 0;
        assert_eq!(window.arrive(sequence, &mut more), arrival, "{sequence}: {why}");
        assert_eq!(more, lost, "{sequence}: {why}");
        lost_in_all += more;
    }
    assert_eq!((window.next(), lost_in_all), (2001, 3 + 1928));
    assert_eq!((window.tick(), window.tick()), (0, 0));
    assert_eq!(window.tick(), 62, "1937 to 1998");
    assert_eq!(window.close(), 0);
}

#[test]
fn a_router_that_joins_late_misses_nothing_sent_before() {
    let mut lost = 0;
    let mut window = SequenceWindow::joining(5000);
    assert_eq!(window.arrive(5000, &mut lost), Arrival::Newest);
    assert_eq!(window.arrive(4999, &mut lost), Arrival::Reordered);
    let mut window = SequenceWindow::going_on(5000);
    assert_eq!(window.arrive(4999, &mut lost), Arrival::Duplicate);
    assert_eq!((window.arrive(5000, &mut lost), lost, window.close()), (Arrival::Newest, 0, 0));
    let mut window = SequenceWindow::default();
    window.arrive(5000, &mut lost);
    assert_eq!((lost, window.close()), (5000 - 63, 63), "a restarted peer's are ours from the first on");
}

#[test]
fn what_is_older_than_what_was_delivered_is_late() {
    let mut order = Order::default();
    let (a, b) = (head(module(50, 0), module(60, 1), 90), head(module(50, 0), module(61, 1), 90));
    let urgent = Head { priority: rohrpost_mailbox::Priority(91), ..a };
    for (head, sequence, index, admitted, why) in [
        (a, 5, 0, true, "the first"),
        (a, 5, 1, true, "behind it in the same datagram"),
        (b, 4, 0, true, "another sender"),
        (a, 4, 0, false, "older"),
        (urgent, 4, 0, true, "another priority"),
        (a, 5, 0, false, "older by its place"),
        (a, 6, 0, true, "newer"),
        (b, 5, 0, true, "newer"),
    ] {
        assert_eq!(order.admit(&head, position(sequence, index)), admitted, "{why}");
    }
    order.clear();
    assert!(order.admit(&a, position(0, 0)), "another incarnation counts anew");
}

use rohrpost_mailbox::Head;

#[test]
fn a_full_table_costs_packages_but_not_the_order() {
    let mut order = Order::default();
    let flow = |n: u32| Head { from: rohrpost_mailbox::Name::from_raw(0x0100_0000 + n), ..Head::default() };
    // Many more flows than there are places.
    (0..4000).for_each(|n| assert!(order.admit(&flow(n), position(1000 + u64::from(n), 0))));
    let again: usize = (0..4000).filter(|n| order.admit(&flow(*n), position(999, 0))).count();
    assert_eq!(again, 0, "nothing older than what was delivered, also of flows that were forgotten");
}

/// A large package, then packages of many flows, then its last fragment.
#[test]
fn a_package_in_parts_is_late_only_if_something_newer_of_its_flow_went_before_it() {
    let (mut base, mut arm) = (End::new(0, |_| {}), End::new(1, incarnations::quick));
    let large = head(module(50, 0), module(200, 1), 90);
    arm.queue(START, large, &[1; 4000]);
    let parts: Vec<_> = arm.leave(START).into_iter().map(|(_, part)| part).collect();
    let (last, others) = parts.split_last().unwrap();
    others.iter().for_each(|part| base.take(START, 1, part));
    for flow in 0..900 {
        let other = head(module(50, 0).with_local(2 + (flow % 250) as u8), module(100, 1), (flow / 250) as u8);
        base.take(START, 1, &arm.send(START, other, b"", true).unwrap().1);
    }
    base.take(START, 1, last);
    assert_eq!(base.log.delivered.len(), 901, "nothing of its flow was delivered after it began");
    // A package of a used place is late, even when the place is long forgotten.
    arm.queue(START, large, &[2; 4000]);
    let parts: Vec<_> = arm.leave(START).into_iter().map(|(_, part)| part).collect();
    base.take(START, 1, &parts[0]);
    base.take(START, 1, &arm.send(START, large, b"newer", true).unwrap().1);
    parts[1..].iter().for_each(|part| base.take(START, 1, part));
    assert_eq!(base.log.causes(), [crate::counts::Cause::Late]);
    base.assert_balanced();
}

proptest! {
    #[test]
    fn a_window_does_what_a_set_does(
        jumps in prop::collection::vec(prop_oneof![8 => -100i64..40, 1 => -1500i64..1500], 1..400),
    ) {
        let (mut window, mut came, mut lost) = (SequenceWindow::default(), BTreeSet::new(), 0);
        let (mut at, mut returned) = (0i64, 0);
        for jump in jumps {
            at = (at + jump).max(0);
            let sequence = at as u64;
            let next = came.last().map_or(0, |last| last + 1);
            let arrival = window.arrive(sequence, &mut lost);
            let known = sequence + WINDOW >= next && !came.contains(&sequence);
            prop_assert_eq!(arrival == Arrival::Duplicate, !known, "{}", sequence);
            returned += u64::from(arrival == Arrival::Returned);
            if known {
                came.insert(sequence);
            }
            at = at.max(window.next() as i64 - 1500);
        }
        lost += window.close();
        prop_assert_eq!(came.len() as u64 + lost - returned, window.next(), "each came or is lost");
    }

    #[test]
    fn nothing_is_ever_delivered_after_something_newer(
        packages in prop::collection::vec((0u32..600, 0u64..2000, 0u16..3), 1..500),
    ) {
        let (mut order, mut last) = (Order::default(), BTreeMap::new());
        for (flow, sequence, index) in packages {
            let head = Head { to: rohrpost_mailbox::Name::from_raw(flow), ..Head::default() };
            if order.admit(&head, position(sequence, index)) {
                let before = last.insert(flow, (sequence, index));
                prop_assert!(before < Some((sequence, index)));
            }
        }
    }
}
