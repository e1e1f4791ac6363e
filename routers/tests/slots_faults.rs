//! Time slots behind a bridge that delays, and with a clock that drifts.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "slots_common/mod.rs"]
mod common;

use common::kept::{assert_inside, assert_kept, validate};
use common::relay::Relay;
use common::talk::{Listeners, PAUSE, talk, talkers};
use common::{Capture, MASTERS, NODES, PATIENCE, Segment, Station, label, name};
use rohrpost_mailbox::monotonic_ns;
use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_routers::frame::FrameKind;
use rohrpost_routers::shell::Failure;
use rohrpost_routers::tdma::Silent;
use rohrpost_testbed::report;
use rohrpost_testbed::stalls::{Late, unless_stalled};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const ALL: [u8; NODES as usize] = [0, 1, 2];
/// The clocks of two computers differ by at most so much, and their rates change by less than this swing brings: 470
/// ppb in a second.
const DRIFT_PPB: i64 = 100_000;
const SWING_PPB: f64 = 1500.0;
const DRIFTS: Duration = Duration::from_secs(5);
/// A slow bridge takes so long for each frame: more than any slot lasts, and than clocks may be off.
const HELD_BACK: Duration = Duration::from_millis(2);
/// With this it is 100 µs further off after five seconds.
const DRIFT_NS_S_MAX: u64 = 20_000;

/// From then on it can go by its own clock for seconds.
fn knows_its_rate(station: &Station) -> bool {
    station.clock().record.drift_ns_s < DRIFT_NS_S_MAX
}

#[test]
fn a_slave_with_a_drifting_clock_keeps_its_slots() {
    let Some(mut segment) = Segment::at_rest(None) else { return };
    let Segment { stations, lab, .. } = &mut segment;
    stations[2].skew.rate_ppb = DRIFT_PPB;
    stations[2].skew.wander_ppb = SWING_PPB;
    stations.iter_mut().for_each(|station| station.start(lab));
    segment.wait_until_all_send();
    let (mut listeners, began) = (Listeners::new(&segment), Instant::now());
    let capture = Capture::start(&segment.lab);
    let off_ppb = || (segment.stations[2].clock().rate_ppb.abs() - DRIFT_PPB).abs();
    // A new master is measured anew.
    while began.elapsed() < DRIFTS || off_ppb() >= 2 * SWING_PPB as i64 {
        assert!(began.elapsed() < PATIENCE, "its rate is {} ppb off", off_ppb());
        talk(&segment, &mut listeners, &ALL, 100);
    }
    assert_kept("two clocks that drift", &segment, 0, &capture.end());
}

#[test]
fn behind_a_bridge_that_delays_by_more_than_the_guard_allows_a_node_is_silent_and_says_why() {
    let Some(mut segment) = Segment::at_rest(None) else { return };
    let Segment { stations, lab, .. } = &mut segment;
    stations[2].late = Some("delay=2ms,jitter=500us,seed=7".parse().unwrap());
    stations.iter_mut().for_each(|station| station.start(lab));
    let capture = Capture::start(lab);
    segment.wait_until("node 2 knows the time too badly", |segment| {
        let (clock, slots) = (segment.stations[2].clock(), segment.stations[2].slots());
        clock.exchanges > 5 && matches!(slots.silent, Some(Silent::BoundTooLarge { .. }))
    });
    let mut listeners = Listeners::new(&segment);
    talk(&segment, &mut listeners, &[0, 1], 100);
    let crossed = capture.end();
    let speaks = |kind| matches!(kind, FrameKind::Alive | FrameKind::Packages);
    assert!(crossed.iter().any(|frame| frame.from == 2), "it asks for the time");
    assert!(!crossed.iter().any(|frame| frame.from == 2 && speaks(frame.kind)), "and says nothing else");

    // The bridge is as quick as others again.
    let Segment { stations, lab, .. } = &mut segment;
    stations[2].shell = None;
    stations[2].late = None;
    stations[2].start(lab);
    segment.wait_until_all_send();
    talk(&segment, &mut listeners, &ALL, 50);
}

#[test]
fn behind_a_bridge_that_becomes_slow_a_node_keeps_its_slots_and_loses_nothing() {
    unless_stalled(|_| {
        let Some(segment) = Segment::start() else { return Ok(()) };
        let mut listeners = Listeners::new(&segment);
        segment.wait_until_all_send();
        segment.wait_until("node 2 knows its rate", |segment| knows_its_rate(&segment.stations[2]));
        goes_on_behind_a_slow_bridge(&segment, &mut listeners)?;
        segment.wait_until_all_send();
        talk(&segment, &mut listeners, &ALL, 50);
        Ok(())
    });
}

