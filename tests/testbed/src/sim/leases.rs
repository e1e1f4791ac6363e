//! The lease of a module with several nodes: what the launches of a simulated network do about it, and what must hold.
//!
//! ```text
//!  launch of a candidate ── Asked ──▶ launch of the witness      each launch: where the name is ─▶ MovingNames of its
//!                        ◀─ Answered ─                                                             node's router
//!  the holder's process  ── Held ──▶ modules of other nodes: never one of an earlier lease after one of a later
//! ```
//!
//! Questions, answers and the holder's data are packages as any: real routers carry, lose and refuse them. The clocks
//! of launches drift as much as the terms allow, which is more than routers are made for.

use super::chance::Chance;
use super::clock::Clock;
use super::lease_plan::LeasePlan;
use super::package::Role;
use super::spans::MS;
use rohrpost_config::holder_line;
use rohrpost_supervision::lease::{Answer, Ask, Candidate, Fence, LEASE_MAX_NS, Number, Witness};

/// A holder publishes so often, ns.
pub(super) const PUBLISH_NS: u64 = 30 * MS;
/// What a launch, or a process that it runs, sends to another node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Posted {
    pub(crate) from: usize,
    pub(crate) to: usize,
    pub(crate) role: Role,
}

/// Where a delivered package of the holder stands among all leases.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Delivered {
    /// Place of its lease in the order in which they were given.
    lease: usize,
    from: usize,
}

/// Launch of a node.
struct Launch {
    clock: Clock,
    /// Counts its lives; not that of any other.
    run: u32,
    is_alive: bool,
    /// How many faults keep its module from being on.
    unready: u32,
    /// When it is to do something, true ns.
    wake_ns: u64,
    candidate: Option<Candidate>,
    witness: Option<Witness>,
    fence: Fence,
    look_ns: u64,
    /// Place of the holder by the last answer, and when that was asked.
    seen: (Option<u8>, u64),
    /// Under which its process published last. One that was stopped goes on with it.
    published: Option<Number>,
    is_stopped: bool,
}

impl Launch {
    /// When it has something to do, on its clock.
    fn due_ns(&self) -> u64 {
        self.candidate.as_ref().map_or(u64::MAX, Candidate::due_ns).min(self.look_ns)
    }
}

/// All launches.
pub(crate) struct Leases {
    plan: LeasePlan,
    launches: Vec<Launch>,
    runs: u32,
    /// Numbers in the order in which the witness gave them.
    given: Vec<Number>,
    /// What each node had last of a holder.
    delivered: Vec<Option<Delivered>>,
    /// Faults that are not over.
    faults: u32,
    /// When the last one was over, or the witness could grant again, true ns.
    well_ns: u64,
    /// The node that held the lease when all was well.
    kept: Option<usize>,
    pub(super) posted: Vec<Posted>,
}

impl Leases {
    /// All launches are alive.
    pub(crate) fn new(plan: &LeasePlan) -> Self {
        let mut chance = Chance::new(plan.seed);
        let clock = |rate_ppb: &i64| Clock::new(chance.scale(1_000_000_000, 1 << 50), 0, *rate_ppb);
        let launch = |clock: Clock| Launch {
            clock,
            run: 0,
            is_alive: false,
            unready: 0,
            wake_ns: 0,
            candidate: None,
            witness: None,
            fence: Fence::new(0),
            look_ns: 0,
            seen: (None, 0),
            published: None,
            is_stopped: false,
        };
        let launches: Vec<Launch> = plan.rates_ppb.iter().map(clock).map(launch).collect();
        let delivered = vec![None; launches.len()];
        let (runs, given, posted) = Default::default();
        let mut all =
            Self { plan: plan.clone(), launches, runs, given, delivered, faults: 0, well_ns: 0, kept: None, posted };
        (0..all.launches.len()).for_each(|node| all.start(0, node));
        all
    }

    fn next_run(&mut self) -> u32 {
        self.runs += 1;
        self.runs
    }

    fn local_ns(&self, true_ns: u64, node: usize) -> u64 {
        self.launches[node].clock.at(true_ns).monotonic_ns
    }

    /// A node's launch starts, and knows nothing.
    pub(super) fn start(&mut self, true_ns: u64, node: usize) {
        let (now_ns, terms) = (self.local_ns(true_ns, node), self.plan.terms);
        let [run, of_witness, of_fence] = std::array::from_fn(|_| self.next_run());
        let place = self.plan.place_of(node);
        let is_witness = self.plan.witness == node;
        let launch = &mut self.launches[node];
        (launch.run, launch.is_alive, launch.published, launch.is_stopped) = (run, true, None, false);
        launch.candidate = place.map(|place| Candidate::new(terms, place, run));
        launch.witness = is_witness.then(|| Witness::new(now_ns, terms, of_witness));
        (launch.fence, launch.look_ns, launch.seen) = (Fence::new(of_fence), now_ns, (None, 0));
        if is_witness {
            let opens_ns = launch.clock.when(now_ns + LEASE_MAX_NS, true_ns);
            self.well_ns = self.well_ns.max(opens_ns).max(true_ns + self.plan.joins_ns);
        }
        self.set_ready(true_ns, node);
        self.tell(true_ns, node);
    }

