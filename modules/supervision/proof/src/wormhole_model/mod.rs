//! The wormhole and everybody around it, one step at a time: any program, any person, any launch.
//!
//! | of the world | is in the model |
//! | --- | --- |
//! | the program | any promise at any time: repeated, late, too long, or no number |
//! | its death | no promise any more |
//! | launch's restart | promises of a newer run, between those of the older one, which may still send |
//! | a person | promises like a program's; takes over, gives back, resets; another person takes over |
//! | the wormhole's death | a new one, which knows nothing |
//! | halts | two callers, each holds and lets go; all let go at once |
//! | the scanner | sight that comes and goes |
//! | the clock | ticks. The caller looks when something is due, or a little late |
//!
//! The environment has no memory, so it can do at any time whatever a real one can. A state of the model is a reduced
//! wormhole (`state.rs`) and what the world knows (`world.rs`, the specification); `promises.rs` compares them after
//! each step. Liveness is counted in ticks: stateright's `eventually` forgets what closes a cycle.
//!
//! Not in the model: times that are no whole ticks, bounds larger than those of `action.rs`, more than two callers that
//! halt, and what the module `wormhole` adds (the envelope, its mailboxes, the restart itself).

mod action;
mod promises;
mod reaction;
// A part of the core's `wormhole.rs`; named so that rustfmt finds it.
#[cfg(any())]
mod state;
mod walk;
mod world;

use super::wormhole::state::CALLERS;
use super::{Driver, Wormhole};
use crate::check;
use action::{Action, Bounds, SMALL, promises_of};
use promises::{State, Step};
use reaction::{ODD, PLAIN, Told};
use stateright::{Model, Property};
pub(crate) use walk::walks;
use world::World;

impl Model for Bounds {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        let core = Wormhole::new(self.settings()).reduced(PLAIN.now_ns);
        vec![State { core, world: World::default(), told: Told::default(), broken: Vec::new() }]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        if !state.broken.is_empty() {
            // What follows from a broken promise shows nothing.
            return;
        }
        if state.told != Told::default() {
            return actions.push(Action::Settle);
        }
        if self.may_tick(&state.core) {
            actions.push(Action::Tick);
        }
        actions.extend([Action::Look, Action::Reset, Action::ResumeAll, Action::Die]);
        for driver in [Driver::Program, Driver::Person] {
            actions.push(Action::Drive(driver));
            actions.extend(promises_of(driver, self).map(Action::Promise));
        }
        actions.extend([true, false].map(Action::Sight));
        for by in 0..CALLERS {
            actions.extend([Action::Halt(by), Action::Resume(by)]);
        }
    }

    fn next_state(&self, before: &State, action: Action) -> Option<State> {
        let voice = before.world.voice(&action, self);
        let outcome = self.take(&before.core, &action, voice, &PLAIN);
        let mut world = before.world;
        let happened = world.step(&action, voice, self);
        let step = Step {
            bounds: self,
            before,
            action,
            world: &world,
            happened,
            outcome,
            is_alike: outcome == self.take(&before.core, &action, voice, &ODD),
        };
        let broken = step.broken();
        let is_new = (outcome.core, world) != (before.core, before.world);
        // A refusal leaves nothing behind, so it needs no state of its own for each state that it may come in.
        if !is_new && outcome.told.refusal.is_some() && broken.is_empty() {
            return Some(State { told: outcome.told, ..self.init_states().remove(0) });
        }
        let after = State { core: outcome.core, world, told: outcome.told, broken };
        (after != *before).then_some(after)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        promises::properties()
    }
}

/// Whether all promises are kept in all states.
pub(crate) fn holds() {
    check::holds("wormhole", Bounds::chosen());
}

/// That each promise is broken by a mistake.
pub(crate) fn can_fail() {
    check::each_promise_can_fail(&SMALL);
}
