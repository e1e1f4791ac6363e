//! Control of the motor, and its end: the seed's wormhole, without its defects (digest, section 1, [B1] to [B4]).
//!
//! ```text
//!            a promise            the next one in time: control on
//!  Disabled ───────────▶ Test ──────────────────────────────────▶ Active ──┐ each promise in time
//!   ▲   ▲                 │                                        │  ▲─────┘
//!   │   └─ deadline missed┘          deadline missed: control off  │
//!   └──────────────────────────────────────────────────────────────┘   failures in a window ──▶ Failed, until a reset
//! ```
//!
//! In each mode but `Active`, and while anybody holds a halt, no command is in effect: the robot brakes. Decided where
//! the seed is silent:
//!
//! - The wormhole starts disabled. The promise that ends `Test` is in effect.
//! - A deadline that is missed in `Test` counts as a failure, and the wait begins anew.
//! - A restart is asked for once for each silence, not for a person's. Whether the program begins is for launch to see.
//! - A deadline may come nearer by a later promise: a program may bind itself more, never less than it said last.

use crate::window::{REMEMBERED, Window};
use crate::{Command, Halts, Order, Promise, Refusal};

/// Times and numbers of a wormhole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// No promise reaches further than this from its arrival, ns; a longer one is cut to it.
    pub horizon_ns: u64,
    /// After control was lost, the program has so long to promise again, ns (the seed's MAXWAIT).
    pub wait_ns: u64,
    /// A program that has failed more often than this without control in between is restarted.
    pub failures_before_restart: u32,
    /// So many failures and restarts in `window_ns` end in [`Mode::Failed`]; at most 16.
    pub failures_max: u32,
    /// See `failures_max`, ns.
    pub window_ns: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            horizon_ns: 1_000_000_000,
            wait_ns: 1_000_000_000,
            failures_before_restart: 3,
            failures_max: 10,
            window_ns: 60_000_000_000,
        }
    }
}

/// The driver's control of the motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Nobody: the driver has not promised since control was lost.
    #[default]
    Disabled,
    /// Nobody yet: the driver has promised once, and is to keep that.
    Test,
    /// The driver.
    Active,
    /// Nobody, until a person calls [`Wormhole::reset`].
    Failed,
}

/// The source of the promises that count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Driver {
    /// The robot's own program.
    #[default]
    Program,
    /// A person at a joystick or screen.
    Person,
}

/// What the driver is to be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Control {
    /// The driver has control from now on.
    On,
    /// The driver has lost control.
    Off,
}

/// What came of a call, besides the command in effect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use = "the driver is told, and a program is restarted, by the caller"]
pub struct Change {
    /// The driver is told this.
    pub control: Option<Control>,
    /// This run of the program is to be restarted, if it is still the one that runs.
    pub restart: Option<u32>,
}

/// A program that has lost control by its own missed deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Missed {
    /// The run that missed it.
    pub run: u32,
    /// When control was lost, ns.
    pub lost_ns: u64,
}

/// What is known of one driver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Seat {
    last: Option<Order>,
}

/// See the module's head.
///
/// ```
/// use rohrpost_supervision::{Command, Control, Driver, Order, Promise, Settings, Wormhole};
/// let forward = Command { speed_m_s: 0.5, turn_rate_rad_s: 0.0 };
/// let promise = |sequence| {
///     Promise { order: Order { incarnation: 1, sequence }, duration_ns: 200, command: forward }
/// };
/// let mut wormhole = Wormhole::new(Settings::default());
/// wormhole.set_sight(0, true);
/// assert!(wormhole.promise(100, 0, Driver::Program, promise(1)).1.is_ok());
/// assert_eq!(wormhole.in_effect(150), None); // tried first
/// let (change, _) = wormhole.promise(250, 0, Driver::Program, promise(2));
/// assert_eq!((change.control, wormhole.in_effect(250)), (Some(Control::On), Some(forward)));
/// assert_eq!(wormhole.due_ns(), Some(450));
/// assert_eq!(wormhole.in_effect(450), None); // no promise in time: it brakes
/// assert_eq!(wormhole.look(450).control, Some(Control::Off));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Wormhole {
    settings: Settings,
    mode: Mode,
    driver: Driver,
    program: Seat,
    person: Seat,
    sees: bool,
    /// Of the last promise taken, in `Test` and `Active`; so are the next two.
    deadline_ns: u64,
    incarnation: u32,
    command: Command,
    failures: u32,
    window: Window,
    /// In `Disabled`: until when the program is to promise again.
    wait_until_ns: Option<u64>,
    missed: Option<Missed>,
    /// Callers that have stopped the robot.
    pub halts: Halts,
}

