//! What everybody around the wormhole knows: which driver counts, what was promised, for how long it is silent. So the
//! world says what the wormhole is to do, without a look into it: in ticks, without clocks and numbers.

use super::super::wormhole::state::{Ages, CALLERS, Run, Voice};
use super::super::{Driver, Refusal};
use super::action::{Action, Bounds, Sent};

/// The program's turn to promise, if it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) enum Silence {
    /// The program's last promise stands, or nobody waits for one.
    #[default]
    None,
    /// For so many ticks.
    Since(u8),
    /// Until a restart was asked for. Nobody asks again in the same silence.
    Ended,
}

/// See the module's head.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct World {
    pub(super) driver: Driver,
    pub(super) sees: bool,
    pub(super) held: [bool; CALLERS],
    /// Whether the program, and the person that drives now, have promised with numbers that count.
    pub(super) known: [bool; 2],
    /// Promises that one run of one driver has kept in a row, up to two; the last one still runs.
    pub(super) kept: u8,
    /// Ticks until the last one is over.
    pub(super) left: i8,
    /// The command of the last one, from the second one on.
    pub(super) voice: Option<Voice>,
    /// Whether the last promise, taken or not, was of that run.
    pub(super) is_last_run: bool,
    /// Deadlines that the program has missed since it had control, or was to be restarted.
    pub(super) misses: u8,
    /// All of these, and restarts, within the window.
    pub(super) recent: Ages,
    pub(super) has_failed: bool,
    pub(super) silence: Silence,
    /// Ticks in a row, up to two, in each of which the program sent a promise that lasts into the next one.
    pub(super) prompt: u8,
    /// Whether it did so in this tick.
    pub(super) is_prompt: bool,
}

/// What happened to the world in a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Happened {
    /// A deadline is found to be over.
    pub(super) missed: bool,
    /// The program is to be restarted.
    pub(super) restart: bool,
    /// Control or test passes to another run or driver, or is lost without sight.
    pub(super) other_run: bool,
    pub(super) other_driver: bool,
    pub(super) blind: bool,
}

impl World {
    /// All that is wrong with a promise.
    pub(super) fn causes(&self, sent: &Sent, bounds: &Bounds) -> Vec<Refusal> {
        let is_known = self.known[sent.driver as usize];
        [
            (!sent.is_finite, Refusal::NotFinite),
            (is_known && sent.run == Run::Older, Refusal::OldIncarnation),
            (is_known && sent.run == Run::Same && sent.repeats, Refusal::OldSequence),
            (sent.duration.min(bounds.horizon) <= sent.age, Refusal::Late),
            (!self.sees, Refusal::Blind),
            (sent.driver != self.driver, Refusal::OtherDriver),
            (self.has_failed, Refusal::Failed),
        ]
        .into_iter()
        .filter_map(|(is_so, cause)| is_so.then_some(cause))
        .collect()
    }

    /// The command of an action's promise: of which source, or that it must not come into effect.
    pub(super) fn voice(&self, action: &Action, bounds: &Bounds) -> Voice {
        let Action::Promise(sent) = action else { return Voice::Refused };
        match self.causes(sent, bounds).first() {
            Some(Refusal::NotFinite) => Voice::NotFinite,
            Some(_) => Voice::Refused,
            None if sent.driver == Driver::Person => Voice::Person,
            None if sent.duration == 1 => Voice::Briefly,
            None => Voice::Program,
        }
    }

