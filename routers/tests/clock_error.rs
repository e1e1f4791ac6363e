//! How far system time on two slaves is off the master's, between network namespaces joined by a bridge, and whether
//! their bounds hold.
//!
//! All clocks here are this computer's; those of the slaves are made wrong, by a known offset, 30 and 60 ppm, and half
//! a ppm that comes and goes, so the true error of each reading is known. Beside it stands what RTnet's formula makes
//! of the very same frames: the master's own stamp, the kernel's receive stamp, the mean of a hundred calibrations,
//! nothing remembered.
//!
//! A few seconds as a test. As a measurement, with the load of TDMA.md (two threads that only work, 40 000 datagrams a
//! second):
//! `ROHRPOST_CLOCK_SECONDS=60 ROHRPOST_CLOCK_LOAD=1 cargo test -p rohrpost-routers --test clock_error -- --nocapture`

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_mailbox::monotonic_ns;
use rohrpost_routers::lab::Lab;
use rohrpost_routers::shell::clock::{ClockParts, ClockService, ClockSnapshot, Skew};
use rohrpost_routers::time::{Exchange, Role, TimeSettings};
use rohrpost_testbed::lan;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const NODES: u8 = 3;
const PORT: u16 = 21_118;
const SINK: u16 = 21_200;
const PATIENCE: Duration = Duration::from_secs(60);
/// What RTnet takes the mean of.
const CALIBRATIONS: usize = 100;

fn asked(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().and_then(|value| value.parse().ok()).unwrap_or(otherwise)
}

fn address(node: u8) -> IpAddr {
    IpAddr::from([10, 77, 0, node + 1])
}

struct Node {
    service: ClockService,
    skew: Skew,
    exchanges: Receiver<Exchange>,
}

impl Node {
    fn start(lab: &Lab, node: u8, interval: Duration) -> Self {
        let skew = Skew {
            offset_ns: u64::from(node) * 1_234_000_000,
            rate_ppb: i64::from(node) * 30_000,
            wander_ppb: if node == 0 { 0.0 } else { 500.0 },
            begin_ns: monotonic_ns(),
        };
        let (observer, exchanges) = sync_channel(1 << 16);
        let settings = TimeSettings {
            system: 1,
            own: node,
            nodes: NODES,
            masters: vec![0],
            interval,
            digest: 7,
            incarnation: monotonic_ns(),
        };
        let _inside = lab.enter(&format!("n{node}")).unwrap();
        let addresses = (0..NODES).map(|node| SocketAddr::new(address(node), PORT)).collect();
        let observer = Some(observer);
        let parts = ClockParts { skew: Some(skew), observer, ..ClockParts::at(addresses, settings) };
        Self { service: ClockService::start(parts).unwrap(), skew, exchanges }
    }

    fn snapshot(&self) -> ClockSnapshot {
        self.service.state().snapshot()
    }

    fn is_steady(&self) -> bool {
        let seen = self.snapshot();
        seen.synchronised && seen.role == Role::Slave && seen.exchanges > 40
    }
}

/// Threads that work, and datagrams from node to node, until it is dropped.
struct Load {
    ends: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Load {
    fn start(lab: &Lab) -> Self {
        let ends = Arc::new(AtomicBool::new(false));
        let begin = |work: Box<dyn Fn() + Send>| {
            let ends = ends.clone();
            std::thread::spawn(move || {
                while !ends.load(Ordering::Relaxed) {
                    work();
                }
            })
        };
        let socket = |node: u8, port| {
            let _inside = lab.enter(&format!("n{node}")).unwrap();
            UdpSocket::bind((address(node), port)).unwrap()
        };
        let (sender, sink) = (socket(1, 0), socket(2, SINK));
        sink.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
        let flood = move || {
            for _ in 0..40 {
                let _ = sender.send_to(&[7; 1400], (address(2), SINK));
            }
            std::thread::sleep(Duration::from_millis(1));
        };
        let swallow = move || drop(sink.recv_from(&mut [0; 2048]));
        let works = || _ = std::hint::black_box(monotonic_ns());
        let threads =
            vec![begin(Box::new(flood)), begin(Box::new(swallow)), begin(Box::new(works)), begin(Box::new(works))];
        Self { ends, threads }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| thread.join().unwrap());
    }
}

/// Errors, and how they are told.
#[derive(Default)]
struct Errors(Vec<u64>);

impl Errors {
    fn at(&self, per_thousand: usize) -> f64 {
        self.0[(self.0.len() - 1) * per_thousand / 1000] as f64 / 1000.0
    }

    fn tell(&mut self, what: &str) {
        self.0.sort_unstable();
        if !self.0.is_empty() {
            println!(
                "{what:34} p50 {:8.3}  p99 {:8.3}  p99.9 {:8.3}  max {:8.3} us  ({})",
                self.at(500),
                self.at(990),
                self.at(999),
                self.at(1000),
                self.0.len()
            );
        }
    }
}

