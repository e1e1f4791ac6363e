//! Clocks on this computer, each with a wrong monotonic clock of its own: so the true error of each reading is known.

use super::{ClockParts, ClockService, ClockSnapshot, Skew};
use crate::harness::time_settings;
use crate::time::{Role, TimeSettings};
use rohrpost_mailbox::{TimeRecord, monotonic_ns};
use rohrpost_testbed::lan::{self, Lab};
use rohrpost_testbed::stalls::{Late, unless_stalled};
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

const MS: u64 = 1_000_000;

/// Nodes 0 and up on addresses 127.9.x.1 and up; each with its skew.
struct Clocks {
    services: Vec<Option<ClockService>>,
    parts: Vec<(Skew, SocketAddr)>,
    masters: Vec<u8>,
    interval: Duration,
    kernel_stamps: bool,
    /// Where each has a namespace of its own.
    lab: Option<Lab>,
}

impl Clocks {
    /// Three nodes, of which two may be master.
    fn new(interval: Duration, kernel_stamps: bool) -> Self {
        let addresses = [1, 2, 3].map(|host| IpAddr::from([127, 9, 0, host]));
        // The same port on all, as in an installation: one that is free on the last is free on the others.
        let port = UdpSocket::bind((addresses[2], 0)).unwrap().local_addr().unwrap().port();
        Self::at(addresses.map(|address| SocketAddr::new(address, port)), &[0, 1], (interval, kernel_stamps), None)
    }

    fn at(
        addresses: [SocketAddr; 3],
        masters: &[u8],
        (interval, kernel_stamps): (Duration, bool),
        lab: Option<Lab>,
    ) -> Self {
        let begin_ns = monotonic_ns();
        let skew = |node: u8| Skew {
            offset_ns: u64::from(node) * 1_234 * MS,
            rate_ppb: i64::from(node) * 30_000,
            wander_ppb: if node == 0 { 0.0 } else { 500.0 },
            begin_ns,
        };
        let parts = (0..).zip(addresses).map(|(node, address)| (skew(node), address)).collect();
        let (services, masters) = ((0..3).map(|_| None).collect(), masters.to_vec());
        let mut clocks = Self { services, parts, masters, interval, kernel_stamps, lab };
        (0..3).for_each(|node| clocks.start(node));
        clocks
    }

    fn start(&mut self, node: u8) {
        let settings = time_settings(node, &self.masters, self.interval);
        let settings = TimeSettings { incarnation: monotonic_ns(), ..settings };
        let _inside = self.lab.as_ref().map(|lab| lab.enter(&format!("n{node}")).unwrap());
        let addresses = self.parts.iter().map(|(_, address)| *address).collect();
        let service = ClockService::start(ClockParts {
            kernel_stamps: self.kernel_stamps,
            skew: Some(self.parts[usize::from(node)].0),
            ..ClockParts::at(addresses, settings)
        });
        self.services[usize::from(node)] = Some(service.unwrap());
    }

    fn snapshot(&self, node: u8) -> ClockSnapshot {
        self.services[usize::from(node)].as_ref().unwrap().state().snapshot()
    }

    /// What a node takes for now, and how far off it says it is at most, ns.
    fn read(&self, node: u8, true_ns: u64) -> (i128, u128) {
        let time = self.snapshot(node).record.at(self.parts[usize::from(node)].0.local_ns(true_ns));
        (time.ns.into(), time.error.as_nanos())
    }

