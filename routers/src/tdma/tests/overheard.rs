//! One node that knows no peer yet, and hears unverified frames.

use super::world::{CYCLE, HEADS, MASTERS, SECOND, US, World, table, tdma};
use crate::harness::{time_frame, time_settings};
use crate::tdma::{
    Carries, GATE_NS, Next, Silent, SlotScheduler, SlotTable, UNPROVEN_CYCLES, WindowKind, WindowVerdict,
};
use crate::time::message::{Request, Sync, TimeMessage};
use crate::time::{Clock, Ignored, Role, Stamp, Step, TIME_BYTES, Term, TimeSettings};
use rohrpost_network::Tdma;

/// A node that hears nothing for this long begins a time; node 1 one cycle later.
const LISTENS: u64 = 100_000_000 + 9 * CYCLE;
/// How long it waits if it hears unverified frames.
const PATIENCE: u64 = 2 * SECOND + 64 * CYCLE;

/// A live peer has answered after this long: it takes eight cycles' hellos, and four to and from each of two others,
/// one in four cycles.
const JOINS: u64 = (8 + 4 * 2) * UNPROVEN_CYCLES * CYCLE;
/// Distance of the second master's beginning from the first one's, if both keep hearing frames; else it is a cycle.
const APART: u64 = JOINS + 100_000_000 + 8 * CYCLE;

fn stamp(ns: u64) -> Stamp {
    Stamp { ns, doubt_ns: 0, by_kernel: true }
}

/// A Sync of a master that nobody follows yet.
fn sync(id: u64, cycle: u64, sent_ns: u64, term: Term) -> Sync {
    Sync { id, cycle, nominal_ns: sent_ns, sent_ns, epoch: 1, term, began: term, ..Sync::default() }
}

/// A node that may be master, and hears unverified frames of another.
struct Ear {
    clock: Clock,
    scheduler: SlotScheduler,
    now_ns: u64,
    sequence: u64,
}

impl Ear {
    fn new(own: u8) -> Self {
        Self::among(own, 3, &MASTERS)
    }

    fn among(own: u8, nodes: u8, masters: &[u8]) -> Self {
        let settings = TimeSettings { nodes, ..time_settings(own, masters, tdma().cycle) };
        let (now_ns, table) = (10 * SECOND, table(own));
        let clock = Clock::new(settings, now_ns, SECOND, None).in_slots(table.for_clock());
        Self { clock, scheduler: SlotScheduler::new(table, 100 * US), now_ns, sequence: 0 }
    }

    fn overhears_of(&mut self, from: u8, message: &TimeMessage) -> Result<(), Ignored> {
        let (head, rest) = time_frame((from, self.scheduler.table().own()), self.sequence, message);
        self.clock.overhear(self.now_ns, stamp(self.now_ns), &head, &rest)
    }

    /// A Sync of node 0 to node 2, which lives.
    fn hears(&mut self, sync: Sync) {
        let (head, rest) = time_frame((0, 2), sync.id, &TimeMessage::Sync(sync));
        self.clock.handle(self.now_ns, stamp(self.now_ns), &head, &rest).unwrap();
    }

    /// A Sync of node 0, by a time that is a thousand seconds ahead; a cycle later than the last.
    fn overhears(&mut self) -> Result<(), Ignored> {
        self.pass(CYCLE);
        self.sequence += 1;
        let (sent_ns, term) = (self.now_ns + 1000 * SECOND, Term::new(7, 0));
        let sync = Sync { followed: true, ..sync(self.sequence, sent_ns / CYCLE, sent_ns, term) };
        self.overhears_of(0, &TimeMessage::Sync(sync))
    }

    /// A node that has time, a thousand seconds ahead, and hears no master.
    fn overhears_hello_of(&mut self, from: u8) -> Result<(), Ignored> {
        self.sequence += 1;
        let sent_ns = self.now_ns + 1000 * SECOND;
        let hello = Request { epoch: 1, sent_ns, timed: true, ..Request::default() };
        self.overhears_of(from, &TimeMessage::Request(hello))
    }

    /// It runs once a cycle.
    fn pass(&mut self, for_ns: u64) {
        for _ in 0..for_ns.div_ceil(CYCLE) {
            self.now_ns += CYCLE;
            self.clock.poll_in(self.now_ns, crate::time::Allowed::Nothing, &mut [0; TIME_BYTES]);
        }
    }

    /// Runs until it is master; returns how long that takes, if not longer than this.
    fn begins_within(&mut self, most_ns: u64, mut each_cycle: impl FnMut(&mut Self)) -> Option<u64> {
        let from_ns = self.now_ns;
        while self.now_ns - from_ns < most_ns {
            each_cycle(self);
            if self.clock.role() == Role::Master {
                return Some(self.now_ns - from_ns);
            }
        }
        None
    }
}