impl Wormhole {
    /// Disabled, and blind until told otherwise.
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            mode: Mode::default(),
            driver: Driver::default(),
            program: Seat::default(),
            person: Seat::default(),
            sees: false,
            deadline_ns: 0,
            incarnation: 0,
            command: Command::STOP,
            failures: 0,
            window: Window::default(),
            wait_until_ns: None,
            missed: None,
            halts: Halts::default(),
        }
    }

    /// The driver's control.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// The source of the promises that count.
    pub fn driver(&self) -> Driver {
        self.driver
    }

    /// Deadlines missed since control was gained last.
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// The command that the motor may be given, within the envelope; none: the robot is to brake.
    ///
    /// A caller that looks late, or asks between two looks, gets no command after its deadline.
    pub fn in_effect(&self, now_ns: u64) -> Option<Command> {
        let is_in_time = self.mode == Mode::Active && now_ns < self.deadline_ns;
        (is_in_time && !self.halts.is_held()).then_some(self.command)
    }

    /// The program, if it lost control by a missed deadline while no halt was held, and nothing has come since: no
    /// promise, no blindness, no other driver, no failure too many.
    pub fn missed(&self) -> Option<Missed> {
        self.missed
    }

    /// When to [`Wormhole::look`] again at the latest; none while nothing is waited for.
    pub fn due_ns(&self) -> Option<u64> {
        match self.mode {
            Mode::Test | Mode::Active => Some(self.deadline_ns),
            Mode::Disabled | Mode::Failed => self.wait_until_ns,
        }
    }

    /// Takes a promise that came at `now_ns`. `age_ns`: at least so much of its duration is over, by what is known of
    /// its way.
    ///
    /// The refusal is the caller's answer; the change holds in both cases, since time has passed.
    pub fn promise(
        &mut self,
        now_ns: u64,
        age_ns: u64,
        driver: Driver,
        promise: Promise,
    ) -> (Change, Result<(), Refusal>) {
        let passed = self.look(now_ns);
        match self.admit(age_ns, driver, &promise) {
            Ok(()) => {
                // Not of the numbers before: a run that was late once has used some up, and is still to be tried.
                let is_other_run = promise.order.incarnation != self.incarnation;
                let lost = if is_other_run { self.disable() } else { None };
                let taken = self.take(now_ns, age_ns, &promise);
                (Change { control: taken.or(lost).or(passed.control), ..passed }, Ok(()))
            }
            Err(refusal) => (passed, Err(refusal)),
        }
    }

    /// Whether the promise may be taken; numbers are used up even if it is late or blind.
    fn admit(&mut self, age_ns: u64, driver: Driver, promise: &Promise) -> Result<(), Refusal> {
        if !promise.command.is_finite() {
            return Err(Refusal::NotFinite);
        }
        let seat = if driver == Driver::Program { &mut self.program } else { &mut self.person };
        seat.last.map_or(Ok(()), |last| promise.order.against(last))?;
        seat.last = Some(promise.order);
        if self.mode == Mode::Failed {
            return Err(Refusal::Failed);
        }
        if driver != self.driver {
            return Err(Refusal::OtherDriver);
        }
        if promise.duration_ns.min(self.settings.horizon_ns) <= age_ns {
            return Err(Refusal::Late);
        }
        if !self.sees {
            return Err(Refusal::Blind);
        }
        Ok(())
    }

    /// One step up, with a new deadline.
    fn take(&mut self, now_ns: u64, age_ns: u64, promise: &Promise) -> Option<Control> {
        self.missed = None;
        self.command = promise.command;
        self.incarnation = promise.order.incarnation;
        self.deadline_ns = now_ns.saturating_add(promise.duration_ns.min(self.settings.horizon_ns) - age_ns);
        match self.mode {
            Mode::Active | Mode::Failed => None,
            Mode::Disabled => {
                self.mode = Mode::Test;
                self.wait_until_ns = None;
                None
            }
            Mode::Test => {
                self.mode = Mode::Active;
                self.failures = 0;
                Some(Control::On)
            }
        }
    }

    /// Lets time pass: deadlines that are over, waits that are over.
    pub fn look(&mut self, now_ns: u64) -> Change {
        let mut change = Change::default();
        if matches!(self.mode, Mode::Test | Mode::Active) && now_ns >= self.deadline_ns {
            change.control = self.fail(now_ns);
        }
        let failed_often = self.failures > self.settings.failures_before_restart;
        if self.wait_until_ns.is_some_and(|until_ns| now_ns >= until_ns || failed_often) {
            self.wait_until_ns = None;
            change.restart = self.restart(now_ns);
        }
        change
    }

    /// A deadline is missed.
    fn fail(&mut self, now_ns: u64) -> Option<Control> {
        let lost = self.disable();
        if self.driver == Driver::Program {
            let missed = Missed { run: self.incarnation, lost_ns: now_ns };
            self.missed = (lost.is_some() && !self.halts.is_held()).then_some(missed);
            self.failures = self.failures.saturating_add(1);
            self.count(now_ns);
            self.wait_anew(now_ns);
        }
        lost
    }

    /// Once for each silence: if the program does not come back, that is launch's to see.
    fn restart(&mut self, now_ns: u64) -> Option<u32> {
        self.count(now_ns);
        if self.mode == Mode::Failed {
            return None;
        }
        self.failures = 0;
        self.program.last.map(|last| last.incarnation)
    }

    /// Counts a failure or a restart; too many of them need a person.
    fn count(&mut self, now_ns: u64) {
        self.window.push(now_ns);
        let most = (self.settings.failures_max as usize).min(REMEMBERED);
        if self.window.count(now_ns, self.settings.window_ns) >= most {
            self.set_failed();
        }
    }

    fn wait_anew(&mut self, now_ns: u64) {
        let until_ns = now_ns.saturating_add(self.settings.wait_ns);
        self.wait_until_ns = (self.mode != Mode::Failed).then_some(until_ns);
    }

    /// Takes control away, without blame.
    fn disable(&mut self) -> Option<Control> {
        let had_control = self.mode == Mode::Active;
        if self.mode != Mode::Failed {
            self.mode = Mode::Disabled;
        }
        had_control.then_some(Control::Off)
    }

    /// Whether the robot sees. Without sight the driver loses control, and is tried anew when there is sight again; the
    /// program is not blamed.
    pub fn set_sight(&mut self, now_ns: u64, sees: bool) -> Change {
        let passed = self.look(now_ns);
        let has_come = sees && !self.sees;
        self.sees = sees;
        let lost = if sees { None } else { self.stand_by() };
        if has_come {
            self.expect_program(now_ns);
        }
        Change { control: lost.or(passed.control), ..passed }
    }

    /// From now on the promises of this driver count. The one before loses control without blame; so does a person to
    /// another one, each of which begins with numbers of its own.
    pub fn set_driver(&mut self, now_ns: u64, driver: Driver) -> Change {
        let passed = self.look(now_ns);
        if driver == Driver::Program && self.driver == Driver::Program {
            return passed;
        }
        let lost = self.stand_by();
        self.driver = driver;
        self.person = Seat::default();
        self.expect_program(now_ns);
        Change { control: lost.or(passed.control), ..passed }
    }

    /// Another computer runs the program now, with numbers of its own. The one before loses control, without blame.
    pub fn forget_program(&mut self, now_ns: u64) -> Change {
        let passed = self.look(now_ns);
        let lost = if self.driver == Driver::Person { None } else { self.stand_by() };
        self.program = Seat::default();
        Change { control: lost.or(passed.control), ..passed }
    }

    /// A program that has promised before is to promise again now.
    fn expect_program(&mut self, now_ns: u64) {
        let is_its_turn = self.driver == Driver::Program && self.sees && self.mode == Mode::Disabled;
        if is_its_turn && self.program.last.is_some() {
            self.wait_anew(now_ns);
        }
    }

    /// Disabled, and nothing is waited for.
    fn stand_by(&mut self) -> Option<Control> {
        (self.wait_until_ns, self.missed) = (None, None);
        self.disable()
    }

    /// Nobody has control until a person has looked. Also called when the run before this one has ended so.
    pub fn set_failed(&mut self) {
        self.mode = Mode::Failed;
        (self.wait_until_ns, self.missed) = (None, None);
    }

    /// A person has looked: failures are forgotten, and the driver may try again.
    pub fn reset(&mut self, now_ns: u64) {
        if self.mode == Mode::Failed {
            self.mode = Mode::Disabled;
        }
        self.failures = 0;
        self.window = Window::default();
        self.expect_program(now_ns);
    }
}

#[cfg(test)]
#[path = "wormhole_tests.rs"]
mod tests;
