//! A network with time slots is divided, and each part has a master and a time; when it is one again, it has one of
//! each.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "slots_common/mod.rs"]
mod common;

use common::kept::{assert_kept_by, validate};
use common::process::{Router, be_a_router};
use common::talk::{Listeners, talk, talkers};
use common::{Capture, Crossed, MASTERS, Segment, instant, name, table};
use rohrpost_mailbox::{Node, SystemClock, TimeRecord, TimeSource, monotonic_ns};
use rohrpost_routers::link::PeerLinkState;
use rohrpost_routers::time::Role;
use rohrpost_testbed::stalls::{Late, unless_stalled};
use std::sync::{Arc, Weak};
use std::thread::JoinHandle;
use std::time::Duration;

/// What the processes run.
const PROCESS: &str = "in_a_process_of_its_own";
/// Alone in its part, in this process and by the true clock. Nobody follows it, so it is the one to yield.
const LONELY: u8 = MASTERS[0];
/// The master of the other part, and its slave.
const OTHERS: [u8; 2] = [MASTERS[1], 2];
const ALL: [u8; 3] = [0, 1, 2];
/// So much faster is the clock of the other master: the two times part.
const FAST_PPB: i64 = 200_000;
/// When they are so far from each other, the windows of the one lie in those of others by the other.
const APART_NS: u64 = 1_300_000;
/// So many frames of the one lie outside of their slots by the time of the other, before the network is one again.
const FOREIGN: usize = 40;
/// So many cycles after the network is one again nobody sends any more by the time that is given up.
const HEALED_CYCLES: u32 = 16;

/// Reads the page of a node as long as somebody holds the other end: what it says goes back in no epoch.
fn watch_time(node: &Arc<Node>, held: Weak<()>) -> JoinHandle<()> {
    let clock = SystemClock::open(node);
    std::thread::spawn(move || {
        let mut before = clock.now();
        while held.upgrade().is_some() {
            let now = clock.now();
            assert!((now.epoch, now.ns) >= (before.epoch, before.ns), "from {before:?} to {now:?}");
            before = now;
            std::thread::sleep(Duration::from_micros(200));
        }
    })
}

/// Nodes keep in mind at which link addresses the others are. A kernel that hears nothing of one for some seconds asks
/// again, and after three questions sends nothing to it but one more each second: that is no matter of routers.
fn keep_neighbours(segment: &Segment) {
    for own in ALL {
        let _inside = segment.lab.enter(&name(own)).unwrap();
        std::fs::write("/proc/sys/net/ipv4/neigh/lan/delay_first_probe_time", "3600").unwrap();
    }
}

/// How much more than the true clock a master says with each of its Syncs, ns, if its clock is so fast.
fn ahead_ns(crossed: &[Crossed], master: u8, rate_ppb: i64) -> impl DoubleEndedIterator<Item = (u64, i128)> {
    let syncs = crossed.iter().filter(move |frame| frame.from == master).filter_map(|frame| Some((frame, frame.sync?)));
    syncs.map(move |(frame, sync)| {
        let true_ns = i128::from(frame.at_ns);
        (frame.at_ns, i128::from(sync.sent_ns) - true_ns - true_ns * i128::from(rate_ppb) / 1_000_000_000)
    })
}

/// The time of the master of the others: that of the Sync which took the least time from the call to the bridge.
fn time_of_others(crossed: &[Crossed]) -> TimeRecord {
    let (monotonic_ns, ahead_ns) = ahead_ns(crossed, OTHERS[0], FAST_PPB).max_by_key(|sync| sync.1).unwrap();
    let fast_ns = i128::from(monotonic_ns) * i128::from(FAST_PPB) / 1_000_000_000;
    TimeRecord {
        epoch: 1,
        source: TimeSource::Master,
        monotonic_ns,
        system_ns: (i128::from(monotonic_ns) + ahead_ns + fast_ns) as u64,
        pace_ppb: 1_000_000_000_u64.strict_add_signed(FAST_PPB),
        error_ns: 0,
        drift_ns_s: 0,
    }
}

/// How many frames lie outside of their senders' slots by this time.
fn foreign(crossed: &[Crossed], time: &TimeRecord) -> usize {
    validate(crossed, |at_ns| time.at(at_ns).ns).outside.len()
}

/// Whether both masters have spoken lately, by times that are so far from each other.
fn are_apart(crossed: &[Crossed]) -> bool {
    let last = |master| ahead_ns(crossed, master, 0).next_back();
    let off = last(LONELY).zip(last(OTHERS[0]));
    off.is_some_and(|((_, one_ns), (_, other_ns))| (one_ns - other_ns).unsigned_abs() > APART_NS.into())
}

#[test]
fn in_a_process_of_its_own() {
    be_a_router();
}