#[test]
fn a_hello_leaves_in_one_of_four_cycles_and_nothing_else() {
    let mut ear = Ear::new(2);
    for _ in 0..8 {
        assert!(matches!(ear.scheduler.next(ear.now_ns, &ear.clock), Next::Silent { why: Silent::NoTime, .. }));
        ear.overhears().unwrap();
    }
    assert_eq!((ear.clock.role(), ear.clock.coarse(ear.now_ns)), (Role::Listening, None), "it believes nobody");
    let mut before_ns = None;
    for asked in 1..=3 {
        let Next::Window(planned) = ear.scheduler.next(ear.now_ns, &ear.clock) else { panic!("silent") };
        assert!(
            matches!(planned.window.kind, WindowKind::Slot { .. }) && ear.scheduler.silent() == Some(Silent::Asking)
        );
        while ear.now_ns + CYCLE < planned.call_ns {
            ear.overhears().unwrap();
        }
        ear.now_ns = planned.call_ns;
        let verdict = ear.scheduler.validate(&planned, ear.now_ns, &ear.clock);
        let WindowVerdict::Send(mut tx_window) = verdict else { panic!("{verdict:?}") };
        assert_eq!(tx_window.carries, Carries::Hello);
        let step = ear.clock.poll_in(ear.now_ns, tx_window.allowed(), &mut [0; TIME_BYTES]);
        assert!(matches!(step, Step::Wait { .. }), "{step:?}");
        assert!(tx_window.carries_hello() && tx_window.fits(ear.now_ns, 68));
        tx_window.takes(ear.now_ns, 68);
        ear.scheduler.close(&tx_window);
        assert_eq!(ear.scheduler.counts(&ear.clock).unproven, asked);
        let paused = before_ns
            .replace(tx_window.begin_ns)
            .is_none_or(|before| tx_window.begin_ns - before >= UNPROVEN_CYCLES * CYCLE);
        assert!(paused, "after {before_ns:?} at {}", tx_window.begin_ns);
    }
}

#[test]
fn a_frame_that_is_read_before_the_clock_first_runs_delays_no_longer_than_any_other() {
    let mut ear = Ear::new(1);
    ear.overhears_hello_of(0).unwrap();
    let begins = ear.begins_within(SECOND, |ear| ear.pass(CYCLE));
    assert!(begins.is_some_and(|begins| begins.abs_diff(LISTENS) <= 3 * CYCLE), "{begins:?}");
}

#[test]
fn a_node_that_hears_unverified_frames_begins_no_time_for_a_while() {
    let begins = Ear::new(1).begins_within(SECOND, |ear| ear.pass(CYCLE));
    assert!(begins.is_some_and(|begins| begins.abs_diff(LISTENS) <= 2 * CYCLE), "in silence: {begins:?}");
    let overhears = |ear: &mut Ear| ear.overhears().unwrap();
    let begins = Ear::new(1).begins_within(2 * PATIENCE, overhears);
    assert!(
        begins.is_some_and(|begins| begins.abs_diff(PATIENCE + LISTENS + APART) <= 4 * CYCLE),
        "heard for ever: {begins:?}"
    );
    let mut ear = Ear::new(1);
    (0..100).for_each(|_| overhears(&mut ear));
    let begins = ear.begins_within(SECOND, |ear| ear.pass(CYCLE));
    assert!(
        begins.is_some_and(|begins| begins.abs_diff(LISTENS) <= 2 * CYCLE),
        "since the last that was heard: {begins:?}"
    );
}

#[test]
fn a_new_master_steps_back_until_patience_is_over() {
    let mut ear = Ear::new(1);
    ear.begins_within(SECOND, |ear| ear.pass(CYCLE)).unwrap();
    let first_ns = ear.now_ns;
    ear.overhears().unwrap();
    assert_eq!(
        (ear.clock.role(), ear.clock.estimate()),
        (Role::Listening, None),
        "it listens again, and goes by nothing"
    );
    let begins = ear.begins_within(2 * PATIENCE, |ear| ear.overhears().unwrap());
    assert!(begins.is_some(), "but not for ever");
    assert!(ear.now_ns - first_ns >= PATIENCE);
    ear.overhears().unwrap();
    assert_eq!(ear.clock.role(), Role::Master, "nor a second time");
}

#[test]
fn a_node_out_of_patience_leaves_time_to_hear_an_earlier_master() {
    let begins = MASTERS.map(|own| {
        let each_cycle = |ear: &mut Ear| {
            ear.pass(CYCLE);
            ear.overhears_hello_of(2).unwrap();
        };
        Ear::new(own).begins_within(2 * PATIENCE, each_cycle).expect("patience ends")
    });
    assert!(begins[0] >= PATIENCE && begins[1] - begins[0] >= JOINS + 100_000_000, "{begins:?}");
}

#[test]
fn the_only_master_that_lost_its_page_asks_each_of_five_that_speak_in_turn() {
    let mut ear = Ear::among(0, 6, &[0]);
    for _ in 0..8 {
        (1..6).for_each(|from| ear.overhears_hello_of(from).unwrap());
        ear.pass(CYCLE);
    }
    let next = ear.scheduler.next(ear.now_ns, &ear.clock);
    assert!(matches!(next, Next::Window(planned) if planned.carries == Carries::Hello), "{next:?}");
    let asked = [(); 5].map(|()| {
        let (node, _) = ear.clock.overheard(ear.now_ns).unwrap();
        ear.clock.asked_overheard(ear.now_ns);
        node
    });
    assert_eq!(asked, [1, 2, 3, 4, 5]);
}

