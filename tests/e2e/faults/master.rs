//! The master of time dies, and comes back.

use super::{Field, router_of};
use crate::harness::{halt, runs, signal, until, wait};
use nix::sys::signal::Signal;
use rohrpost::interfaces::{ClockRole, ClockState, LinkState, RouterInterface};
use rohrpost_mailbox::{SystemClock, SystemTime, monotonic_ns};
use rohrpost_testbed::stalls::{Late, unless_stalled};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const NODES: [&str; 3] = ["base", "arm", "desk"];
/// The interval of the configuration: each candidate waits for so much longer than the one before it.
const INTERVAL: Duration = Duration::from_millis(500);
/// A master that is silent for so long is replaced: 3.5 intervals.
const SILENT: Duration = Duration::from_millis(1750);
/// The next takes over after that; the rest is for a busy computer.
const TAKEN_OVER_WITHIN: Duration = Duration::from_secs(15);
/// Readings of all nodes are this far apart.
const READ_EVERY: Duration = Duration::from_millis(2);
/// Good readings that are required before and after each change.
const READINGS: u64 = 200;

/// Reads the time of all nodes, over and over, as modules there would.
struct Reader {
    ends: Arc<AtomicBool>,
    readings: Arc<AtomicU64>,
    thread: JoinHandle<()>,
}

impl Reader {
    fn new(field: &Field) -> Self {
        let clocks = NODES.map(|node| SystemClock::open(&field.robot(node).node));
        let (ends, readings) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let (until, count) = (ends.clone(), readings.clone());
        let read = move || {
            let mut last: [Option<SystemTime>; 3] = [None; 3];
            while !until.load(Ordering::Relaxed) {
                let before_ns = monotonic_ns();
                let now: [SystemTime; 3] = std::array::from_fn(|node| clocks[node].now());
                let took_ns = monotonic_ns() - before_ns;
                check(&now, &last, took_ns);
                last = now.map(Some);
                count.fetch_add(1, Ordering::Relaxed);
                std::thread::sleep(READ_EVERY);
            }
        };
        Self { ends, readings, thread: std::thread::spawn(read) }
    }

    /// Waits until it has read some more.
    fn go_on(&self) {
        let enough = self.readings.load(Ordering::Relaxed) + READINGS;
        until("readings of time", || {
            let ended = self.thread.is_finished();
            ended || self.readings.load(Ordering::Relaxed) >= enough
        });
    }

    /// Ends it; fails if it found something wrong.
    fn end(self) {
        self.ends.store(true, Ordering::Relaxed);
        self.thread.join().unwrap();
    }
}

/// On no node time goes back within an epoch, and any two nodes differ by no more than the sum of both stated errors.
fn check(now: &[SystemTime; 3], last: &[Option<SystemTime>; 3], took_ns: u64) {
    for (node, (now, last)) in NODES.iter().zip(now.iter().zip(last)) {
        let is_on = last.is_none_or(|last| last.epoch < now.epoch || last.epoch == now.epoch && last.ns <= now.ns);
        assert!(is_on, "time of {node} went back: {last:?}, {now:?}");
    }
    for (one, other) in [(0, 1), (0, 2), (1, 2)] {
        let (a, b) = (&now[one], &now[other]);
        let off = Duration::from_nanos(a.ns.abs_diff(b.ns));
        let allowed = a.error.saturating_add(b.error).saturating_add(Duration::from_nanos(took_ns));
        assert!(
            a.epoch != b.epoch || off <= allowed,
            "{} and {} differ by {off:?}: {a:?}, {b:?}, read within {took_ns} ns",
            NODES[one],
            NODES[other]
        );
    }
}

/// The time of these nodes, once they all know it and one of them is the master of all.
fn agreed(field: &Field, nodes: &[&str]) -> (String, u64) {
    wait(format!("{nodes:?} have a master"), || {
        let said: Vec<ClockState> = nodes.iter().map(|node| field.said(node, RouterInterface::CLOCK)).collect();
        let (master, term) = (said[0].master.clone(), said[0].term);
        let masters = said.iter().filter(|clock| clock.role == ClockRole::Master).count();
        let known = said.iter().all(|clock| clock.error_ns.is_some() && clock.role != ClockRole::Listening);
        let same = said.iter().all(|clock| (&clock.master, clock.term) == (&master, term));
        (known && same && masters == 1 && nodes.contains(&master.as_str())).then_some((master, term))
    })
}

#[test]
fn when_the_master_dies_the_next_takes_over_and_no_node_s_time_goes_back_or_leaves_its_bound() {
    unless_stalled(|stalls| {
        let Some(mut field) = Field::new(3, "") else { return Ok(()) };
        field.launch(&NODES);
        let (first, term) = agreed(&field, &NODES);
        let reader = Reader::new(&field);
        reader.go_on();
        let epoch = field.said(&first, RouterInterface::CLOCK).epoch;

        // It is not started again for now.
        let (launch, router) = (field.launcher(&first).pid(), field.router(&first));
        halt(launch);
        signal(router, Signal::SIGKILL);
        let killed = Instant::now();
        until(format!("{router} is gone"), || !runs(router));
        let others: Vec<&str> = NODES.into_iter().filter(|node| *node != first).collect();
        let (second, next_term) = agreed(&field, &others);
        assert!(stalls.ran(killed) < TAKEN_OVER_WITHIN, "after {:?}", killed.elapsed());
        let is_next = late_unless(second == others[0], "the next in order takes over", killed, INTERVAL);
        assert!(next_term > term, "{next_term} follows {term}");
        let third = others.iter().find(|node| **node != second).unwrap();
        field.wait_counted(third, &format!("probe.{}", NODES.iter().position(|node| *node == second).unwrap()), 1);
        reader.go_on();

        // It comes back, and finds a master.
        let back = Instant::now();
        signal(launch, Signal::SIGCONT);
        field.robot(&first).wait_restarted(&router_of(&first), router);
        let is_same = agreed(&field, &NODES) == (second, next_term);
        let stays = late_unless(is_same, "no change of masters without need", back, SILENT);
        for other in &others {
            field.wait_for_state(&first, other, LinkState::Alive);
        }
        reader.go_on();
        for node in NODES {
            assert_eq!(field.said(node, RouterInterface::CLOCK).epoch, epoch, "{node}: no step of time");
        }
        reader.end();
        field.stop();
        is_next.and(stays)
    });
}

/// What a stall of `by` since then changes.
fn late_unless(is_so: bool, what: &str, since: Instant, by: Duration) -> Result<(), Late> {
    if is_so { Ok(()) } else { Err(Late::now(format!("not so: {what}"), since, by)) }
}