#[test]
fn of_two_masters_one_is_left_and_nobody_sends_by_the_time_that_was_given_up() {
    unless_stalled(|_| {
        let Some(mut segment) = Segment::at_rest(None) else { return Ok(()) };
        keep_neighbours(&segment);
        let Segment { stations, lab, .. } = &mut segment;
        stations[usize::from(OTHERS[0])].skew.rate_ppb = FAST_PPB;
        let lonely = &mut stations[usize::from(LONELY)];
        lonely.skew = Default::default();
        let capture = Capture::start(lab);
        lonely.start(lab);
        let held = Arc::new(());
        let reader = watch_time(&lonely.node, Arc::downgrade(&held));
        // Its kernel has to know where it sends them, else nobody would see them later on.
        let speaks = |crossed: &[Crossed]| ahead_ns(crossed, LONELY, 0).count() > 10;
        segment.wait_until("the first is master", |_| capture.so_far(speaks));
        segment.lab.divide(&[&name(LONELY)]).unwrap();
        let _routers = OTHERS.map(|own| Router::start(&segment, own, PROCESS));
        let mut listeners = Listeners::new(&segment);
        let lonely = |segment: &Segment| segment.stations[usize::from(LONELY)].clock();
        assert_eq!(lonely(&segment).role, Role::Master, "nobody disturbs it");
        // Where they may send to each other, their routers have begun.
        segment.wait_until("the others send", |_| {
            capture.so_far(|crossed| OTHERS.iter().all(|own| crossed.iter().any(|frame| frame.from == *own)))
        });
        talk(&segment, &mut listeners, &OTHERS, 100);
        segment.wait_until("the parts have two times, and have sent by them", |_| {
            capture.so_far(|crossed| are_apart(crossed) && foreign(crossed, &time_of_others(crossed)) > FOREIGN)
        });

        segment.lab.unite(&[&name(LONELY)]).unwrap();
        let united_ns = monotonic_ns();
        segment.wait_until("all send", |segment| {
            let lonely = &segment.stations[usize::from(LONELY)];
            let stats = lonely.shell().stats();
            // A peer that denied to hear it may be taken for one that does not, until it says something else.
            let is_heard = |own: &u8| {
                let hears_us = stats.peer(*own).link.hears_us_ns.get() > united_ns;
                hears_us && stats.state(*own, monotonic_ns()) == PeerLinkState::Alive
            };
            lonely.slots().silent.is_none() && OTHERS.iter().all(is_heard)
        });
        segment.wait_until("it yields to the followed master", |segment| lonely(segment).master == Some(OTHERS[0]));
        all_talk(&segment, &mut listeners)?;
        drop(held);
        reader.join().unwrap();
        check(&segment, &capture.end(), united_ns)
    });
}

/// All nodes speak to each other and lose nothing, unless a master that stood still is replaced meanwhile: then a node
/// is silent until it knows the time of the next, and loses what has waited too long.
fn all_talk(segment: &Segment, listeners: &mut Listeners) -> Result<(), Late> {
    const ROUNDS: u16 = 100;
    let since_ns = monotonic_ns();
    let mut talkers = talkers(segment, &ALL);
    listeners.acquaint(&mut talkers);
    listeners.say_all(&mut talkers, 0..ROUNDS);
    let replaced = || ALL.into_iter().find_map(|node| segment.replaced(node, since_ns));
    listeners.hear_all_unless(segment, &ALL, 0..ROUNDS, || replaced().is_some());
    replaced().map_or(Ok(()), Err)
}

/// `united_ns`: when the parts were one again.
fn check(segment: &Segment, crossed: &[Crossed], united_ns: u64) -> Result<(), Late> {
    let time = time_of_others(crossed);
    let before = &crossed[..crossed.partition_point(|frame| frame.at_ns < united_ns)];
    let foreign = foreign(before, &time);
    assert!(foreign > FOREIGN / 2, "the parts had two times: {foreign} frames of {}", before.len());
    // When both know of each other.
    let meets_ns = ahead_ns(crossed, OTHERS[0], 0).map(|(at_ns, _)| at_ns).find(|at_ns| *at_ns > united_ns).unwrap();
    let yields_ns = segment.own_log(LONELY).follows_ns(OTHERS[0], united_ns).unwrap();
    let healed_ns = meets_ns + (HEALED_CYCLES * table().cycle).as_nanos() as u64;
    if yields_ns > healed_ns {
        let what = format!("it yields {} ns after the parts met", yields_ns - meets_ns);
        let [since, until] = [meets_ns, yields_ns].map(instant);
        return Err(Late { what, since, until, by: HEALED_CYCLES / 2 * table().cycle });
    }
    // Where masters stand still there may be a third master, with another time.
    segment.replaced(LONELY, yields_ns).map_or(Ok(()), Err)?;
    let after = &crossed[crossed.partition_point(|frame| frame.at_ns < yields_ns)..];
    if let Some((leads_ns, _)) = ahead_ns(after, LONELY, 0).next() {
        // By the true clock, some of these may be replacements: of a master that stood still.
        let last_ns = ahead_ns(crossed, OTHERS[0], 0).map(|(at_ns, _)| at_ns).rfind(|at_ns| *at_ns < leads_ns).unwrap();
        let silent_ns = leads_ns - last_ns;
        assert!(silent_ns > table().cycle.as_nanos() as u64, "there is one master, and it spoke {silent_ns} ns before");
    }
    assert_kept_by("two parts that are one again", segment, after, |at_ns| time.at(at_ns).ns);
    Ok(())
}
