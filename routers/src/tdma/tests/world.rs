//! A few nodes in time slots on one wire, in virtual time from a seed. Each sends as much as fits in its slots. The
//! world knows what was on the wire when, and whether two frames were at once.

use crate::frame::{FrameHead, NodeIndex};
use crate::harness::{self, settings, slot, time_settings};
use crate::stats::Stats;
use crate::tdma::{Carries, Next, Planned, Silent, SlotCounts, SlotScheduler, SlotTable, WindowKind, WindowVerdict};
use crate::time::{Clock, Role, Stamp, Step, TIME_BYTES, TimeSettings};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rohrpost_mailbox::TimeRecord;
use rohrpost_network::{Tdma, TimeSlot};
use rohrpost_testbed::sim::clock::Clock as Hardware;
use std::collections::VecDeque;

pub(super) const US: u64 = 1_000;
pub(super) const MS: u64 = 1_000_000;
pub(super) const SECOND: u64 = 1_000 * MS;
pub(super) const CYCLE: u64 = 5 * MS;
const WALL_NS: u64 = 1_790_000_000 * SECOND;
/// IP and UDP headers.
pub(super) const HEADS: usize = 28;
const DATAGRAM_BYTES: usize = 600;

/// Three nodes, of which the first two may be master, with a slot in each cycle; node 2 has another in every third.
pub(super) fn tdma() -> Tdma {
    let slots = vec![
        slot(0, 600, 500),
        slot(1, 1_100, 500),
        slot(2, 1_600, 500),
        TimeSlot { period: 3, phase: 1, ..slot(2, 3_000, 400) },
    ];
    Tdma { link_bytes_s: 12_500_000, ..harness::tdma([5_000, 300, 150], slots) }
}

pub(super) const MASTERS: [NodeIndex; 2] = [0, 1];

pub(super) fn table(own: NodeIndex) -> SlotTable {
    SlotTable::new(&tdma(), &MASTERS, own, 3, HEADS)
}

/// A frame that was on the wire, in true time, with its gap.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct OnWire {
    pub(super) from: NodeIndex,
    pub(super) begin: u64,
    pub(super) end: u64,
    pub(super) is_time: bool,
}

/// Settings of a node.
#[derive(Clone, Debug)]
pub(super) struct File {
    pub(super) tdma: Tdma,
    pub(super) masters: Vec<NodeIndex>,
    pub(super) digest: u64,
}

impl File {
    /// The settings of all nodes.
    pub(super) fn right() -> Self {
        Self { tdma: tdma(), masters: MASTERS.to_vec(), digest: 7 }
    }

    fn table(&self, own: NodeIndex) -> SlotTable {
        SlotTable::new(&self.tdma, &self.masters, own, 3, HEADS)
    }
}

struct Letter {
    from: NodeIndex,
    arrives: u64,
    bytes: [u8; TIME_BYTES],
}

pub(super) struct One {
    pub(super) clock: Option<Clock>,
    pub(super) scheduler: SlotScheduler,
    pub(super) file: File,
    hardware: Hardware,
    page: Option<TimeRecord>,
    /// When it acts next, true time, and for which window.
    wakes: u64,
    planned: Option<Planned>,
    came: VecDeque<Letter>,
    /// It is stalled until then.
    pub(super) frozen_until: u64,
    incarnation: u64,
}

impl One {
    pub(super) fn local_ns(&self, true_ns: u64) -> u64 {
        self.hardware.at(true_ns).monotonic_ns
    }
}

pub(super) struct World {
    pub(super) now: u64,
    pub(super) nodes: Vec<One>,
    pub(super) wire: Vec<OnWire>,
    /// Pairs of nodes between which no datagrams of time pass.
    pub(super) cut: [[bool; 3]; 3],
    /// Whether packages reach all others, even where no datagrams of time pass.
    pub(super) packages_come: bool,
    /// Frames that were on the wire at once.
    pub(super) collisions: Vec<(OnWire, OnWire)>,
    /// How often a node sent packages by a time that may be too far off.
    pub(super) unsure: u32,
    /// One wake-up in this many comes up to 3 ms late; 0: none does.
    pub(super) stalls: u32,
    random: ChaCha8Rng,
}