    fn wait(&self, what: &str, is: impl Fn() -> bool) {
        let end = Instant::now() + Duration::from_secs(60);
        while !is() {
            let snapshots: Vec<ClockSnapshot> = (0..self.parts.len() as u8)
                .filter(|node| self.services[usize::from(*node)].is_some())
                .map(|node| self.snapshot(node))
                .collect();
            assert!(Instant::now() < end, "{what}: {snapshots:#?}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn follow(&self, slaves: &[u8], master: u8) {
        let follows = |node: &u8| {
            let seen = self.snapshot(*node);
            seen.synchronised && seen.role == Role::Slave && seen.term == self.snapshot(master).term
        };
        self.wait("slaves follow", || self.snapshot(master).role == Role::Master && slaves.iter().all(follows));
    }

    /// The master: node 0, or node 1 where that was slow to begin.
    fn master(&self) -> u8 {
        let is_master = |node: &u8| self.snapshot(*node).role == Role::Master;
        self.wait("one master", || [0, 1].iter().filter(|node| is_master(node)).count() == 1);
        u8::from(is_master(&1))
    }

    /// All follow one master, and are not further off than they say, at any moment. Returns the master.
    fn check_bounds(&self) -> Result<u8, Late> {
        let master = self.master();
        let slaves = [1 - master, 2];
        self.follow(&slaves, master);
        self.wait("exchanges", || slaves.iter().all(|slave| self.snapshot(*slave).exchanges > 30));
        let began = Instant::now();
        for _ in 0..1000 {
            for slave in slaves {
                let now_ns = monotonic_ns();
                let ((own, error), (true_ns, _)) = (self.read(slave, now_ns), self.read(master, now_ns));
                if self.snapshot(master).role != Role::Master || self.snapshot(slave).master != Some(master) {
                    return Err(Late::now(format!("{master} is no master any more"), began, 2 * self.interval));
                }
                assert!((own - true_ns).unsigned_abs() <= error, "{} ns off, bound {error}", own - true_ns);
                if error >= 50 * u128::from(MS) {
                    let since = began.checked_sub(20 * self.interval).unwrap_or(began);
                    return Err(Late::now(format!("{error} ns may {slave} be off"), since, self.interval));
                }
            }
        }
        Ok(master)
    }
}

#[test]
fn bounds_hold_without_stamps_by_the_kernel() {
    unless_stalled(|_| {
        let clocks = Clocks::new(Duration::from_millis(50), false);
        let master = clocks.check_bounds()?;
        assert!([1 - master, 2].iter().all(|slave| !clocks.snapshot(*slave).by_kernel));
        Ok(())
    });
}

#[test]
fn slaves_know_the_masters_time_within_their_bounds_and_go_on_when_it_ends() {
    unless_stalled(|_| {
        let mut clocks = Clocks::new(Duration::from_millis(50), true);
        let first = clocks.check_bounds()?;
        clocks.services[usize::from(first)] = None;
        let before = clocks.read(2, monotonic_ns()).0;
        clocks.follow(&[2], 1 - first);
        let after = clocks.read(2, monotonic_ns()).0;
        assert!(after > before && clocks.snapshot(2).record.epoch == 1);
        clocks.start(first);
        clocks.follow(&[first, 2], 1 - first);
        assert!(clocks.snapshot(2).ignored < 10, "{:?}", clocks.snapshot(2));
        Ok(())
    });
}

/// How large errors are, also under load and beside RTnet's formula, is measured by the case `clock` of the bench.
#[test]
fn slaves_are_within_their_bounds() {
    let addresses = [1, 2, 3].map(|host| IpAddr::from([10, 77, 0, host]));
    let Some(lab) = lan::lab(&lan::specs(&addresses), 1500) else { return };
    let sockets = addresses.map(|address| SocketAddr::new(address, 21_118));
    let mut clocks = Clocks::at(sockets, &[0], (Duration::from_millis(100), true), Some(lab));
    clocks.follow(&[1, 2], 0);
    clocks.wait("exchanges", || [1, 2].iter().all(|slave| clocks.snapshot(*slave).exchanges > 40));
    let are_within = |clocks: &Clocks, master: TimeRecord| {
        for slave in [1, 2] {
            let now_ns = monotonic_ns();
            let (own, error) = clocks.read(slave, now_ns);
            let off_ns = (own - i128::from(master.at(clocks.parts[0].0.local_ns(now_ns)).ns)).unsigned_abs();
            assert!(off_ns <= error, "{off_ns} ns off, bound {error}");
        }
    };
    let end = Instant::now() + Duration::from_secs(2);
    while Instant::now() < end {
        std::thread::sleep(Duration::from_millis(1));
        are_within(&clocks, clocks.snapshot(0).record);
    }
    // The master ends, and nobody else may be: the slaves go on by themselves, and their bounds go on to hold.
    let last = clocks.snapshot(0).record;
    clocks.services[0] = None;
    for _ in 0..10 {
        std::thread::sleep(Duration::from_millis(100));
        are_within(&clocks, last);
    }
}