#[test]
fn a_window_of_what_is_overheard_is_no_slot_of_the_nodes_own_time() {
    let mut world = World::new(1);
    world.start_all();
    assert!(world.run_until(5 * SECOND, World::agrees));
    (0..2).for_each(|other| (world.cut[other][2], world.cut[2][other]) = (true, true));
    let is_unsure = |world: &World| matches!(world.silent(2), Some(Silent::BoundTooLarge { .. }));
    assert!(world.run_until(60 * SECOND, is_unsure) && world.clock(2).estimate().is_some(), "it has a time of its own");
    let mut now_ns = world.nodes[2].local_ns(world.now);
    let one = &mut world.nodes[2];
    let (clock, scheduler) = (one.clock.as_mut().unwrap(), &mut one.scheduler);
    // By a time that is a thousand seconds ahead.
    for sequence in 1..=8 {
        now_ns += CYCLE;
        clock.poll_in(now_ns, crate::time::Allowed::Nothing, &mut [0; TIME_BYTES]);
        scheduler.next(now_ns, clock);
        let sent_ns = clock.reading(now_ns).time.ns + 1000 * SECOND;
        let message = TimeMessage::Request(Request { epoch: 9, sent_ns, timed: true, ..Request::default() });
        let (head, rest) = time_frame((0, 2), sequence, &message);
        clock.overhear(now_ns, stamp(now_ns), &head, &rest).unwrap();
    }
    let Next::Window(planned) = scheduler.next(now_ns, clock) else { panic!("silent") };
    assert_eq!(planned.carries, Carries::Hello);
    let before = scheduler.counts(clock);
    let late_ns = planned.begin_ns + GATE_NS + 1;
    assert!(matches!(scheduler.validate(&planned, late_ns, clock), WindowVerdict::Late));
    assert_eq!(scheduler.counts(clock), before, "none of its own slots was late");
    scheduler.next(late_ns, clock);
    let passed = scheduler.counts(clock).silent - before.silent;
    let own_slots = 2 * (late_ns - now_ns).div_ceil(CYCLE);
    assert!((1..=own_slots).contains(&passed), "all of them are counted, and once: {passed} of {own_slots}");
}

#[test]
fn a_node_that_meanwhile_follows_a_live_master_asks_for_its_window_anew() {
    let mut ear = Ear::new(2);
    (0..8).for_each(|_| ear.overhears().unwrap());
    let Next::Window(planned) = ear.scheduler.next(ear.now_ns, &ear.clock) else { panic!("silent") };
    for id in 101..=108 {
        let (sent_ns, term) = (ear.now_ns + 1000 * SECOND, Term::new(7, 0));
        ear.hears(sync(id, id, sent_ns, term));
    }
    assert!(matches!(ear.scheduler.validate(&planned, planned.call_ns, &ear.clock), WindowVerdict::Early));
    let Next::Window(anew) = ear.scheduler.next(planned.call_ns, &ear.clock) else { panic!("silent") };
    assert_eq!((anew.window, anew.carries), (planned.window, Carries::Time));
}

#[test]
fn rare_slots_are_waited_for() {
    let clock_of = |slots: &Tdma, own| SlotTable::new(slots, &MASTERS, own, 3, HEADS).for_clock();
    let mut slots = tdma();
    assert_eq!(table(0).for_clock().hello_every_ns, UNPROVEN_CYCLES * CYCLE);
    slots.slots[0].period = 16;
    slots.slots[2].period = 32;
    let clock = clock_of(&slots, 1);
    assert_eq!(clock.slot_every_ns, 16 * CYCLE);
    assert_eq!(clock.asks_every_ns, 16 * CYCLE, "a master has it");
    assert_eq!(clock.hello_every_ns, 16 * CYCLE, "node 2 has another one in each third cycle");
    let mut slots = tdma();
    slots.slots.iter_mut().filter(|slot| slot.node == 2).for_each(|slot| slot.period = 32);
    let asks = |own| clock_of(&slots, own).asks_every_ns;
    assert!(!MASTERS.contains(&2) && asks(1) < asks(2), "the others wait for nobody's rare slots");
    assert_eq!(asks(2), 32 * CYCLE);
}

#[test]
fn a_node_that_knows_the_time_ignores_unverified_frames_as_it_does_those_without_time() {
    let mut ear = Ear::new(2);
    for message in [TimeMessage::WarmUp, TimeMessage::Request(Request::default())] {
        assert_eq!(ear.overhears_of(0, &message), Err(Ignored::Unproven));
    }
    ear.overhears().unwrap();
    let (sent_ns, term) = (ear.now_ns, Term::new(1, 0));
    ear.hears(sync(99, 1, sent_ns, term));
    assert!(!ear.clock.overhears(ear.now_ns));
    assert_eq!(ear.overhears(), Err(Ignored::Unproven), "it hears a master that lives");
}