impl World {
    pub(super) fn new(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let nodes = (0..3).map(|own| One {
            clock: None,
            scheduler: SlotScheduler::new(table(own), 0),
            file: File::right(),
            hardware: Hardware::new(
                random.random_range(SECOND..100 * SECOND),
                WALL_NS,
                random.random_range(-80_000..=80_000),
            ),
            page: None,
            wakes: u64::MAX,
            planned: None,
            came: VecDeque::new(),
            frozen_until: 0,
            incarnation: 0,
        });
        let nodes = nodes.collect();
        let (wire, collisions) = (Vec::new(), Vec::new());
        let (cut, packages_come) = ([[false; 3]; 3], false);
        Self { now: SECOND, nodes, wire, cut, packages_come, collisions, unsure: 0, stalls: 0, random }
    }

    pub(super) fn start(&mut self, node: NodeIndex) {
        let incarnation = self.random.random_range(1..u64::MAX);
        let file = &self.nodes[usize::from(node)].file;
        let settings = time_settings(node, &file.masters, file.tdma.cycle);
        let settings = TimeSettings { digest: file.digest, incarnation, ..settings };
        let wall_ns = WALL_NS + self.random.random_range(0..SECOND) + self.now;
        let one = &mut self.nodes[usize::from(node)];
        let table = one.file.table(node);
        let clock = Clock::new(settings, one.local_ns(self.now), wall_ns, one.page).in_slots(table.for_clock());
        one.clock = Some(clock);
        one.scheduler = SlotScheduler::new(table, 0);
        (one.wakes, one.planned, one.incarnation) = (self.now, None, incarnation);
        one.came.clear();
    }

    pub(super) fn start_all(&mut self) {
        (0..3).for_each(|node| self.start(node));
    }

    pub(super) fn kill(&mut self, node: NodeIndex) {
        let one = &mut self.nodes[usize::from(node)];
        one.page = one.clock.take().map(|clock| *clock.record());
    }

    /// From now on a node's clock is faster by this much.
    pub(super) fn warms(&mut self, node: NodeIndex, by_ppb: i64) {
        let hardware = &mut self.nodes[usize::from(node)].hardware;
        hardware.set_rate(self.now, hardware.rate_ppb() + by_ppb);
    }

    /// Is stalled from shortly before its next synchronisation window until this long after its beginning.
    pub(super) fn wakes_late_to_synchronise(&mut self, node: NodeIndex, late_ns: u64) {
        let window = |world: &Self| {
            let planned = world.nodes[usize::from(node)].planned;
            planned.filter(|planned| matches!(planned.window.kind, WindowKind::Synchronisation { .. }))
        };
        assert!(self.run_until(2 * CYCLE, |world| window(world).is_some()), "it has to synchronise");
        let begin_ns = window(self).map_or(0, |planned| planned.begin_ns);
        let now = self.now;
        let one = &mut self.nodes[usize::from(node)];
        one.frozen_until = one.hardware.when(begin_ns, now) + late_ns;
    }

    pub(super) fn clock(&self, node: NodeIndex) -> &Clock {
        self.nodes[usize::from(node)].clock.as_ref().unwrap()
    }

    pub(super) fn counts(&self, node: NodeIndex) -> SlotCounts {
        self.nodes[usize::from(node)].scheduler.counts(self.clock(node))
    }

    pub(super) fn silent(&self, node: NodeIndex) -> Option<Silent> {
        self.nodes[usize::from(node)].scheduler.silent()
    }

    /// How many frames of a node were on the wire.
    pub(super) fn frames_of(&self, node: NodeIndex) -> usize {
        self.wire.iter().filter(|frame| frame.from == node).count()
    }