/// The time of another master that began meanwhile could not be measured from behind such a bridge.
fn goes_on_behind_a_slow_bridge(segment: &Segment, listeners: &mut Listeners) -> Result<(), Late> {
    const ROUNDS: u16 = 300;
    let since_ns = monotonic_ns();
    let mut talkers = talkers(segment, &ALL);
    listeners.acquaint(&mut talkers);
    let capture = Capture::start(&segment.lab);
    let relay = Relay::start(segment, 2, HELD_BACK, |_| false);
    listeners.say_all(&mut talkers, 0..ROUNDS);
    let silent = segment.stations[2].slots().silent;
    let replaced = || ALL.into_iter().find_map(|node| segment.replaced(node, since_ns));
    // What the relay holds when it ends is lost.
    listeners.hear_all_unless(segment, &ALL, 0..ROUNDS, || replaced().is_some());
    assert!(relay.end() > 300, "data and time take that way");
    let crossed = capture.end();
    if let Some(late) = replaced() {
        let turned_ns = ALL.into_iter().filter_map(|node| segment.own_log(node).turned_ns(since_ns)).min();
        let before = &crossed[..crossed.partition_point(|frame| Some(frame.at_ns) < turned_ns)];
        assert_inside("until another was master", segment, &validate(before, segment.time_of(0)));
        return Err(late);
    }
    assert_kept("behind a slow bridge", segment, 0, &crossed);
    assert_eq!(silent, None);
    Ok(())
}

#[test]
fn a_master_with_arriving_packages_is_not_replaced_for_missing_syncs() {
    unless_stalled(|_| Segment::start().map_or(Ok(()), |segment| stays_master_without_syncs(&segment)));
}

/// The master stays one while it speaks, and its Syncs do not reach the backup.
fn stays_master_without_syncs(segment: &Segment) -> Result<(), Late> {
    segment.wait_until_all_send();
    let heard_of = || segment.stations[2].clock().master;
    segment.wait_until("there is a master", |_| heard_of().is_some());
    let since_ns = monotonic_ns();
    let master = heard_of().unwrap();
    let backup = &segment.stations[usize::from(MASTERS[0] + MASTERS[1] - master)];
    segment.wait_until("the backup follows, and knows its rate", |_| {
        backup.clock().master == Some(master) && knows_its_rate(backup)
    });
    let (stood_in, term) = (|| backup.slots().counts.syncs.replacements_sent, backup.clock().term);
    let (is_over, began) = (AtomicBool::new(false), stood_in());
    let mut talkers = talkers(segment, &[master, backup.own]);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let _ = schedule(Scheduling::Fifo(1));
            let since = Instant::now();
            for id in (0..).take_while(|_| !is_over.load(Ordering::Relaxed) && since.elapsed() < PATIENCE) {
                talkers.iter_mut().for_each(|talker| talker.say(id));
                std::thread::sleep(PAUSE);
            }
        });
        // Without another sign of life the backup would take over after three cycles.
        let relay = Relay::start(segment, backup.own, Duration::ZERO, |head| head.kind == FrameKind::Sync);
        segment
            .wait_until("it has stood in for many cycles", |_| stood_in() > began + 6 || backup.clock().term != term);
        let clock = backup.clock();
        assert!(relay.end() > 0);
        is_over.store(true, Ordering::Relaxed);
        segment.replaced(backup.own, since_ns).map_or(Ok(()), Err)?;
        assert_eq!((clock.master, clock.term), (Some(master), term));
        Ok(())
    })
}

/// Has a node's device changed by `tc`; false where that is not possible.
fn shape(segment: &Segment, node: u8, words: &str) -> bool {
    let mut command = Command::new("tc");
    let command = command.args(words.split(' ')).stderr(Stdio::null());
    segment.lab.command(&name(node), command).is_ok_and(|mut tc| tc.wait().unwrap().success())
}

#[test]
fn what_a_device_does_not_take_is_counted_and_nobody_waits_for_it() {
    let Some(segment) = Segment::start() else { return };
    segment.wait_until_all_send();
    // A thousandth of what `link` says.
    if !shape(&segment, 2, "qdisc add dev lan root tbf rate 1mbit burst 1600 limit 10000000") {
        return report::skipped("a device that is too slow (`tc` with tbf)");
    }
    let (mut listeners, slow) = (Listeners::new(&segment), &segment.stations[2]);
    let full = || slow.shell().failures().of(Failure::Full);
    let (mut flood, mut id, began) = (slow.sender(1), 0, Instant::now());
    while full() < 100 {
        assert!(began.elapsed() < PATIENCE, "all is taken: {:?}", slow.slots());
        // What finds no room in the router's mailbox comes a little later.
        if flood.send(&label(2, 100, id), &[&[7; 1000]]).is_err() {
            std::thread::sleep(Duration::from_micros(200));
        }
        id = id.wrapping_add(1);
    }
    let used = slow.slots().counts.used;
    talk(&segment, &mut listeners, &[0, 1], 50);
    segment.wait_until("it goes on with its slots", |segment| segment.stations[2].slots().counts.used > used);
    assert!(shape(&segment, 2, "qdisc del dev lan root"));
    talk(&segment, &mut listeners, &[0, 2], 50);
}
