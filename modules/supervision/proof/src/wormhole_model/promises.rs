//! What the wormhole promises, in words and as a check of one step; and what has to be possible, so that the promises
//! are not kept by a wormhole that does nothing.

use super::super::wormhole::state::{CoreState, Voice};
use super::super::{Control, Driver, Mode, Refusal};
use super::action::{Action, Bounds};
use super::reaction::{Outcome, PLAIN, Told};
use super::world::{Happened, Silence, World};
use stateright::Property;

/// A state of the model.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct State {
    pub(super) core: CoreState,
    pub(super) world: World,
    pub(super) told: Told,
    /// Promises that the last step broke.
    pub(super) broken: Vec<&'static str>,
}

/// A step of the core, beside what the world knows.
pub(super) struct Step<'a> {
    pub(super) bounds: &'a Bounds,
    pub(super) before: &'a State,
    pub(super) action: Action,
    /// Afterwards, and what happened to it.
    pub(super) world: &'a World,
    pub(super) happened: Happened,
    pub(super) outcome: Outcome,
    /// Whether the step came to the same in both frames.
    pub(super) is_alike: bool,
}

/// A promise: its words, which are the property's name, and whether a step keeps it.
macro_rules! promises {
    ($($words:literal: $is_kept:expr;)*) => {
        const PROMISES: &[(&str, fn(&Step<'_>) -> bool)] = &[$(($words, $is_kept)),*];

        fn always() -> Vec<Property<Bounds>> {
            vec![$(Property::always($words, |_, state: &State| !state.broken.contains(&$words))),*]
        }
    };
}

promises! {
    "control is of a run that has kept a promise": |step| !step.has(Mode::Active) || step.world.kept == 2;
    "a command in effect is of the driver in control": |step| step.effect().is_none_or(|voice| match voice {
        Voice::Program | Voice::Briefly => step.has(Mode::Active) && step.world.driver == Driver::Program,
        Voice::Person => step.has(Mode::Active) && step.world.driver == Driver::Person,
        Voice::Refused => false,
        Voice::NotFinite => true,
    });
    "a command in effect is the one promised last": |step| {
        step.effect().is_none_or(|voice| Some(voice) == step.world.voice || voice == Voice::NotFinite)
    };
    "a command in effect is a number": |step| step.effect() != Some(Voice::NotFinite);
    "no command is in effect without sight": |step| step.effect().is_none() || step.world.sees;
    "no command is in effect after its deadline": |step| step.effect().is_none() || step.world.left > 0;
    "a halt holds until each caller lets go": |step| step.effect().is_none() || step.world.held == [false; 2];
    "nothing else holds": |step| {
        step.effect().is_some() || !step.has(Mode::Active) || step.world.left <= 0 || step.world.held != [false; 2]
    };
    "each loss of control has one cause": |step| {
        let Happened { missed, other_run, other_driver, blind, .. } = step.happened;
        let causes = [missed, other_run, other_driver, blind].into_iter().filter(|is_cause| *is_cause).count();
        let had = step.before.core.mode == Mode::Active && step.action != Action::Die;
        !had || causes == usize::from(!step.has(Mode::Active))
    };
    "control is told as it comes and goes": |step| {
        let had = step.before.core.mode == Mode::Active && step.action != Action::Die;
        step.outcome.told.control == match (had, step.has(Mode::Active)) {
            (false, true) => Some(Control::On),
            (true, false) => Some(Control::Off),
            _ => None,
        }
    };
    "a missed deadline ends control and test soon": |step| {
        !step.is_tried() || step.world.kept > 0 && step.world.left >= -(step.bounds.late as i8)
    };
    // Otherwise its caller would look for ever, and the model's time would stand.
    "nothing is due after a look": |step| !step.action.lets_time_pass() || step.outcome.is_due != Some(true);
    "nothing is due in failed": |step| !step.has(Mode::Failed) || step.outcome.is_due.is_none();
    "nothing else ends a test": |step| step.world.kept == 0 || step.is_tried();
    "a driver that keeps its promises has control within two ticks": |step| {
        step.world.prompt < 2 || step.has(Mode::Active)
    };
    "a deadline is the promise's own, within the horizon": |step| {
        step.outcome.core.left.is_none_or(|left| left == step.world.left)
    };
    "a promise is refused for what is wrong with it, and for nothing else": |step| {
        let Action::Promise(sent) = &step.action else { return true };
        let mut causes = step.before.world.causes(sent, step.bounds);
        causes.extend(step.world.has_failed.then_some(Refusal::Failed));
        step.outcome.told.refusal.map_or(causes.is_empty(), |refusal| causes.contains(&refusal))
    };
    "a refused promise uses up numbers, and changes nothing": |step| {
        let looked = || step.bounds.take(&step.before.core, &Action::Look, Voice::Refused, &PLAIN);
        let but_numbers = |core: CoreState| CoreState { known: [false; 2], is_last_run: false, ..core };
        step.outcome.told.refusal.is_none() || but_numbers(step.outcome.core) == but_numbers(looked().core)
    };
    "only a deadline that the program missed is a failure": |step| step.outcome.core.failures == step.world.misses;
    "a restart is for a silent or a failing program": |step| {
        let is_asked_again = step.before.world.silence == Silence::Ended;
        step.outcome.told.restart.is_none_or(|is_last| is_last && (step.happened.restart || is_asked_again))
    };
    "a restart is asked for once in a silence": |step| {
        step.outcome.told.restart.is_none() || step.happened.restart || step.before.world.silence != Silence::Ended
    };
    "a silent program is restarted within the wait": |step| match step.world.silence {
        Silence::Since(ticks) => ticks <= step.bounds.wait + step.bounds.late,
        Silence::None | Silence::Ended => true,
    };
    "a program that is to be restarted is, unless it has failed": |step| {
        step.happened.restart == step.outcome.told.restart.is_some() || step.has(Mode::Failed)
    };
    "too many failures in a window end in failed": |step| !step.world.has_failed || step.has(Mode::Failed);
    "failed begins with too many failures": |step| {
        !step.has(Mode::Failed) || step.world.has_failed || step.before.core.mode == Mode::Failed
    };
    "failed ends by a reset alone": |step| {
        let ends = step.before.core.mode == Mode::Failed && !step.has(Mode::Failed);
        ends == (step.before.core.mode == Mode::Failed && matches!(step.action, Action::Reset | Action::Die))
    };
    "what the model leaves out has no influence": |step| step.is_alike;
}

impl Step<'_> {
    /// The promises that it breaks.
    pub(super) fn broken(&self) -> Vec<&'static str> {
        PROMISES.iter().filter(|(_, is_kept)| !is_kept(self)).map(|(words, _)| *words).collect()
    }

    fn has(&self, mode: Mode) -> bool {
        self.outcome.core.mode == mode
    }

    fn is_tried(&self) -> bool {
        self.has(Mode::Test) || self.has(Mode::Active)
    }

    fn effect(&self) -> Option<Voice> {
        self.outcome.effect
    }
}

/// What has to happen somewhere: its words, and the state in which it just did.
macro_rules! possible {
    ($($words:literal: $has_happened:expr;)*) => {
        fn sometimes() -> Vec<Property<Bounds>> {
            vec![$(Property::<Bounds>::sometimes($words, $has_happened)),*]
        }
    };
}

possible! {
    "disabled": |_, state| state.core.mode == Mode::Disabled;
    "test": |_, state| state.core.mode == Mode::Test;
    "the program has control": |_, state| has_control(state, Driver::Program);
    "a person has control": |_, state| has_control(state, Driver::Person);
    "failed": |_, state| state.core.mode == Mode::Failed;
    "two hold the robot, which has control": |_, state| state.world.held == [true; 2] && state.world.kept == 2;
    "two hold the robot, which has failed": |_, state| state.world.held == [true; 2] && state.world.has_failed;
    "control on": |_, state| state.told.control == Some(Control::On);
    "control off": |_, state| state.told.control == Some(Control::Off);
    "control off and a test": |_, state| state.told.control == Some(Control::Off) && state.core.mode == Mode::Test;
    "restart of a silent program": |_, state| state.told.restart.is_some() && state.world.recent[0] == 1;
    "restart of a program that has just failed again": |_, state| {
        state.told.restart.is_some() && state.world.recent[0] > 1
    };
    "restart as the program comes back": |_, state| {
        state.told.restart.is_some() && state.core.mode == Mode::Test
    };
    "a person misses a deadline": |_, state| {
        state.told.control == Some(Control::Off) && state.core.driver == Driver::Person
    };
    "a driver is prompt for two ticks": |_, state| state.world.prompt == 2;
    "a run in control that is not the last one": |_, state| state.world.kept == 2 && !state.world.is_last_run;
    "refused: not finite": |_, state| state.told.refusal == Some(Refusal::NotFinite);
    "refused: old incarnation": |_, state| state.told.refusal == Some(Refusal::OldIncarnation);
    "refused: old sequence": |_, state| state.told.refusal == Some(Refusal::OldSequence);
    "refused: late": |_, state| state.told.refusal == Some(Refusal::Late);
    "refused: blind": |_, state| state.told.refusal == Some(Refusal::Blind);
    "refused: other driver": |_, state| state.told.refusal == Some(Refusal::OtherDriver);
    "refused: failed": |_, state| state.told.refusal == Some(Refusal::Failed);
}

fn has_control(state: &State, driver: Driver) -> bool {
    state.core.mode == Mode::Active && state.core.driver == driver
}

/// All of both.
pub(super) fn properties() -> Vec<Property<Bounds>> {
    always().into_iter().chain(sometimes()).collect()
}