    /// All live nodes send, and follow one master.
    pub(super) fn agrees(&self) -> bool {
        let alive = || (0..3).filter(|node| self.nodes[usize::from(*node)].clock.is_some());
        let masters = alive().filter(|node| self.clock(*node).role() == Role::Master).count();
        let term = |node| self.clock(node).reading(0).term;
        let first = alive().next().map(term);
        masters == 1 && alive().all(|node| self.silent(node).is_none() && Some(term(node)) == first)
    }

    /// No collision since the last check, and no node sent without an exact time.
    pub(super) fn assert_alone(&self, told: &str) {
        let (met, first) = (self.collisions.len(), self.collisions.first());
        assert!(met == 0 && self.unsure == 0, "{met} met, {} unsure: {first:?}; {told}", self.unsure);
    }

    pub(super) fn run_until(&mut self, within: u64, until: impl Fn(&Self) -> bool) -> bool {
        let end = self.now + within;
        while self.now < end && !until(self) {
            self.step();
        }
        until(self)
    }

    pub(super) fn run(&mut self, for_ns: u64) {
        self.run_until(for_ns, |_| false);
    }

    fn step(&mut self) {
        let alive = self.nodes.iter().enumerate().filter(|(_, one)| one.clock.is_some());
        let Some((node, acts)) =
            alive.map(|(node, one)| (node, one.wakes.max(one.frozen_until))).min_by_key(|next| next.1)
        else {
            self.now += MS;
            return;
        };
        self.now = self.now.max(acts);
        self.act(node as NodeIndex);
    }

    /// What the sending thread does when it wakes up.
    fn act(&mut self, node: NodeIndex) {
        self.read(node);
        let (now, planned) = (self.now, self.nodes[usize::from(node)].planned.take());
        let one = &mut self.nodes[usize::from(node)];
        let local_ns = one.local_ns(now);
        let Some(clock) = &mut one.clock else { return };
        if let Some(planned) = planned
            && let WindowVerdict::Send(tx_window) = one.scheduler.validate(&planned, local_ns, clock)
        {
            self.send(node, tx_window);
        }
        let at = self.now;
        let one = &mut self.nodes[usize::from(node)];
        let local_ns = one.local_ns(at);
        let Some(clock) = &mut one.clock else { return };
        let until_ns = match clock.poll_in(local_ns, crate::time::Allowed::Nothing, &mut [0; TIME_BYTES]) {
            Step::Wait { until_ns } => until_ns,
            Step::Send { .. } => panic!("a clock in time slots sends when it may not"),
        };
        let (next, clock_ns) = (one.scheduler.next(local_ns, clock), until_ns.max(local_ns + 10_000));
        let (wakes_ns, planned) = match next {
            // A thread that is awake for a window spins until it begins.
            Next::Window(planned) if planned.call_ns <= clock_ns + 100 * US => (planned.call_ns, Some(planned)),
            Next::Window(_) => (clock_ns, None),
            Next::Silent { until_ns, .. } => (until_ns.min(clock_ns), None),
        };
        let late = self.random.random_range(0..12 * US);
        let stalls = self.stalls > 0 && self.random.random_ratio(1, self.stalls.max(1));
        let late = if stalls { self.random.random_range(0..3 * MS) } else { late };
        let one = &mut self.nodes[usize::from(node)];
        one.wakes = one.hardware.when(wakes_ns, at).max(at + 1) + late;
        one.planned = planned;
    }

    /// Takes the received datagrams of time, and stamps.
    fn read(&mut self, node: NodeIndex) {
        let now = self.now;
        let one = &mut self.nodes[usize::from(node)];
        while let Some(letter) = one.came.pop_front_if(|letter| letter.arrives <= now) {
            let came = Stamp { ns: one.local_ns(letter.arrives), doubt_ns: 100, by_kernel: true };
            let (head, rest) = FrameHead::parse(&letter.bytes).unwrap();
            let is_other = head.digest != one.file.digest;
            let local_ns = one.local_ns(now);
            let Some(clock) = &mut one.clock else { continue };
            let _ = match is_other {
                true => clock.handle_other(local_ns, came, Some(letter.from), &head, rest),
                false => clock.handle(local_ns, came, &head, rest),
            };
        }
    }