    /// The world after an action; `voice` is the command of its promise.
    pub(super) fn step(&mut self, action: &Action, voice: Voice, bounds: &Bounds) -> Happened {
        let mut happened = Happened::default();
        if action.lets_time_pass() {
            (happened.missed, happened.restart) = self.settle(bounds);
        }
        match action {
            Action::Tick => self.tick(bounds),
            Action::Promise(sent) => self.promise(sent, voice, bounds, &mut happened),
            Action::Sight(sees) => {
                let has_come = *sees && !self.sees;
                self.sees = *sees;
                if !sees {
                    happened.blind = self.kept > 0;
                    self.stand_by();
                }
                if has_come {
                    self.expect();
                }
            }
            Action::Drive(Driver::Program) if self.driver == Driver::Program => {}
            Action::Drive(driver) => {
                happened.other_driver = self.kept > 0;
                self.stand_by();
                (self.driver, self.known[1]) = (*driver, false);
                self.expect();
            }
            Action::Reset => {
                (self.has_failed, self.misses, self.recent) = (false, 0, Ages::default());
                self.expect();
            }
            Action::Halt(by) => self.held[*by] = true,
            Action::Resume(by) => self.held[*by] = false,
            Action::ResumeAll => self.held = Default::default(),
            Action::Die => *self = Self::default(),
            Action::Look | Action::Settle => {}
        }
        happened
    }

    fn tick(&mut self, bounds: &Bounds) {
        self.left -= i8::from(self.kept > 0);
        self.recent.copy_within(..usize::from(bounds.window) - 1, 1);
        self.recent[0] = 0;
        if let Silence::Since(ticks) = &mut self.silence {
            *ticks += 1;
        }
        self.prompt = if self.is_prompt { (self.prompt + 1).min(2) } else { 0 };
        self.is_prompt = false;
    }

    /// A deadline that is over is missed. A program that is silent for the wait, or fails too often, is restarted.
    fn settle(&mut self, bounds: &Bounds) -> (bool, bool) {
        let missed = self.kept > 0 && self.left <= 0;
        if missed {
            self.give_up();
            if self.driver == Driver::Program {
                self.misses += 1;
                self.silence = Silence::Since(0);
                self.count(bounds);
            }
        }
        let is_silent = matches!(self.silence, Silence::Since(ticks) if ticks >= bounds.wait);
        let restart = !self.has_failed && (is_silent || self.misses > bounds.failures_before_restart);
        if restart {
            self.silence = Silence::Ended;
            self.count(bounds);
            // A person that looks at a program that has failed sees what it failed by.
            self.misses = if self.has_failed { self.misses } else { 0 };
        }
        (missed, restart)
    }

    fn count(&mut self, bounds: &Bounds) {
        self.recent[0] += 1;
        if self.recent.iter().sum::<u8>() >= bounds.failures_max {
            self.has_failed = true;
            self.stand_by();
            self.recent = Ages::default();
        }
    }

    fn promise(&mut self, sent: &Sent, voice: Voice, bounds: &Bounds, happened: &mut Happened) {
        let causes = self.causes(sent, bounds);
        let was_known = self.known[sent.driver as usize];
        let has_old_numbers = [Refusal::NotFinite, Refusal::OldIncarnation, Refusal::OldSequence];
        if has_old_numbers.iter().any(|cause| causes.contains(cause)) {
            return;
        }
        self.known[sent.driver as usize] = true;
        let is_other_run = self.kept > 0 && !(was_known && self.is_last_run && sent.run == Run::Same);
        if !causes.is_empty() {
            self.is_last_run &= !(is_other_run && sent.driver == self.driver);
            return;
        }
        happened.other_run = is_other_run;
        if is_other_run {
            self.give_up();
        }
        self.kept = (self.kept + 1).min(2);
        self.voice = (self.kept == 2).then_some(voice);
        self.misses = if self.kept == 2 { 0 } else { self.misses };
        (self.left, self.is_last_run) = ((sent.duration.min(bounds.horizon) - sent.age) as i8, true);
        self.silence = Silence::None;
        self.is_prompt = self.left > 1;
    }

    /// Nobody has control, and nothing is waited for.
    fn stand_by(&mut self) {
        self.give_up();
        self.silence = Silence::None;
    }

    fn give_up(&mut self) {
        (self.kept, self.left, self.voice, self.is_last_run) = (0, 0, None, false);
        (self.prompt, self.is_prompt) = (0, false);
    }

    /// A program that has promised before has its turn.
    fn expect(&mut self) {
        let is_its_turn = self.driver == Driver::Program && self.sees && self.kept == 0 && !self.has_failed;
        if is_its_turn && self.known[0] {
            self.silence = Silence::Since(0);
        }
    }
}
