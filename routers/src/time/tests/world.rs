//! A few nodes with wrong clocks on a bad network, in virtual time from a seed. It knows the true time, and checks
//! every node's page at every moment against the promises of the module.

use crate::frame::{FrameHead, NodeIndex};
use crate::harness::time_settings;
use crate::time::{Clock, Role, SentId, Stamp, Step, TIME_BYTES, Term, TimeSettings};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rohrpost_mailbox::TimeRecord;
use rohrpost_testbed::sim::events::Events;
use std::collections::BTreeMap;
use std::time::Duration;

mod check;
mod hardware;

use check::TermTime;
pub(super) use hardware::Conditions;
use hardware::Oscillator;

pub(super) const MS: u64 = 1_000_000;
pub(super) const SECOND: u64 = 1_000 * MS;
const WALL_NS: u64 = 1_790_000_000 * SECOND;

struct Node {
    clock: Option<Clock>,
    oscillator: Oscillator,
    /// Its page; it outlives a router.
    page: Option<TimeRecord>,
    /// The term that the page follows.
    page_term: Term,
    incarnation: u64,
    last: Option<(u64, u64)>,
    wakes_at: u64,
    frozen_until: u64,
}

enum Event {
    Wake(NodeIndex),
    Arrive { to: NodeIndex, bytes: Box<[u8; TIME_BYTES]>, came: Stamp },
    SnapshotRequest,
}

pub(super) struct World {
    pub(super) now: u64,
    pub(super) ways: Conditions,
    pub(super) interval: Duration,
    masters: Vec<NodeIndex>,
    nodes: Vec<Node>,
    random: ChaCha8Rng,
    events: Events<Event>,
    terms: BTreeMap<u64, TermTime>,
    /// Which nodes hear which.
    cut: Vec<Vec<bool>>,
    pub(super) replay: String,
    /// When a node became master, and which.
    pub(super) begun: Vec<(u64, NodeIndex)>,
    pub(super) ignored: u64,
    /// True errors and bounds of slaves, ns, since it was emptied last.
    pub(super) errors: Vec<(u64, u64)>,
}