    fn send(&mut self, node: NodeIndex, mut tx_window: crate::tdma::TransmitWindow) {
        let mut free = 0;
        loop {
            let one = &mut self.nodes[usize::from(node)];
            let local_ns = one.local_ns(self.now);
            let Some(clock) = &mut one.clock else { return };
            let mut bytes = [0; TIME_BYTES];
            if !tx_window.fits(local_ns, TIME_BYTES) {
                break;
            }
            let Step::Send { to, stamp } = clock.poll_in(local_ns, tx_window.allowed(), &mut bytes) else { break };
            tx_window.takes(local_ns, TIME_BYTES);
            let frame = self.put(node, TIME_BYTES, &mut free, true);
            let one = &mut self.nodes[usize::from(node)];
            let left = Stamp { ns: one.local_ns(frame.begin), doubt_ns: 100, by_kernel: true };
            if let (Some(id), Some(clock)) = (stamp, &mut one.clock) {
                clock.sent(id, left);
            }
            one.scheduler.left(local_ns, left);
            let arrives = frame.end + self.random.random_range(5 * US..25 * US);
            if !self.cut[usize::from(node)][usize::from(to)] {
                self.nodes[usize::from(to)].came.push_back(Letter { from: node, arrives, bytes });
            }
        }
        while tx_window.carries == Carries::All {
            let local_ns = self.nodes[usize::from(node)].local_ns(self.now);
            if !tx_window.fits(local_ns, DATAGRAM_BYTES) {
                break;
            }
            tx_window.takes(local_ns, DATAGRAM_BYTES);
            let frame = self.put(node, DATAGRAM_BYTES, &mut free, false);
            self.packages_come_to_others(&frame);
        }
        self.nodes[usize::from(node)].scheduler.close(&tx_window);
    }

    fn packages_come_to_others(&mut self, frame: &OnWire) {
        let incarnation = self.nodes[usize::from(frame.from)].incarnation;
        let others = self.nodes.iter_mut().zip(0..).filter(|(_, node)| *node != frame.from && self.packages_come);
        for (one, node) in others {
            let local_ns = one.local_ns(frame.end);
            let packages = Stats::new(&settings(node, 3), 0);
            let link = &packages.peer(frame.from).link;
            link.incarnation.set(incarnation);
            link.heard_ns.set(local_ns);
            if let Some(clock) = &mut one.clock {
                clock.hears_by(&packages, local_ns, local_ns);
            }
        }
    }

    /// Hands a datagram to the wire, which it reaches some µs later, and checks for collisions.
    fn put(&mut self, from: NodeIndex, datagram_bytes: usize, free: &mut u64, is_time: bool) -> OnWire {
        let reaches = self.now + self.random.random_range(4 * US..20 * US);
        let begin = reaches.max(*free);
        let end = begin + self.nodes[usize::from(from)].file.table(from).wire().ns(datagram_bytes);
        *free = end;
        self.now += 2 * US;
        let frame = OnWire { from, begin, end, is_time };
        let recent = self.wire.iter().rev().take(200);
        let met = recent.copied().find(|other| other.from != from && other.begin < end && begin < other.end);
        self.collisions.extend(met.map(|other| (other, frame)));
        self.wire.push(frame);
        let one = &self.nodes[usize::from(from)];
        let bound_ns = one.clock.as_ref().and_then(Clock::estimate).map(|own| own.bound_ns(one.local_ns(self.now)));
        if !is_time && bound_ns.is_none_or(|bound_ns| bound_ns > 75 * US) {
            self.unsure += 1;
        }
        frame
    }
}
