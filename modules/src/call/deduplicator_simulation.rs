//! Callers, a network that loses, copies, delays and reorders, and a server that dies at any step. Virtual time; all
//! chance comes from a seed.

use super::{CALLERS_MAX, Deduplicator, Fault, Principal, Request, TRANSIT_MAX_NS, VALIDITY_MAX_NS, Verdict, WINDOW};
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_testbed::sim::events::Events;
use std::collections::{BTreeMap, VecDeque};

const MS: u64 = 1_000_000;

/// What is left out of the real thing, to see that the simulation notices.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Broken {
    Nothing,
    Forgets,
    NoBeforeStart,
    RunsRedelivered,
    /// Nobody has a place of its own.
    NamesNobody,
    /// Each caller has a share for itself, instead of each principal.
    SharesByCaller,
    /// All share one share.
    SharesNothing,
    /// A caller is remembered for as long as it says.
    BelievesValidity,
    /// One that was remembered takes its place again without a look at the share that it takes.
    TakesItsPlaceAgain,
}

/// Callers of principals that always find a place.
pub(super) const NAMED: usize = 2;
/// As long as an envelope can tell.
const VALID_LONG_NS: u64 = u32::MAX as u64 * 1000;

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Package {
    caller: usize,
    incarnation: u32,
    sequence: u32,
    /// Index of the call.
    call: usize,
    age_ns: u64,
    sent_ns: u64,
    published_ns: u64,
    redelivered: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Answer {
    Ran(usize),
    Interrupted,
    NotRun,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Event {
    Begin(usize),
    Try(usize),
    Arrive(Package),
    Serve,
    Start,
    Answered { call: usize, incarnation: u32, answer: Answer },
}

pub(super) struct Call {
    pub(super) caller: usize,
    pub(super) incarnation: u32,
    sequence: u32,
    began_ns: u64,
    pub(super) valid_for_ns: u64,
    idempotent: bool,
    /// Tries made; three in all.
    tries: u64,
    pub(super) outcome: Option<Answer>,
    runs: Vec<usize>,
    /// Of the server that ran it last.
    life: Option<usize>,
    /// Run twice where no server could have known: see the module's text.
    unknowable: bool,
}

/// One run of the simulation.
pub(super) struct World {
    chance: Chance,
    broken: Broken,
    pub(super) now_ns: u64,
    events: Events<Event>,
    pub(super) delay_max_ns: u64,
    pub(super) loss_percent: u64,
    copy_percent: u64,
    pub(super) death_percent: u64,
    pub(super) callers: Vec<(u32, u32)>,
    /// Those that are not named belong to so many principals.
    pub(super) principals: usize,
    /// Whether some of them say that what they call is valid for long.
    greedy: bool,
    pub(super) calls: Vec<Call>,
    runs: usize,
    // The server.
    life: usize,
    alive: bool,
    started_ns: u64,
    pub(super) deduplicator: Deduplicator,
    mailbox: VecDeque<Package>,
    pub(super) problems: Vec<String>,
    pub(super) seen: BTreeMap<&'static str, u64>,
}

const CALLS: usize = 120;

impl World {
    pub(super) fn new(seed: u64, broken: Broken) -> Self {
        let mut chance = Chance::new(seed);
        let local = chance.percent(30);
        let (delay_max_ns, loss_percent, copy_percent) =
            if local { (0, 0, 0) } else { (chance.below(TRANSIT_MAX_NS * 9 / 10), chance.below(40), chance.below(30)) };
        let death_percent = if chance.percent(30) { 0 } else { chance.below(12) };
        let callers = if chance.percent(20) { CALLS } else { 1 + chance.below(4) as usize };
        // Incarnations and numbers wrap early.
        let callers = (0..callers).map(|n| (u32::MAX - n as u32 % 3, u32::MAX - chance.below(20) as u32)).collect();
        // A few that may hold much, or so many that each holds one place and none is left.
        let principals = if chance.percent(30) { CALLS } else { 1 + chance.below(6) as usize };
        let greedy = chance.percent(50);
        let started_ns = 5000 * MS;
        let mut world = Self {
            broken,
            now_ns: started_ns,
            events: Events::default(),
            delay_max_ns,
            loss_percent,
            copy_percent,
            death_percent,
            callers,
            principals,
            greedy,
            calls: Vec::new(),
            runs: 0,
            life: 0,
            alive: true,
            started_ns,
            deduplicator: Self::once(started_ns),
            mailbox: VecDeque::new(),
            problems: Vec::new(),
            seen: BTreeMap::new(),
            chance,
        };
        // Many callers at once, so that memory is full at times.
        let crowded = world.callers.len() > CALLERS_MAX;
        let (calls, span_ms) = if crowded { (3 * CALLS, 10_000) } else { (CALLS, 20_000) };
        for _ in 0..calls {
            let caller = world.chance.below(world.callers.len() as u64) as usize;
            let after_ns = world.chance.below(span_ms * MS);
            world.at(after_ns, Event::Begin(caller));
        }
        world
    }

    fn at(&mut self, after_ns: u64, event: Event) {
        self.events.push(self.now_ns + after_ns, event);
    }

    pub(super) fn run(mut self) -> Self {
        while let Some((now_ns, event)) = self.events.pop() {
            self.now_ns = now_ns;
            match event {
                Event::Begin(caller) => self.begin(caller),
                Event::Try(call) => self.try_call(call),
                Event::Arrive(package) => self.arrive(package),
                Event::Serve => self.serve_next(),
                Event::Start => self.start(),
                Event::Answered { call, incarnation, answer } => self.answered(call, incarnation, answer),
            }
            self.check_places();
        }
        self.check_all();
        self
    }

    fn begin(&mut self, caller: usize) {
        if self.chance.percent(5) {
            // It was restarted: its calls under way are nobody's now.
            self.callers[caller].0 = self.callers[caller].0.wrapping_add(1);
            self.callers[caller].1 = 1;
        }
        let (incarnation, sequence) = self.callers[caller];
        // Calls to others come in between.
        let step = if self.chance.percent(10) { 1 + self.chance.below(2 * u64::from(WINDOW)) as u32 } else { 1 };
        self.callers[caller].1 = sequence.wrapping_add(step);
        let is_greedy = self.greedy && caller >= NAMED && caller.is_multiple_of(3);
        let valid_for_ns = if is_greedy { VALID_LONG_NS } else { (10 + self.chance.below(3000)) * MS };
        let idempotent = self.chance.percent(20);
        self.calls.push(Call {
            caller,
            incarnation,
            sequence,
            began_ns: self.now_ns,
            valid_for_ns,
            idempotent,
            tries: 0,
            outcome: None,
            runs: Vec::new(),
            life: None,
            unknowable: false,
        });
        self.try_call(self.calls.len() - 1);
    }

    fn waits(&self, call: &Call) -> bool {
        let in_time = self.now_ns - call.began_ns < call.valid_for_ns;
        call.outcome.is_none() && in_time && self.callers[call.caller].0 == call.incarnation
    }

    fn try_call(&mut self, index: usize) {
        let call = &self.calls[index];
        if call.tries == 3 || !self.waits(call) {
            return;
        }
        // As `link` has it: microseconds, and at least one in a repeat.
        let age_ns = if call.tries == 0 { 0 } else { ((self.now_ns - call.began_ns) / 1000 * 1000).max(1000) };
        let Call { caller, incarnation, sequence, .. } = *call;
        let sent_ns = self.now_ns;
        let package = Package {
            caller,
            incarnation,
            sequence,
            call: index,
            age_ns,
            sent_ns,
            published_ns: 0,
            redelivered: false,
        };
        let wait_ns = call.valid_for_ns.min(VALIDITY_MAX_NS) / 3;
        self.calls[index].tries += 1;
        self.carry(Event::Arrive(package));
        self.at(wait_ns, Event::Try(index));
    }

    fn carry(&mut self, event: Event) {
        let copies = 1 + usize::from(self.chance.percent(self.copy_percent));
        for _ in 0..copies {
            if !self.chance.percent(self.loss_percent) {
                let delay_ns = if self.delay_max_ns == 0 { 0 } else { self.chance.below(self.delay_max_ns) };
                self.at(delay_ns, event);
            }
        }
    }

    fn arrive(&mut self, package: Package) {
        if self.mailbox.len() < 16 {
            self.mailbox.push_back(Package { published_ns: self.now_ns, ..package });
            let busy_ns = self.chance.below(20 * MS);
            self.at(busy_ns, Event::Serve);
        }
    }

    fn serve_next(&mut self) {
        if !self.alive {
            return;
        }
        let Some(package) = self.mailbox.pop_front() else { return };
        let call = &self.calls[package.call];
        let principal = match self.broken {
            Broken::SharesByCaller => Self::named(package.caller),
            Broken::SharesNothing => Principal::Unknown,
            _ => self.principal(package.caller),
        };
        let mut request = Request {
            from: Self::name(package.caller),
            principal,
            incarnation: package.incarnation,
            sequence: package.sequence,
            valid_for_ns: call.valid_for_ns,
            age_ns: package.age_ns + (self.now_ns - package.published_ns),
            repeat: package.age_ns > 0,
            redelivered: package.redelivered,
            idempotent: call.idempotent,
        };
        match self.broken {
            Broken::Forgets => self.deduplicator = Self::once(self.started_ns),
            Broken::NamesNobody if self.deduplicator.callers.is_empty() => {
                self.deduplicator = Deduplicator::new(self.started_ns, &[])
            }
            Broken::NoBeforeStart => self.deduplicator.started_ns = 0,
            Broken::RunsRedelivered => request.redelivered = false,
            Broken::TakesItsPlaceAgain => {
                let known = self.deduplicator.callers.iter_mut().filter(|caller| caller.from == request.from);
                known.for_each(|caller| caller.until_ns = caller.until_ns.max(self.now_ns));
            }
            _ => {}
        }
        let knows = self.knows(package.caller);
        // Death may come before, between or after.
        if self.dies(package) {
            return;
        }
        let (said, answer) = match self.deduplicator.validate(&request, self.now_ns) {
            Verdict::Ignore => ("ignored", None),
            Verdict::Again(_, body) => {
                ("again", Some(Answer::Ran(body.iter().fold(0, |n, b| n << 8 | usize::from(*b)))))
            }
            Verdict::Refuse(Fault::Interrupted) => ("interrupted", Some(Answer::Interrupted)),
            Verdict::Refuse(Fault::Expired) => ("expired", Some(Answer::NotRun)),
            Verdict::Refuse(Fault::Busy) => ("busy", Some(Answer::NotRun)),
            // To an incarnation that is over: nobody waits for it.
            Verdict::Refuse(Fault::EarlierIncarnation) => ("earlier incarnation", None),
            Verdict::Refuse(other) => panic!("{other}"),
            Verdict::Run => ("run", Some(Answer::Ran(self.runs))),
        };
        *self.seen.entry(said).or_default() += 1;
        if said == "busy" {
            self.check_refusal(package.caller, knows);
        }
        if said == "run" {
            self.execute(package);
            if self.dies(package) {
                return;
            }
            self.deduplicator.done(&request, self.now_ns, false, &(self.runs as u32 - 1).to_be_bytes());
            if self.broken == Broken::BelievesValidity {
                let until_ns = self.now_ns + self.calls[package.call].valid_for_ns;
                self.deduplicator
                    .callers
                    .iter_mut()
                    .filter(|c| c.from == request.from)
                    .for_each(|c| c.until_ns = until_ns);
            }
        }
        if let Some(answer) = answer {
            self.carry(Event::Answered { call: package.call, incarnation: package.incarnation, answer });
        }
        // After the answer, with the package still in hand.
        self.dies(package);
    }

    fn execute(&mut self, package: Package) {
        // On the wire as a first try, while it (its copy, or its repeat) was run by a server that has died since.
        let on_the_wire = package.age_ns == 0 && package.sent_ns < package.published_ns;
        let call = &mut self.calls[package.call];
        call.unknowable |= on_the_wire && call.life.is_some_and(|life| life != self.life);
        call.life = Some(self.life);
        call.runs.push(self.runs);
        self.runs += 1;
    }

    /// Whether the server dies now; then the package in its hand waits for the next, if it was not waiting so already.
    fn dies(&mut self, package: Package) -> bool {
        if !self.chance.percent(self.death_percent) {
            return false;
        }
        self.alive = false;
        if !package.redelivered {
            self.mailbox.push_front(Package { redelivered: true, ..package });
        }
        let down_ns = self.chance.below(1500 * MS);
        self.at(down_ns, Event::Start);
        true
    }

    fn start(&mut self) {
        self.life += 1;
        self.alive = true;
        self.started_ns = self.now_ns;
        self.deduplicator = Self::once(self.now_ns);
        for _ in 0..self.mailbox.len() {
            let busy_ns = self.chance.below(20 * MS);
            self.at(busy_ns, Event::Serve);
        }
    }

    fn answered(&mut self, call: usize, incarnation: u32, answer: Answer) {
        if self.waits(&self.calls[call]) && self.calls[call].incarnation == incarnation {
            // As `link` has it: once there are repeats, one that was refused says nothing of the others.
            let (tries, run) = (self.calls[call].tries, !self.calls[call].runs.is_empty());
            if answer == Answer::NotRun && tries > 1 {
                return;
            }
            // A copy may be run where the first was refused; routers drop copies.
            if answer == Answer::NotRun && run && self.copy_percent == 0 && !self.calls[call].idempotent {
                self.problems.push(format!("call {call} was said not to be run, but was"));
            }
            self.calls[call].outcome = Some(answer);
        }
    }

    fn check_all(&mut self) {
        for (index, call) in self.calls.iter().enumerate().filter(|(_, call)| !call.idempotent && !call.unknowable) {
            let runs = call.runs.len();
            match call.outcome {
                Some(Answer::Ran(run)) if call.runs != [run] => {
                    self.problems
                        .push(format!("call {index} was answered by run {run}, but its runs are {:?}", call.runs));
                }
                _ if runs > 1 => self.problems.push(format!("call {index} was run {runs} times")),
                _ => {}
            }
        }
        let count = |of: fn(&&Call) -> bool| self.calls.iter().filter(of).count() as u64;
        self.seen.insert("answered", count(|call| matches!(call.outcome, Some(Answer::Ran(_)))));
        self.seen.insert("unknowable", count(|call| call.unknowable && !call.idempotent));
        self.seen.insert("lives", self.life as u64);
        self.seen.insert("calls", self.calls.len() as u64);
    }
}
