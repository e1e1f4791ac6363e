//! Delays and losses of packages of declared flows.

use super::slot::table;
use super::to;
use crate::counts::Cause;
use crate::flows::FlowCounts;
use crate::harness::{ENVELOPE, End, MS, START, flow, module};
use crate::outbound::{DIRECT_HEAD_BYTES, WAIT_MAX_NS};
use crate::settings::Settings;
use std::time::Duration;

/// From module 200 to module 50 of node 1: deadline 10 ms, bound 5 ms.
fn declare(settings: &mut Settings) {
    settings.flows = vec![flow(module(200, 0), module(50, 1), 6000)];
}

fn counts(end: &End) -> &FlowCounts {
    &end.stats.flows.counts()[0]
}

/// How many were sent, how long the slowest took, ms, how many took longer than the bound and the deadline, and how
/// many were lost.
fn assert_counts(end: &End, expected: (u64, u128, u64, u64, u64), why: &str) {
    let (counts, latency) = (counts(end), counts(end).latency());
    let late = (counts.over_bound.get(), counts.over_deadline.get());
    let found = (latency.count(), latency.max.as_millis(), late.0, late.1, counts.lost_in_all());
    assert_eq!(found, expected, "{why}");
}

#[test]
fn what_leaves_at_once_is_measured_when_it_has_left() {
    let mut end = End::new(0, declare);
    end.send(START, to(1, 90), b"at once", true).unwrap();
    assert!(end.outbound.is_measured());
    assert_counts(&end, (0, 0, 0, 0, 0), "nobody says that it has left");
    end.outbound.sent(START + 5 * MS);
    assert_counts(&end, (1, 5, 0, 0, 0), "as long as may be");
    end.outbound.sent(START + 99 * MS);
    assert_counts(&end, (1, 5, 0, 0, 0), "once");
    end.send(START, to(2, 90), b"of no flow", true).unwrap();
    assert!(!end.outbound.is_measured());
}

#[test]
fn each_package_of_a_datagram_is_measured_from_its_own_publishing() {
    let mut end = End::new(0, declare);
    for (at_ms, peer) in [(0, 1), (4, 1), (5, 2), (7, 1)] {
        end.queue(START + at_ms * MS, to(peer, 90), b"in company");
    }
    assert_eq!(end.poll(START + 8 * MS).map(|(peer, _)| peer), Ok(1));
    end.outbound.sent(START + 11 * MS);
    assert_counts(&end, (3, 11, 2, 1, 0), "11, 7 and 4 ms");
    assert_eq!(counts(&end).latency().sum, Duration::from_millis(22));
    assert_eq!(end.poll(START + 12 * MS).map(|(peer, _)| peer), Ok(2));
    assert!(!end.outbound.is_measured(), "that for the other peer is of no flow");
}

#[test]
fn a_package_in_parts_is_measured_with_its_last() {
    let mut end = End::new(0, declare);
    end.queue(START, to(1, 90), &[0; 3000]);
    for (part, is_last) in [(1, false), (2, false), (3, true)] {
        end.poll(START + part * MS).unwrap();
        assert_eq!(end.outbound.is_measured(), is_last, "part {part}");
        end.outbound.sent(START + part * MS);
    }
    assert_counts(&end, (1, 3, 0, 0, 0), "three parts, one package");
}

#[test]
fn a_datagram_that_is_held_for_another_slot_is_measured_with_its_later_time() {
    let mut end = End::new(0, |settings| {
        declare(settings);
        settings.tdma = Some(table(&[1000]));
    });
    end.queue(START, to(1, 90), b"made in one slot");
    let mut datagram = [0; 1472];
    let mut make =
        |end: &mut End, now_ns| end.outbound.poll_slot(now_ns, (1472, &mut datagram), None, &mut end.log).unwrap();
    make(&mut end, START + MS);
    // It missed the end. Until the next slot others come, and the waiting packages are checked.
    end.queue(START + 2 * MS, to(1, 90), b"came meanwhile");
    end.outbound.tidy(START + 3 * MS, &mut end.log);
    end.outbound.sent(START + 11 * MS);
    assert_counts(&end, (1, 11, 1, 1, 0), "the other one still waits");
    make(&mut end, START + 12 * MS);
    end.outbound.sent(START + 12 * MS);
    assert_counts(&end, (2, 11, 2, 1, 0), "now that too");
}

#[test]
fn what_is_lost_is_counted_with_its_cause_and_not_measured() {
    let mut end = End::new(0, declare);
    let (_, direct) = end.send(START, to(1, 90), &ENVELOPE, true).unwrap();
    end.outbound.unsent(&direct[..DIRECT_HEAD_BYTES], &ENVELOPE, &mut end.log);
    end.queue(START, to(1, 90), &[0; 3000]);
    let (_, part) = end.poll(START).unwrap();
    end.outbound.unsent(&part, &[], &mut end.log);
    end.queue(START, to(1, 90), b"waits too long");
    end.queue(START, to(2, 90), b"so does this, of no flow");
    end.hears(1, START + WAIT_MAX_NS);
    end.hears(2, START + WAIT_MAX_NS);
    end.leave(START + WAIT_MAX_NS + 1);
    assert_counts(&end, (0, 0, 0, 0, 3), "all three");
    assert_eq!([Cause::Socket, Cause::Stale].map(|cause| counts(&end).lost(cause)), [2, 1]);
}

#[test]
fn a_bound_says_nothing_of_what_was_published_before_a_slot_was_left_out() {
    let mut end = End::new(0, declare);
    // Peers get another keep-alive.
    end.leave(START + 10 * MS);
    for (published_ms, left_ms, kept) in [(10, 14, (4, 0)), (20, 28, (4, 0)), (26, 32, (6, 1)), (40, 43, (6, 1))] {
        end.queue(START + published_ms * MS, to(1, 90), b"one");
        end.poll(START + left_ms * MS).unwrap();
        if published_ms == 20 {
            end.outbound.slot_left_out(START + 26 * MS);
        }
        end.outbound.sent(START + left_ms * MS);
        let found = (counts(&end).kept_worst().as_millis(), counts(&end).kept_over_bound.get());
        assert_eq!(found, kept, "published after {published_ms} ms");
    }
    assert_counts(&end, (4, 8, 2, 0, 0), "all of them");
}