impl World {
    pub(super) fn new(seed: u64, nodes: u8, masters: &[u8], interval: Duration, ways: Conditions) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let node = |random: &mut ChaCha8Rng| Node {
            clock: None,
            oscillator: Oscillator {
                offset_ns: random.random_range(SECOND..1_000 * SECOND),
                rate_ppb: random.random_range(-100_000..=100_000),
                wander_ppb: random.random_range(0.0..500.0),
                period_ns: random.random_range(20.0..60.0) * 1e9,
                phase: random.random_range(0.0..std::f64::consts::TAU),
            },
            page: None,
            page_term: Term::NONE,
            incarnation: 0,
            last: None,
            wakes_at: u64::MAX,
            frozen_until: 0,
        };
        let mut world = Self {
            now: SECOND,
            ways,
            interval,
            masters: masters.to_vec(),
            nodes: (0..nodes).map(|_| node(&mut random)).collect(),
            random,
            events: Events::default(),
            terms: BTreeMap::new(),
            cut: vec![vec![false; nodes.into()]; nodes.into()],
            replay: format!("seed {seed}, {nodes} nodes, interval {interval:?}"),
            begun: Vec::new(),
            ignored: 0,
            errors: Vec::new(),
        };
        world.push(world.now, Event::SnapshotRequest);
        world
    }

    pub(super) fn start(&mut self, node: NodeIndex) {
        let at = self.now;
        let incarnation = self.random.random_range(1..u64::MAX);
        let wall_ns = WALL_NS + self.random.random_range(0..100 * SECOND) + at;
        let one = &mut self.nodes[usize::from(node)];
        one.incarnation = incarnation;
        let settings = time_settings(node, &self.masters, self.interval);
        let settings = TimeSettings { nodes: self.cut.len() as u8, incarnation, ..settings };
        let clock = Clock::new(settings, one.oscillator.local_ns(at), wall_ns, one.page);
        one.clock = Some(clock);
        self.wake(node, at);
    }

    pub(super) fn start_all(&mut self) {
        (0..self.cut.len() as u8).for_each(|node| self.start(node));
    }

    pub(super) fn kill(&mut self, node: NodeIndex) {
        self.nodes[usize::from(node)].clock = None;
    }

    /// The computer is switched off: its page is gone, and its clock begins anew.
    pub(super) fn switch_off(&mut self, node: NodeIndex) {
        let offset_ns = self.random.random_range(SECOND..1_000 * SECOND);
        let one = &mut self.nodes[usize::from(node)];
        (one.clock, one.page, one.last) = (None, None, None);
        one.oscillator.offset_ns = offset_ns;
        one.page_term = Term::NONE;
    }

    /// Its threads stall.
    pub(super) fn freeze(&mut self, node: NodeIndex, for_ns: u64) {
        self.nodes[usize::from(node)].frozen_until = self.now + for_ns;
    }

    /// Nodes on one side do not hear the other side, nor the other way round.
    pub(super) fn split(&mut self, side: &[NodeIndex]) {
        for from in 0..self.cut.len() {
            for to in 0..self.cut.len() {
                self.cut[from][to] = side.contains(&(from as u8)) != side.contains(&(to as u8));
            }
        }
    }

    pub(super) fn cut(&mut self, from: NodeIndex, to: NodeIndex) {
        self.cut[usize::from(from)][usize::from(to)] = true;
    }

    pub(super) fn heal(&mut self) {
        self.cut.iter_mut().for_each(|row| row.fill(false));
    }

    pub(super) fn clock(&self, node: NodeIndex) -> &Clock {
        self.nodes[usize::from(node)].clock.as_ref().unwrap()
    }

    pub(super) fn alive(&self) -> Vec<NodeIndex> {
        (0..self.cut.len() as u8).filter(|node| self.nodes[usize::from(*node)].clock.is_some()).collect()
    }

    pub(super) fn masters_now(&self) -> Vec<NodeIndex> {
        self.alive().into_iter().filter(|node| self.clock(*node).role() == Role::Master).collect()
    }

    pub(super) fn local_ns(&self, node: NodeIndex) -> u64 {
        self.nodes[usize::from(node)].oscillator.local_ns(self.now)
    }

    pub(super) fn epoch(&self, node: NodeIndex) -> u64 {
        self.clock(node).record().epoch
    }

    /// Whether all live nodes follow one master, by its term and epoch, with a bound below this.
    pub(super) fn agrees(&self, error_ns: u64) -> bool {
        let masters = self.masters_now();
        let [master] = masters[..] else { return false };
        let term = self.clock(master).term();
        self.alive().into_iter().all(|node| {
            let reading = self.clock(node).reading(self.local_ns(node));
            let bounded = reading.synchronised && reading.time.error.as_nanos() < error_ns.into();
            bounded && reading.term == term && self.epoch(node) == self.epoch(master) && self.clock(node).term() == term
        })
    }

    /// Runs until this holds; returns how long that took.
    pub(super) fn run_until(&mut self, within_ns: u64, what: &str, is: impl Fn(&Self) -> bool) -> u64 {
        let begin = self.now;
        while !is(self) {
            if self.now >= begin + within_ns {
                let tell = format!("{what}: not within {} ms\n{}", within_ns / MS, self.tell());
                self.fail(&tell);
                break;
            }
            self.step();
        }
        self.now - begin
    }

    pub(super) fn run(&mut self, for_ns: u64) {
        let end = self.now + for_ns;
        while self.now < end {
            self.step();
        }
    }

    pub(super) fn fail(&mut self, what: &str) {
        panic!("{what}; at {} ms; {}", self.now / MS, self.replay);
    }

    fn tell(&self) -> String {
        let tell = |node: &NodeIndex| {
            let reading = self.clock(*node).reading(self.local_ns(*node));
            let role = self.clock(*node).role();
            format!(
                "{node}: {role:?} of {:?}, {reading:?}, {:?}\n",
                self.clock(*node).term(),
                self.clock(*node).record()
            )
        };
        self.alive().iter().map(tell).collect()
    }

    fn push(&mut self, at: u64, event: Event) {
        self.events.push(at, event);
    }

    fn wake(&mut self, node: NodeIndex, at: u64) {
        self.nodes[usize::from(node)].wakes_at = at;
        self.push(at, Event::Wake(node));
    }

    fn step(&mut self) {
        let (at, event) = self.events.pop().expect("something happens");
        self.now = self.now.max(at);
        let frozen_until = |world: &Self, node: NodeIndex| world.nodes[usize::from(node)].frozen_until;
        match event {
            Event::SnapshotRequest => {
                (0..self.cut.len() as u8).for_each(|node| self.check(node));
                let next = self.now + (self.interval.as_nanos() as u64 / 7).clamp(100_000, 50 * MS);
                self.push(next, Event::SnapshotRequest);
            }
            Event::Wake(node) if frozen_until(self, node) > self.now => {
                // Received datagrams are in its socket, and are read first.
                let at = frozen_until(self, node) + 1;
                self.wake(node, at);
            }
            Event::Wake(node) if self.nodes[usize::from(node)].wakes_at <= self.now => self.poll(node),
            Event::Wake(_) => {}
            Event::Arrive { to, bytes, came } if frozen_until(self, to) > self.now => {
                self.push(frozen_until(self, to), Event::Arrive { to, bytes, came });
            }
            Event::Arrive { to, bytes, came } => self.arrive(to, &bytes, came),
        }
    }

    fn arrive(&mut self, to: NodeIndex, bytes: &[u8; TIME_BYTES], came: Stamp) {
        let local_ns = self.local_ns(to);
        let Some(clock) = &mut self.nodes[usize::from(to)].clock else { return };
        let (head, rest) = FrameHead::parse(bytes).unwrap();
        let came = if came.by_kernel { came } else { Stamp::by_us(local_ns) };
        self.ignored += u64::from(clock.handle(local_ns, came, &head, rest).is_err());
        self.check(to);
        self.poll(to);
    }

    fn poll(&mut self, node: NodeIndex) {
        for _ in 0..1000 {
            let local_ns = self.local_ns(node);
            let Some(clock) = &mut self.nodes[usize::from(node)].clock else { return };
            let mut bytes = [0; TIME_BYTES];
            let step = clock.poll(local_ns, &mut bytes);
            self.check(node);
            match step {
                Step::Send { to, stamp } => self.send(node, to, stamp, bytes),
                Step::Wait { until_ns } => {
                    let wait_ns = until_ns.saturating_sub(local_ns);
                    // A little early by a wrong clock: then it is asked again.
                    let late_ns = self.wakeup_ns();
                    self.wake(node, self.now + wait_ns + late_ns + 1);
                    return;
                }
            }
        }
        panic!("node {node} sends without end; {}", self.replay);
    }

    fn wakeup_ns(&mut self) -> u64 {
        let late = self.random.random_range(0..=self.ways.wakeup_ns);
        if self.random.random_ratio(1, 100) { 10 * late } else { late }
    }

    fn send(&mut self, from: NodeIndex, to: NodeIndex, stamp: Option<SentId>, bytes: [u8; TIME_BYTES]) {
        let left = self.now + self.random.random_range(2_000..20_000);
        self.now += 1_000;
        if let (Some(id), true) = (stamp, self.ways.kernel_stamps) {
            // Now and then the kernel's stamp is lost.
            if self.random.random_ratio(98, 100) {
                let stamp = self.stamp(from, left);
                self.nodes[usize::from(from)].clock.as_mut().unwrap().sent(id, stamp);
            }
        }
        let copies = 1 + usize::from(self.random.random_ratio(self.ways.twice, 1000));
        for _ in 0..copies {
            let lost = self.random.random_ratio(self.ways.loss, 1000) || self.cut[usize::from(from)][usize::from(to)];
            let uneven = if from < to { self.ways.asymmetry_ns } else { 0 };
            let waits = if self.random.random_ratio(1, 4) { self.ways.jitter_ns } else { self.ways.jitter_ns / 8 };
            let at = left + self.ways.delay_ns + uneven + self.random.random_range(0..=waits);
            if !lost {
                let mut came = self.stamp(to, at);
                came.by_kernel = self.ways.kernel_stamps;
                let read = at + self.wakeup_ns();
                self.push(read, Event::Arrive { to, bytes: Box::new(bytes), came });
            }
        }
    }

    /// A kernel's stamp, wrong by less than its doubt.
    fn stamp(&mut self, node: NodeIndex, true_ns: u64) -> Stamp {
        let wrong = self.random.random_range(-100..=100);
        let ns = self.nodes[usize::from(node)].oscillator.local_ns(true_ns).saturating_add_signed(wrong);
        Stamp { ns, doubt_ns: 100, by_kernel: true }
    }
}
