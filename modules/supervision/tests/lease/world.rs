//! An installation: candidates 0 to n, then the witness, then fences, each on a computer of its own.

use crate::clock::Clock;
use crate::rules::Given;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rohrpost_supervision::lease::{Answer, Ask, Candidate, Fence, Fenced, LEASE_MAX_NS, Number, Terms, Witness};
use std::collections::{BTreeMap, BTreeSet};

pub(crate) const MS: u64 = 1_000_000;
const FENCES: usize = 2;
/// A holder sends data so often, ns.
const DATA_EVERY_NS: u64 = 30 * MS;

#[derive(Clone, Copy)]
enum Event {
    Poll { place: usize, run: u32 },
    Send { place: usize, run: u32 },
    Asked { from: usize, ask: Ask },
    Answered { to: usize, answer: Answer },
    Data { fence: usize, number: Number },
}

/// A candidate's program; stopped ones neither send nor receive.
pub(crate) struct Program {
    pub(crate) core: Candidate,
    pub(crate) run: u32,
    pub(crate) is_stopped: bool,
    /// What came while it was stopped.
    inbox: Vec<Answer>,
    /// The package that it was about to send when it was stopped.
    unsent: Option<Number>,
}

/// How often rare cases were there, over all seeds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    pub(crate) leases: u64,
    pub(crate) old_refused: u64,
    pub(crate) unconfirmed: u64,
    pub(crate) sent_after_stop: u64,
    pub(crate) witness_lost_grant: u64,
    pub(crate) released: u64,
}

impl Seen {
    pub(crate) fn add(&mut self, other: Self) {
        self.leases += other.leases;
        self.old_refused += other.old_refused;
        self.unconfirmed += other.unconfirmed;
        self.sent_after_stop += other.sent_after_stop;
        self.witness_lost_grant += other.witness_lost_grant;
        self.released += other.released;
    }

    pub(crate) fn has_all(&self) -> bool {
        let rare = [self.old_refused, self.unconfirmed, self.sent_after_stop, self.witness_lost_grant, self.released];
        self.leases > 0 && rare.iter().all(|count| *count > 0)
    }
}

pub(crate) struct World {
    pub(crate) seed: u64,
    pub(crate) random: ChaCha8Rng,
    pub(crate) now_ns: u64,
    pub(crate) terms: Terms,
    off_ns: u64,
    clocks: Vec<Clock>,
    pub(crate) programs: Vec<Option<Program>>,
    witness: Witness,
    /// When its run began, on its clock.
    witness_began_ns: u64,
    fences: Vec<Fence>,
    /// What each fence let pass last, in all its runs.
    pub(crate) passed: [Option<Number>; FENCES],
    given: Given,
    runs: u32,
    events: BTreeMap<(u64, u64), Event>,
    events_count: u64,
    /// Ways on which nothing arrives: from, to.
    pub(crate) cuts: BTreeSet<(usize, usize)>,
    pub(crate) delay_max_ns: u64,
    pub(crate) loss: f64,
    pub(crate) seen: Seen,
}