/// The error of RTnet's formula, and of its four stamps taken by the kernel, for each of these exchanges.
fn memoryless(exchanges: &[Exchange], skew: &Skew, master: &ClockSnapshot, by_kernel: bool) -> Errors {
    let one_way = |e: &Exchange| {
        let (sent, here) =
            if by_kernel { (e.request_left.ns, e.sync_came.ns) } else { (e.request_sent_ns, e.reply_came.ns) };
        let (there, back) =
            if by_kernel { (e.request_came_ns, e.sync_left_ns) } else { (e.request_came_ns, e.reply_sent_ns) };
        let around = i128::from(here) - i128::from(sent) - (i128::from(back) - i128::from(there));
        around as f64 / 2.0
    };
    let calibrated = &exchanges[..CALIBRATIONS.min(exchanges.len())];
    let one_way_ns = calibrated.iter().map(one_way).sum::<f64>() / calibrated.len() as f64;
    let error = |e: &Exchange| {
        let sent_ns = if by_kernel { e.sync_left_ns } else { e.sync_sent_ns };
        let offset_ns = i128::from(sent_ns) - i128::from(e.sync_came.ns) + one_way_ns as i128;
        // When the slave's clock showed that: all clocks are one.
        let mut true_ns = e.sync_came.ns - skew.offset_ns;
        for _ in 0..4 {
            true_ns = true_ns.wrapping_add(e.sync_came.ns.wrapping_sub(skew.local_ns(true_ns)));
        }
        let truth_ns = i128::from(master.record.at(true_ns).ns) - i128::from(e.sync_came.ns);
        (offset_ns - truth_ns).unsigned_abs() as u64
    };
    Errors(exchanges.iter().skip(CALIBRATIONS).map(error).collect())
}

#[test]
fn slaves_are_within_their_bounds() {
    let Some(lab) = lan::lab(&lan::specs(&[0, 1, 2].map(address)), 1500) else { return };
    let interval = Duration::from_millis(asked("ROHRPOST_CLOCK_INTERVAL_MS", 100));
    let run = Duration::from_secs(asked("ROHRPOST_CLOCK_SECONDS", 2));
    let master = Node::start(&lab, 0, interval);
    let slaves = [1, 2].map(|node| Node::start(&lab, node, interval));
    let give_up = Instant::now() + PATIENCE;
    while !slaves.iter().all(Node::is_steady) {
        assert!(Instant::now() < give_up, "{:#?}", slaves.each_ref().map(Node::snapshot));
        std::thread::sleep(Duration::from_millis(1));
    }
    let load = (asked("ROHRPOST_CLOCK_LOAD", 0) != 0).then(|| Load::start(&lab));
    slaves.iter().for_each(|slave| while slave.exchanges.try_recv().is_ok() {});

    let (mut errors, mut bounds, mut outside) = (Errors::default(), Errors::default(), 0);
    let end = Instant::now() + run;
    while Instant::now() < end {
        std::thread::sleep(Duration::from_millis(1));
        for slave in &slaves {
            let (own, theirs) = (slave.snapshot().record, master.snapshot().record);
            let now_ns = monotonic_ns();
            let (own, theirs) = (own.at(slave.skew.local_ns(now_ns)), theirs.at(master.skew.local_ns(now_ns)));
            let off_ns = own.ns.abs_diff(theirs.ns);
            errors.0.push(off_ns);
            bounds.0.push(own.error.as_nanos() as u64);
            outside += u32::from(u128::from(off_ns) > own.error.as_nanos());
        }
    }
    println!("interval {interval:?}, {run:?}, load {}, {:?}", load.is_some(), slaves[0].snapshot());
    errors.tell("rohrpost, any moment");
    bounds.tell("its bound");
    for slave in &slaves {
        let exchanges: Vec<Exchange> = slave.exchanges.try_iter().collect();
        if exchanges.len() > 2 * CALIBRATIONS {
            let seen = master.snapshot();
            let mut rtnet = memoryless(&exchanges, &slave.skew, &seen, false);
            rtnet.tell("RTnet's formula, at each frame");
            memoryless(&exchanges, &slave.skew, &seen, true).tell("the same, stamps by the kernel");
            println!(
                "RTnet's by ours: p50 {:.1}, p99 {:.1}",
                rtnet.at(500) / errors.at(500),
                rtnet.at(990) / errors.at(990)
            );
        }
    }
    drop(load);
    assert_eq!(outside, 0, "readings outside of their bound");
    hold_over(master, &slaves);
}

/// The master ends, and nobody else may be: the slaves go on by themselves, and their bounds go on to hold.
fn hold_over(master: Node, slaves: &[Node]) {
    let (last, skew) = (master.snapshot().record, master.skew);
    drop(master);
    let mut errors = Errors::default();
    for _ in 0..10 {
        std::thread::sleep(Duration::from_millis(100));
        for slave in slaves {
            let record = slave.snapshot().record;
            let now_ns = monotonic_ns();
            let (own, theirs) = (record.at(slave.skew.local_ns(now_ns)), last.at(skew.local_ns(now_ns)));
            let off_ns = own.ns.abs_diff(theirs.ns);
            assert!(u128::from(off_ns) <= own.error.as_nanos(), "{off_ns} ns off, bound {:?}", own.error);
            errors.0.push(off_ns);
        }
    }
    errors.tell("a second without master");
}
