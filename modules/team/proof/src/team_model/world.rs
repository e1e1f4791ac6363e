//! Robots, what is on its way between them, and the steps of both.

use super::bounds::{Bounds, Loss, Store, Story};
use super::key::{Key, NAMINGS, Naming, ROBOTS};
use stateright::{Model, Property};
use std::collections::HashSet;
use std::fmt::Debug;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

/// From one beat to the next, ns.
pub(crate) const BEAT_NS: u64 = 1_000_000_000;
/// Ends of rounds after a death that are counted.
pub(crate) const DEAD_MAX: u8 = 4;

/// One that sends and hears, with the system number `place + 1`.
pub(crate) trait Robot: Clone + Debug + Send + Sync + Sized + 'static {
    type Message: Clone + Debug + Send + Sync;
    /// Whether it answers what it hears at once. Then the order of what happens at different robots counts, and each
    /// turn is one action.
    const ANSWERS: bool;
    /// Whether those without records do the same but for their names, if they change places.
    const ARE_ALIKE: bool;
    /// A dead robot starts again; times are ns of its own clock.
    fn restarted(&self, store: Store) -> Self;
    /// What it sends in its beat.
    fn beat(&mut self, now_ns: u64) -> Vec<Self::Message>;
    /// What it answers.
    fn hear(&mut self, now_ns: u64, message: &Self::Message) -> Option<Self::Message>;
    /// Whether it is a message of those of which one is lost.
    fn may_be_lost(message: &Self::Message, loss: Loss) -> bool;
    /// What is stored, and outlives it.
    fn incarnation(&self) -> u32;
    /// What its future depends on.
    fn key(&self, now_ns: u64, key: &mut Key);
    fn message_key(message: &Self::Message, key: &mut Key);
    /// Promises that a step breaks.
    fn broken(step: &Step<'_, Self>) -> Vec<&'static str>;
    fn properties(bounds: Bounds) -> Vec<Property<Teams<Self>>>;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Action {
    Beat(usize),
    /// The first message of a channel comes.
    Take {
        from: usize,
        to: usize,
    },
    /// One that was sent just now is lost.
    Lose {
        from: usize,
        to: usize,
        at: usize,
    },
    /// Nothing more comes to a robot in this round. What is still on its way comes in the next one.
    Rest(usize),
    /// The next round begins.
    Tick,
    Die(usize),
    Restart(usize, Store),
}

/// Actions that follow each other without anything between them that matters: a robot takes some messages and beats,
/// or takes all that is left.
pub(crate) type Turn = Vec<Action>;

/// What a robot takes, and how many others have sent it more than that.
#[derive(Default)]
struct Hearing {
    taken: Turn,
    waiting: usize,
}

impl Hearing {
    fn then(mut self, action: Action) -> Turn {
        self.taken.push(action);
        self.taken
    }
}

/// See the module's head.
#[derive(Clone, Debug)]
pub(crate) struct State<R: Robot> {
    /// Clocks of the robots at the beginning; they differ by it.
    pub(crate) epoch_ns: u64,
    /// Beats since then.
    pub(crate) round: u64,
    /// Robots that have beaten in this round, and those to which nothing more comes in it.
    has_beaten: [bool; ROBOTS],
    rests: [bool; ROBOTS],
    pub(crate) robots: [Arc<R>; ROBOTS],
    pub(crate) is_dead: [bool; ROBOTS],
    /// By receiver, then by sender.
    pub(crate) channels: [[Vec<Arc<R::Message>>; ROBOTS]; ROBOTS],
    pub(crate) left: Bounds,
    /// Ends of rounds since somebody died; 0 while all live.
    pub(crate) dead_for: u8,
    /// Ends of rounds since the last fault. The first one is that of the round in which it was; there was one before
    /// the beginning.
    pub(crate) calm: u8,
    pub(crate) broken: Vec<&'static str>,
    key: u64,
}

impl<R: Robot> PartialEq for State<R> {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl<R: Robot> Hash for State<R> {
    fn hash<H: Hasher>(&self, hasher: &mut H) {
        self.key.hash(hasher);
    }
}

/// One step, and what it comes to.
pub(crate) struct Step<'a, R: Robot> {
    pub(crate) before: &'a State<R>,
    pub(crate) action: Action,
    pub(crate) after: &'a State<R>,
}

impl<R: Robot> State<R> {
    /// Robots as they begin.
    pub(crate) fn new(robots: [R; ROBOTS], epoch_ns: u64, round: u64, left: Bounds) -> Self {
        let mut state = Self {
            epoch_ns,
            round,
            has_beaten: [false; ROBOTS],
            rests: [false; ROBOTS],
            robots: robots.map(Arc::new),
            is_dead: [false; ROBOTS],
            channels: Default::default(),
            left,
            dead_for: 0,
            calm: 1,
            broken: Vec::new(),
            key: 0,
        };
        state.key = state.computed_key(state.calm);
        state
    }

    pub(crate) fn now_ns(&self, place: usize) -> u64 {
        self.epoch_ns * (place as u64 + 1) + self.round * BEAT_NS
    }

    pub(crate) fn alive(&self) -> impl Iterator<Item = usize> {
        (0..ROBOTS).filter(|place| !self.is_dead[*place])
    }

    fn is_round_over(&self) -> bool {
        self.alive().all(|place| self.has_beaten[place])
    }

    /// Whether nothing more comes in this round.
    fn is_quiet(&self) -> bool {
        if R::ANSWERS { self.senders().next().is_none() } else { self.alive().all(|place| self.rests[place]) }
    }

    /// Receivers and senders of what is on its way.
    fn senders(&self) -> impl Iterator<Item = (usize, usize)> {
        let all = self.channels.iter().enumerate();
        all.flat_map(|(to, from)| (0..ROBOTS).filter(move |it| !from[*it].is_empty()).map(move |from| (to, from)))
    }

    /// What may happen next.
    pub(crate) fn turns(&self) -> Vec<Turn> {
        let mut turns = Vec::new();
        let is_over = self.is_round_over();
        for place in self.alive().filter(|place| !self.has_beaten[*place]) {
            let heard = if R::ANSWERS { vec![Hearing::default()] } else { self.hearings(place) };
            let beats: Vec<Turn> = heard.into_iter().map(|heard| heard.then(Action::Beat(place))).collect();
            if self.left.may_lose != Loss::Nothing {
                beats.iter().for_each(|beat| self.add_losses(beat, place, &mut turns));
            }
            turns.extend(beats);
            turns.extend(self.left.may_die.then(|| vec![Action::Die(place)]));
        }
        let awake = self.alive().find(|place| !self.rests[*place]);
        if R::ANSWERS {
            turns.extend(self.senders().map(|(to, from)| vec![Action::Take { from, to }]));
        } else if let Some(place) = awake.filter(|_| is_over) {
            let can_rest = |heard: &Hearing| heard.waiting == 0 || heard.waiting == 1 && self.left.may_delay;
            let heard = self.hearings(place).into_iter().filter(can_rest);
            turns.extend(heard.map(|heard| heard.then(Action::Rest(place))));
        }
        if is_over && self.is_quiet() {
            turns.push(vec![Action::Tick]);
        }
        if !is_over {
            let dead = (0..ROBOTS).filter(|place| self.is_dead[*place]);
            let stores = [Store::Kept, Store::Lost, Store::Old];
            turns.extend(dead.flat_map(|place| stores.map(|store| vec![Action::Restart(place, store)])));
        }
        turns
    }

    /// The turns that go on with the loss of something that their beat has sent. To the robots a message that is lost
    /// later is the same, and promises are counted from the loss on.
    fn add_losses(&self, beat: &Turn, from: usize, turns: &mut Vec<Turn>) {
        let sent = self.after(beat);
        for to in 0..ROBOTS {
            let before = self.channels[to][from].len();
            let new = sent.channels[to][from].iter().enumerate().skip(before);
            let lost = new.filter(|(_, message)| R::may_be_lost(message, self.left.may_lose));
            turns.extend(lost.map(|(at, _)| [&beat[..], &[Action::Lose { from, to, at }]].concat()));
        }
    }

    /// What a robot may take now: each order that makes a difference to it, and each that breaks a promise.
    fn hearings(&self, to: usize) -> Vec<Hearing> {
        let (mut found, mut known) = (Vec::new(), HashSet::new());
        let mut open = vec![(Turn::new(), self.clone())];
        while let Some((taken, state)) = open.pop() {
            let mut key = Key::of(NAMINGS[0]);
            state.robots[to].key(state.now_ns(to), &mut key);
            let left = state.channels[to].each_ref().map(Vec::len);
            if state.broken.is_empty() && !known.insert((left, key.exact())) {
                continue;
            }
            let waiting = left.iter().filter(|left| **left > 0).count();
            for from in (0..ROBOTS).filter(|from| left[*from] > 0 && state.broken.is_empty()) {
                let take = Action::Take { from, to };
                open.push(([&taken[..], &[take]].concat(), state.next(take)));
            }
            found.push(Hearing { taken, waiting: if state.broken.is_empty() { waiting } else { 0 } });
        }
        found
    }

    /// The next state, with the promises that are broken on the way; that way ends where one is.
    pub(crate) fn after(&self, turn: &[Action]) -> Self {
        let mut after = self.clone();
        for action in turn {
            after = after.next(*action);
            if !after.broken.is_empty() {
                break;
            }
        }
        after.key = after.computed_key(after.calm);
        after
    }

    fn next(&self, action: Action) -> Self {
        let mut after = self.clone();
        after.step(action);
        after.broken = R::broken(&Step { before: self, action, after: &after });
        after
    }

    fn step(&mut self, action: Action) {
        match action {
            Action::Beat(place) => {
                let now_ns = self.now_ns(place);
                let messages = Arc::make_mut(&mut self.robots[place]).beat(now_ns);
                messages.into_iter().for_each(|message| self.send(place, message));
                self.has_beaten[place] = true;
            }
            Action::Take { from, to } => {
                let now_ns = self.now_ns(to);
                let message = self.channels[to][from].remove(0);
                let answer = Arc::make_mut(&mut self.robots[to]).hear(now_ns, &message);
                answer.into_iter().for_each(|message| self.send(to, message));
            }
            Action::Lose { from, to, at } => {
                self.channels[to][from].remove(at);
                self.left.may_lose = Loss::Nothing;
                self.calm = 0;
            }
            Action::Rest(place) => {
                self.rests[place] = true;
                if self.channels[place].iter().any(|left| !left.is_empty()) {
                    self.left.may_delay = false;
                    self.calm = 0;
                }
            }
            Action::Tick => self.tick(),
            Action::Die(place) => {
                self.is_dead[place] = true;
                self.channels[place] = Default::default();
                self.left.may_die = false;
                self.calm = 0;
            }
            Action::Restart(place, store) => {
                self.robots[place] = Arc::new(self.robots[place].restarted(store));
                self.is_dead[place] = false;
                self.dead_for = 0;
                self.calm = 0;
            }
        }
    }

    fn tick(&mut self) {
        self.round += 1;
        self.has_beaten = [false; ROBOTS];
        self.rests = [false; ROBOTS];
        self.calm = (self.calm + 1).min(self.left.calm_max);
        self.dead_for = (self.dead_for + u8::from(self.is_dead != [false; ROBOTS])).min(DEAD_MAX);
    }

    fn send(&mut self, from: usize, message: R::Message) {
        let message = Arc::new(message);
        for to in (0..ROBOTS).filter(|to| *to != from && !self.is_dead[*to]) {
            self.channels[to][from].push(message.clone());
        }
    }

    /// What the future depends on, with this count of calm rounds.
    pub(crate) fn computed_key(&self, calm: u8) -> u64 {
        let is_any_name = R::ARE_ALIKE && self.left.story == Story::Nothing;
        let namings = if is_any_name { &NAMINGS[..] } else { &NAMINGS[..1] };
        namings.iter().map(|naming| self.named_key(calm, *naming)).min().unwrap_or_default()
    }

    /// The key of this state, if its robots had these names.
    pub(crate) fn named_key(&self, calm: u8, naming: Naming) -> u64 {
        let mut key = Key::of(naming);
        let places = || Key::of(naming).robots().map(|robot| usize::from(robot.get()) - 1);
        key.hash(&(self.left, self.dead_for, calm, &self.broken));
        for place in places() {
            key.hash(&(self.has_beaten[place], self.rests[place], self.is_dead[place]));
            if self.is_dead[place] {
                key.plain(self.robots[place].incarnation());
                continue;
            }
            self.robots[place].key(self.now_ns(place), &mut key);
            for from in places().map(|from| &self.channels[place][from]) {
                key.plain(from.len() as u64);
                from.iter().for_each(|message| R::message_key(message, &mut key));
            }
        }
        key.finish()
    }
}

/// Messages that are on their way in one channel: as many as the core ever sends in two rounds.
const CHANNEL_MAX: usize = 6;

/// The model: robots of one kind, as they begin.
pub(crate) struct Teams<R: Robot> {
    pub(crate) first: State<R>,
}

impl<R: Robot> Model for Teams<R> {
    type State = State<R>;
    type Action = Turn;

    fn init_states(&self) -> Vec<State<R>> {
        vec![self.first.clone()]
    }

    fn actions(&self, state: &State<R>, turns: &mut Vec<Turn>) {
        // What follows from a broken promise shows nothing.
        if state.broken.is_empty() {
            turns.extend(state.turns());
        }
    }

    fn next_state(&self, before: &State<R>, turn: Turn) -> Option<State<R>> {
        Some(before.after(&turn))
    }

    fn within_boundary(&self, state: &State<R>) -> bool {
        state.channels.iter().flatten().all(|channel| channel.len() <= CHANNEL_MAX)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        R::properties(self.first.left)
    }
}