    /// All processes of a node die, its launch among them.
    pub(super) fn die(&mut self, node: usize) {
        let launch = &mut self.launches[node];
        (launch.is_alive, launch.candidate, launch.witness) = (false, None, None);
    }

    /// Life of a node's launch; 0: it is dead.
    pub(super) fn run_of(&self, node: usize) -> u32 {
        let launch = &self.launches[node];
        if launch.is_alive { launch.run } else { 0 }
    }

    /// A fault that keeps the module from being on at a node begins, or ends.
    pub(super) fn change_unready(&mut self, true_ns: u64, node: usize, change: impl Fn(&mut u32)) {
        change(&mut self.launches[node].unready);
        self.set_ready(true_ns, node);
        self.tell(true_ns, node);
    }

    fn set_ready(&mut self, true_ns: u64, node: usize) {
        let now_ns = self.local_ns(true_ns, node);
        let launch = &mut self.launches[node];
        if let Some(candidate) = &mut launch.candidate {
            candidate.set_ready(now_ns, launch.unready == 0);
        }
    }

    /// A fault begins (1), is over (-1), or what it does is over only then (0).
    pub(super) fn goes_wrong(&mut self, true_ns: u64, change: i32) {
        self.faults = self.faults.saturating_add_signed(change);
        self.well_ns = self.well_ns.max(true_ns);
        self.kept = None;
    }

    /// When a launch has something to do, true ns, if that is another time than before.
    pub(super) fn next_wake(&mut self, true_ns: u64, node: usize) -> Option<u64> {
        let launch = &mut self.launches[node];
        let at_ns = launch.clock.when(launch.due_ns(), true_ns).max(true_ns + 1);
        (std::mem::replace(&mut launch.wake_ns, at_ns) != at_ns).then_some(at_ns)
    }

    /// Whether a launch that lives is to do something now.
    pub(super) fn is_due(&self, true_ns: u64, node: usize) -> bool {
        self.launches[node].is_alive && self.launches[node].wake_ns == true_ns
    }

    /// The computer of a launch stands still: the launch is to be asked again then.
    pub(super) fn put_off(&mut self, node: usize, at_ns: u64) {
        self.launches[node].wake_ns = at_ns;
    }

    /// Does what is due at a launch.
    pub(super) fn poll(&mut self, true_ns: u64, node: usize) {
        let now_ns = self.local_ns(true_ns, node);
        let half_ns = self.plan.terms.lease_ns() / 2;
        let launch = &mut self.launches[node];
        if now_ns >= launch.due_ns() {
            let own = launch.candidate.as_mut().map(|candidate| candidate.ask(now_ns));
            let look = (now_ns >= launch.look_ns).then(|| {
                launch.look_ns = now_ns + half_ns;
                launch.fence.look(now_ns)
            });
            own.into_iter().chain(look).for_each(|ask| self.send(true_ns, node, ask));
        }
        self.tell(true_ns, node);
    }

    fn send(&mut self, true_ns: u64, from: usize, ask: Ask) {
        if from == self.plan.witness {
            return self.asked(true_ns, from, ask);
        }
        self.posted.push(Posted { from, to: self.plan.witness, role: Role::Asked(ask) });
    }

    /// The witness's launch has a question. Its own router is told before it answers.
    pub(super) fn asked(&mut self, true_ns: u64, from: usize, ask: Ask) {
        let node = self.plan.witness;
        let now_ns = self.local_ns(true_ns, node);
        let Some(answer) = self.launches[node].witness.as_mut().and_then(|witness| witness.ask(now_ns, &ask)) else {
            return;
        };
        if answer.newest.count > 0 && !self.given.contains(&answer.newest) {
            self.given.push(answer.newest);
        }
        self.tell(true_ns, node);
        if from == node {
            return self.answered(true_ns, node, &answer);
        }
        self.posted.push(Posted { from: node, to: from, role: Role::Answered(answer) });
    }

