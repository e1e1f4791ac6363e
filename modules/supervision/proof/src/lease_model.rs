//! The lease as a model: two candidates, a witness and a fence, each order of their steps until a horizon. The model
//! runs the copied sources. The simulation goes further in time, and shows that one soon holds again; here no order of
//! so many steps is left out.
//!
//! Time goes in steps of half a second. Clocks are wrong by the most that is stated, each to either side. The witness
//! began long ago, and candidate 0 holds a lease. Each candidate asks when it is due; a message may come at any later
//! time, or never. At most one fault happens, of any kind at any time; with two faults the run does
//! not end within minutes.

use super::lease::{Answer, Ask, Candidate, Fence, LEASE_MAX_NS, Number, Terms, Witness};
use crate::check;
use stateright::{Model, Property};

const STEP_NS: u64 = 500_000_000;
const RATE_ERROR_PPM: u32 = 100_000;
const HORIZON: u8 = 6;
/// Messages that are on their way at a time; of more than these the oldest is lost.
const MESSAGES_MAX: usize = 2;
/// Places beyond the candidates.
const WITNESS: usize = 2;
const FENCE: usize = 3;

fn terms() -> Terms {
    Terms::new(LEASE_MAX_NS, 450_000_000, 0, RATE_ERROR_PPM).expect("times that fit")
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Message {
    Asked { from: usize, ask: Ask },
    Answered { to: usize, answer: Answer },
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Program {
    core: Candidate,
    is_stopped: bool,
    /// About to be sent when it was stopped.
    unsent: Option<Number>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct LeaseState {
    time: u8,
    is_fast: [bool; 3],
    programs: [Program; 2],
    witness: Witness,
    fence: Fence,
    messages: Vec<Message>,
    had_fault: bool,
    runs: u32,
    /// Numbers as they were given.
    given: Vec<Number>,
    /// Place in `given` of what passed last.
    passed: usize,
    is_out_of_order: bool,
    has_refused: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LeaseAction {
    Pass,
    Send(usize),
    Deliver(usize),
    DeliverTwice(usize),
    Stop(usize),
    GoOn(usize),
    Restart(usize),
    Release(usize),
    Ready(usize),
    RestartWitness,
}

impl LeaseState {
    fn clock(&self, place: usize) -> u64 {
        let error_ns = STEP_NS / 1_000_000 * u64::from(RATE_ERROR_PPM);
        let step_ns = if self.is_fast[place] { STEP_NS + error_ns } else { STEP_NS - error_ns };
        let began_ns = if place == WITNESS { LEASE_MAX_NS } else { 0 };
        began_ns + u64::from(self.time) * step_ns
    }

    /// Both have asked twice, and were answered at once: candidate 0 holds. The fence knows the witness.
    fn initial(is_fast: [bool; 3]) -> Self {
        let program = |place: u8| {
            let mut core = Candidate::new(terms(), place, u32::from(place) + 2);
            core.set_ready(0, true);
            Program { core, is_stopped: false, unsent: None }
        };
        let mut state = Self {
            time: 0,
            is_fast,
            programs: [program(0), program(1)],
            witness: Witness::new(0, terms(), 1),
            fence: Fence::new(4),
            messages: Vec::new(),
            had_fault: false,
            runs: 4,
            given: Vec::new(),
            passed: 0,
            is_out_of_order: false,
            has_refused: false,
        };
        let look = state.fence.look(0);
        state.put(Message::Asked { from: FENCE, ask: look });
        for (time, place) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            state.time = time;
            state.poll(place);
            while !state.messages.is_empty() {
                let message = state.messages.remove(0);
                state.deliver(message);
            }
        }
        assert!(state.programs[0].core.holds(state.clock(0)).is_some(), "the model begins with a holder");
        state
    }

    fn put(&mut self, message: Message) {
        if !self.messages.contains(&message) {
            self.messages.push(message);
            let excess = self.messages.len().saturating_sub(MESSAGES_MAX);
            self.messages.drain(..excess);
        }
    }

    fn poll(&mut self, place: usize) {
        let now_ns = self.clock(place);
        let program = &mut self.programs[place];
        if !program.is_stopped
            && let Some(ask) = program.core.poll(now_ns)
        {
            self.put(Message::Asked { from: place, ask });
        }
    }

    fn deliver(&mut self, message: Message) {
        match message {
            Message::Asked { from, ask } => {
                let Some(answer) = self.witness.ask(self.clock(WITNESS), &ask) else { return };
                if answer.newest.count > 0 && !self.given.contains(&answer.newest) {
                    self.given.push(answer.newest);
                }
                self.put(Message::Answered { to: from, answer });
            }
            Message::Answered { to: FENCE, answer } => _ = self.fence.take(&answer),
            Message::Answered { to, answer } => {
                let now_ns = self.clock(to);
                self.programs[to].core.take(now_ns, &answer);
            }
        }
    }

    /// Data come at once: late ones are those of a program that was stopped.
    fn send(&mut self, number: Number) {
        if self.fence.admit(number).is_ok() {
            let place = self.given.iter().position(|given| *given == number).expect("it was given");
            self.is_out_of_order |= place < self.passed;
            self.passed = place;
        } else {
            self.has_refused = true;
            let ask = self.fence.look(u64::from(self.time));
            self.put(Message::Asked { from: FENCE, ask });
        }
    }

    fn is_on(&self, place: usize) -> bool {
        self.programs[place].core.holds(self.clock(place)).is_some()
    }

    fn next_run(&mut self) -> u32 {
        self.runs += 1;
        self.runs
    }

    fn step(&mut self, action: LeaseAction) {
        match action {
            LeaseAction::Pass => {
                self.time += 1;
                (0..WITNESS).for_each(|place| self.poll(place));
            }
            LeaseAction::Send(place) => {
                let unsent = self.programs[place].unsent.take();
                let number = unsent.or_else(|| self.programs[place].core.holds(self.clock(place)));
                number.into_iter().for_each(|number| self.send(number));
            }
            LeaseAction::Deliver(index) => {
                let message = self.messages.remove(index);
                self.deliver(message);
            }
            LeaseAction::DeliverTwice(index) => {
                self.had_fault = true;
                self.deliver(self.messages[index]);
            }
            LeaseAction::Stop(place) => {
                self.had_fault = true;
                let number = self.programs[place].core.holds(self.clock(place));
                self.programs[place].is_stopped = true;
                self.programs[place].unsent = number;
            }
            LeaseAction::GoOn(place) => self.programs[place].is_stopped = false,
            LeaseAction::Restart(place) => {
                self.had_fault = true;
                let mut core = Candidate::new(terms(), place as u8, self.next_run());
                core.set_ready(self.clock(place), true);
                self.programs[place] = Program { core, is_stopped: false, unsent: None };
            }
            LeaseAction::Release(place) => {
                self.had_fault = true;
                let now_ns = self.clock(place);
                self.programs[place].core.set_ready(now_ns, false);
            }
            LeaseAction::Ready(place) => {
                let now_ns = self.clock(place);
                self.programs[place].core.set_ready(now_ns, true);
            }
            LeaseAction::RestartWitness => {
                self.had_fault = true;
                self.witness = Witness::new(self.clock(WITNESS), terms(), self.next_run());
            }
        }
    }
}

struct Leases;

impl Model for Leases {
    type State = LeaseState;
    type Action = LeaseAction;

    fn init_states(&self) -> Vec<LeaseState> {
        let sides = [false, true];
        let each = |witness| sides.map(|first| sides.map(|second| LeaseState::initial([first, second, witness])));
        sides.map(each).into_iter().flatten().flatten().collect()
    }

    fn actions(&self, state: &LeaseState, actions: &mut Vec<LeaseAction>) {
        if state.time < HORIZON {
            actions.push(LeaseAction::Pass);
        }
        let may = |fault| (!state.had_fault).then_some(fault);
        for (place, program) in state.programs.iter().enumerate() {
            if program.is_stopped {
                actions.push(LeaseAction::GoOn(place));
                continue;
            }
            actions.extend([LeaseAction::Send(place), LeaseAction::Ready(place)]);
            actions.extend(may(LeaseAction::Stop(place)));
            actions.extend(may(LeaseAction::Release(place)));
            actions.extend(may(LeaseAction::Restart(place)));
        }
        actions.extend(may(LeaseAction::RestartWitness));
        for (index, message) in state.messages.iter().enumerate() {
            let is_stopped = |to: usize| state.programs.get(to).is_some_and(|program| program.is_stopped);
            if matches!(message, Message::Answered { to, .. } if is_stopped(*to)) {
                continue;
            }
            actions.push(LeaseAction::Deliver(index));
            actions.extend(may(LeaseAction::DeliverTwice(index)));
        }
    }

    fn next_state(&self, last: &LeaseState, action: LeaseAction) -> Option<LeaseState> {
        let mut state = last.clone();
        state.step(action);
        (state != *last).then_some(state)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always("never two", |_, state: &LeaseState| !(state.is_on(0) && state.is_on(1))),
            Property::always("nothing older passes", |_, state: &LeaseState| !state.is_out_of_order),
            Property::sometimes("the second takes over", |_, state: &LeaseState| state.is_on(1)),
            Property::sometimes("an old number is refused", |_, state: &LeaseState| {
                state.passed > 0 && state.has_refused
            }),
            Property::sometimes("a restarted witness grants", |_, state: &LeaseState| {
                state.given.last().is_some_and(|number| number.witness != 1)
            }),
        ]
    }
}

/// Whether all promises are kept in all states.
pub(crate) fn holds() {
    check::holds_by("lease", |checker| checker.spawn_dfs(), Leases);
}

/// That each promise is broken by a mistake.
pub(crate) fn can_fail() {
    check::each_promise_can_fail(&Leases);
}