impl World {
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let candidates = random.random_range(2..5);
        let lease_ns = random.random_range(200..2_000) * MS;
        let off_ns = random.random_range(0..lease_ns / 5);
        let rate_error_ppm = [0, 100, 10_000, 100_000][random.random_range(0..4)];
        let held_ns = Terms::new(lease_ns, 1, off_ns, rate_error_ppm).expect("times that fit").held_ns(lease_ns);
        let ask_every_ns = held_ns / random.random_range(3..12);
        let terms = Terms::new(lease_ns, ask_every_ns, off_ns, rate_error_ppm).expect("times that fit");
        let clock = |_| Clock { true_ns: 0, shown_ns: random.random_range(0..1 << 50), error_ppm: 0 };
        let clocks: Vec<_> = (0..candidates + 1 + FENCES).map(clock).collect();
        let mut world = Self {
            seed,
            now_ns: 0,
            terms,
            off_ns,
            witness: Witness::new(clocks[candidates].at(0), terms, 1),
            witness_began_ns: clocks[candidates].at(0),
            clocks,
            programs: (0..candidates).map(|_| None).collect(),
            fences: (0..FENCES).map(|fence| Fence::new(2 + fence as u32)).collect(),
            passed: [None; FENCES],
            given: Given::default(),
            runs: 2 + FENCES as u32,
            events: BTreeMap::new(),
            events_count: 0,
            cuts: BTreeSet::new(),
            delay_max_ns: [MS, lease_ns / 10, lease_ns, 3 * LEASE_MAX_NS][random.random_range(0..4)],
            loss: random.random_range(0.0..0.2),
            seen: Seen::default(),
            random,
        };
        (0..world.clocks.len()).for_each(|computer| world.drift(computer));
        (0..candidates).for_each(|place| world.start(place));
        world
    }

    fn witness_at(&self) -> usize {
        self.programs.len()
    }

    pub(crate) fn clock(&self, computer: usize) -> u64 {
        self.clocks[computer].at(self.now_ns)
    }

    /// When the witness may grant again after its last restart, in true time; now, if that is over.
    pub(crate) fn witness_opens_ns(&self) -> u64 {
        self.clocks[self.witness_at()].when(self.now_ns, self.witness_began_ns + LEASE_MAX_NS)
    }

    fn later(&mut self, at_ns: u64, event: Event) {
        self.events_count += 1;
        self.events.insert((at_ns.max(self.now_ns), self.events_count), event);
    }

    /// Sends, once or twice, what may get lost.
    fn send(&mut self, from: usize, to: usize, event: Event) {
        let copies = if self.random.random_bool(self.loss) { 2 } else { 1 };
        for _ in 0..copies {
            if !self.cuts.contains(&(from, to)) && !self.random.random_bool(self.loss) {
                let delay_ns = self.random.random_range(0..self.delay_max_ns) * self.random.random_range(0..2);
                self.later(self.now_ns + delay_ns, event);
            }
        }
    }

    fn next_run(&mut self) -> u32 {
        self.runs += 1;
        self.runs
    }

    // ---- what happens to computers ----

    pub(crate) fn drift(&mut self, computer: usize) {
        let most = i64::from(self.terms.rate_error_ppm());
        // The worst cases are those at the limits.
        let error_ppm = [-most, most, self.random.random_range(-most..=most)][self.random.random_range(0..3)];
        self.clocks[computer].drift(self.now_ns, error_ppm);
    }

    /// Starts a program, or starts it again; now and then with its computer, so that its clock begins anew.
    pub(crate) fn start(&mut self, place: usize) {
        self.reboot(place);
        let run = self.next_run();
        let mut core = Candidate::new(self.terms, place as u8, run);
        core.set_ready(self.clock(place), true);
        self.programs[place] = Some(Program { core, run, is_stopped: false, inbox: Vec::new(), unsent: None });
        self.later(self.now_ns, Event::Poll { place, run });
        self.later(self.now_ns, Event::Send { place, run });
    }

    fn reboot(&mut self, computer: usize) {
        if self.random.random_bool(0.5) {
            (self.clocks[computer].true_ns, self.clocks[computer].shown_ns) = (self.now_ns, 0);
        }
    }

    pub(crate) fn stop(&mut self, place: usize) {
        let shown_ns = self.clock(place);
        if let Some(program) = &mut self.programs[place] {
            program.is_stopped = true;
            program.unsent = program.core.holds(shown_ns);
        }
    }

    pub(crate) fn go_on(&mut self, place: usize) {
        let Some(program) = self.programs[place].as_mut().filter(|program| program.is_stopped) else { return };
        program.is_stopped = false;
        let (run, unsent) = (program.run, program.unsent.take());
        for answer in std::mem::take(&mut program.inbox) {
            self.later(self.now_ns, Event::Answered { to: place, answer });
        }
        if let Some(number) = unsent {
            self.seen.sent_after_stop += 1;
            self.publish(place, number);
        }
        self.later(self.now_ns, Event::Poll { place, run });
        self.later(self.now_ns, Event::Send { place, run });
    }

    pub(crate) fn set_ready(&mut self, place: usize, is_ready: bool) {
        let shown_ns = self.clock(place);
        let Some(program) = self.programs[place].as_mut().filter(|program| !program.is_stopped) else { return };
        self.seen.released += u64::from(!is_ready && program.core.holds(shown_ns).is_some());
        program.core.set_ready(shown_ns, is_ready);
        let run = program.run;
        self.later(self.now_ns, Event::Poll { place, run });
    }

    pub(crate) fn restart_witness(&mut self) {
        let had_holder = self.witness.holder(self.clock(self.witness_at())).is_some();
        self.seen.witness_lost_grant += u64::from(had_holder);
        self.reboot(self.witness_at());
        let shown_ns = self.clock(self.witness_at());
        self.witness = Witness::new(shown_ns, self.terms, self.next_run());
        self.witness_began_ns = shown_ns;
    }

    pub(crate) fn restart_fence(&mut self, fence: usize) {
        self.reboot(self.witness_at() + 1 + fence);
        self.fences[fence] = Fence::new(self.next_run());
    }

    // ---- what programs do ----

    pub(crate) fn run_until(&mut self, until_ns: u64, mut watch: impl FnMut(&Self)) {
        while let Some(entry) = self.events.first_entry().filter(|entry| entry.key().0 < until_ns) {
            let ((at_ns, _), event) = entry.remove_entry();
            self.now_ns = at_ns;
            self.happen(event);
            self.check_one();
            watch(self);
        }
        self.now_ns = until_ns;
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Poll { place, run } => self.poll(place, run),
            Event::Send { place, run } => {
                let shown_ns = self.clock(place);
                let Some(program) = self.program(place, run) else { return };
                if let Some(number) = program.core.holds(shown_ns) {
                    self.publish(place, number);
                }
                self.later(self.now_ns + DATA_EVERY_NS, event);
            }
            Event::Asked { from, ask } => {
                let at = self.witness_at();
                let answer = self.witness.ask(self.clock(at), &ask);
                let Some(answer) = answer else { return };
                self.seen.leases += u64::from(self.given.note(answer.newest));
                self.send(at, from, Event::Answered { to: from, answer });
            }
            Event::Answered { to, answer } if to > self.witness_at() => {
                let fence = to - self.witness_at() - 1;
                let _ = self.fences[fence].take(&answer);
            }
            Event::Answered { to, answer } => {
                let shown_ns = self.clock(to);
                match &mut self.programs[to] {
                    Some(program) if program.is_stopped => program.inbox.push(answer),
                    Some(program) => program.core.take(shown_ns, &answer),
                    None => {}
                }
            }
            Event::Data { fence, number } => self.receive(fence, number),
        }
    }

    /// The program, if this run of it is there and runs.
    fn program(&mut self, place: usize, run: u32) -> Option<&mut Program> {
        self.programs[place].as_mut().filter(|program| program.run == run && !program.is_stopped)
    }

    fn poll(&mut self, place: usize, run: u32) {
        let shown_ns = self.clock(place);
        let Some(program) = self.program(place, run) else { return };
        let ask = program.core.poll(shown_ns);
        let due_ns = program.core.due_ns();
        if let Some(ask) = ask {
            self.send(place, self.witness_at(), Event::Asked { from: place, ask });
        }
        let at_ns = self.clocks[place].when(self.now_ns, due_ns);
        // One poll is planned for each run, mostly on time.
        let is_late = self.random.random_bool(0.5);
        let at_ns = at_ns + u64::from(is_late) * self.random.random_range(0..MS);
        self.events.retain(|_, event| !matches!(event, Event::Poll { run: of, .. } if *of == run));
        self.later(at_ns, Event::Poll { place, run });
    }

    fn publish(&mut self, place: usize, number: Number) {
        for fence in 0..FENCES {
            self.send(place, self.witness_at() + 1 + fence, Event::Data { fence, number });
        }
    }

    fn receive(&mut self, fence: usize, number: Number) {
        match self.fences[fence].admit(number) {
            Ok(()) => {
                self.given.check_order(self.seed, self.passed[fence], number);
                self.passed[fence] = Some(number);
                // It may ask whenever it likes.
                if self.random.random_bool(0.1) {
                    self.look(fence);
                }
            }
            Err(Fenced::Old { .. }) => self.seen.old_refused += 1,
            Err(Fenced::Unconfirmed) => {
                self.seen.unconfirmed += 1;
                self.look(fence);
            }
        }
    }

    fn look(&mut self, fence: usize) {
        let from = self.witness_at() + 1 + fence;
        let ask = self.fences[fence].look(self.clocks[from].at(self.now_ns));
        self.send(from, self.witness_at(), Event::Asked { from, ask });
    }

    // ---- what is seen from outside ----

    /// Candidates that are on, or need time to be off, whether their programs run or are stopped.
    fn check_one(&self) {
        let is_on = |place: &usize| {
            let until_ns = self.programs[*place].as_ref().and_then(|program| program.core.until_ns());
            until_ns.is_some_and(|until_ns| self.clock(*place) < until_ns + self.off_ns)
        };
        let on: Vec<_> = (0..self.programs.len()).filter(is_on).collect();
        assert!(on.len() < 2, "seed {}, at {} ms: candidates {on:?} are on", self.seed, self.now_ns / MS);
    }

    /// The candidate that holds the lease and runs, with its number.
    pub(crate) fn holder(&self) -> Option<(usize, Number)> {
        let running = |place: usize| self.programs[place].as_ref().filter(|program| !program.is_stopped);
        (0..self.programs.len()).find_map(|place| Some((place, running(place)?.core.holds(self.clock(place))?)))
    }
}