    /// A launch has an answer.
    pub(super) fn answered(&mut self, true_ns: u64, node: usize, answer: &Answer) {
        let now_ns = self.local_ns(true_ns, node);
        let launch = &mut self.launches[node];
        if let Some(candidate) = &mut launch.candidate {
            candidate.take(now_ns, answer);
        }
        if launch.fence.take(answer) {
            launch.seen = (answer.holder, answer.asked_ns);
            launch.look_ns = answer.asked_ns + self.plan.terms.ask_every_ns();
        }
        self.tell(true_ns, node);
    }

    /// Tells a node's router where the name is, as far as its launch knows.
    fn tell(&self, true_ns: u64, node: usize) {
        let place = self.holder_seen(true_ns, node);
        let holder = place.and_then(|place| self.plan.candidates.get(usize::from(place)));
        let text = holder.map_or_else(String::new, |holder| holder_line(self.plan.name, *holder as u8));
        self.plan.moving[node].read(&text);
    }

    /// Place of the holder as a launch knows it: by its own lease, as the witness, or by the last answer for one lease.
    fn holder_seen(&self, true_ns: u64, node: usize) -> Option<u8> {
        let (now_ns, launch, own) = (self.local_ns(true_ns, node), &self.launches[node], self.plan.place_of(node));
        if launch.candidate.as_ref().is_some_and(|candidate| candidate.holds(now_ns).is_some()) {
            return own;
        }
        let place = match &launch.witness {
            Some(witness) => witness.holder(now_ns)?.0,
            None if now_ns >= launch.seen.1 + self.plan.terms.lease_ns() => return None,
            None => launch.seen.0?,
        };
        (own != Some(place)).then_some(place)
    }

    /// The process of a node publishes, if it is on, or was stopped while it was: whether it goes on after that.
    pub(super) fn publish(&mut self, true_ns: u64, node: usize, is_stopped: bool) -> bool {
        let now_ns = self.local_ns(true_ns, node);
        let launch = &mut self.launches[node];
        if is_stopped {
            launch.is_stopped = true;
            return false;
        }
        let holds = launch.candidate.as_ref().and_then(|candidate| candidate.holds(now_ns));
        let goes_on = std::mem::take(&mut launch.is_stopped) && launch.published.is_some();
        let number = if goes_on { launch.published } else { holds };
        launch.published = holds;
        if let Some(lease) = number.and_then(|number| self.given.iter().position(|given| *given == number)) {
            let hearers = self.plan.hearers.iter().filter(|to| **to != node);
            self.posted.extend(hearers.map(|to| Posted { from: node, to: *to, role: Role::Held { lease } }));
        }
        goes_on
    }

    /// What a holder published is delivered: what is wrong with that, if anything is.
    pub(super) fn heard(&mut self, from: usize, to: usize, lease: usize) -> Option<String> {
        let now = Delivered { lease, from };
        let before = self.delivered[to].replace(now).filter(|before| before.lease > lease && before.from != from)?;
        Some(format!("node {to} was delivered what {now:?} published after {before:?}"))
    }

    /// The candidate that holds the lease, whether its computer runs or not.
    pub(super) fn holder(&self, true_ns: u64) -> Option<usize> {
        let holds = |node: &usize| {
            let candidate = self.launches[*node].candidate.as_ref();
            candidate.is_some_and(|candidate| candidate.holds(self.local_ns(true_ns, *node)).is_some())
        };
        self.plan.candidates.iter().copied().find(holds)
    }

    /// What is wrong now: two are on, or need time to be off; or nobody holds it, or another one, though all has been
    /// well for long enough. `may_lose`: the network loses packages.
    pub(super) fn check(&mut self, true_ns: u64, may_lose: bool) -> Option<String> {
        let is_on = |node: &usize| {
            let until_ns = self.launches[*node].candidate.as_ref().and_then(Candidate::until_ns);
            until_ns.is_some_and(|until_ns| self.local_ns(true_ns, *node) < until_ns + self.plan.off_ns)
        };
        let on: Vec<usize> = self.plan.candidates.iter().copied().filter(is_on).collect();
        if on.len() > 1 {
            return Some(format!("the module is on at nodes {on:?}"));
        }
        let is_well = |node: &usize| self.launches[*node].is_alive && self.launches[*node].unready == 0;
        let can_hold = self.launches[self.plan.witness].is_alive && self.plan.candidates.iter().any(is_well);
        if !can_hold || self.faults > 0 || may_lose || true_ns < self.well_ns + self.plan.settling_ns() {
            return None;
        }
        let Some(holder) = self.holder(true_ns) else {
            return Some(format!("all has been well since {} ns, and nobody holds the lease", self.well_ns));
        };
        let kept = *self.kept.get_or_insert(holder);
        (kept != holder).then(|| format!("all is well, and node {holder} holds the lease in place of node {kept}"))
    }

    /// Leases that were given.
    pub(super) fn given(&self) -> usize {
        self.given.len()
    }
}
