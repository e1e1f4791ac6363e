//! A wormhole as a finite value: all that its future depends on, told from now. A private part of the core's
//! `wormhole.rs`.
//!
//! The core keeps times since an unknown origin and numbers that grow for ever, so its own states are endless. What is
//! left out here has no influence on what it does:
//!
//! - *The origin of time.* The core adds, subtracts and compares times, and nothing else. All of them may be moved by
//!   the same time, so each is kept as its distance from now. (Nothing saturates: no time is in the future by more than
//!   a horizon or a wait.)
//! - *The numbers.* An [`Order`] is only compared with the one before, by the difference modulo 2^32. What counts is
//!   whether there is one before, and whether the run in control is the one that it names.
//! - *The deadline, the run and the command* without control or a test: the promise that begins the next test writes
//!   all three. The command during a test: the promise that ends the test writes it.
//! - *Failures older than the window*: they count no more, and the ring writes over the oldest first. In the mode
//!   failed all of them: the reset forgets them.
//! - *The order of halts*: they are asked for as a set. (Two callers never need more room than there is.)
//!
//! [`Frame`] turns such a value back into a wormhole, and chooses all of that freely. The model takes each step in two
//! frames that have nothing in common, and a walk takes it in a wormhole that was never reduced; all must do the same.

use super::super::{Command, Driver, HaltId, Halts, Mode, Order};
use super::{Seat, Settings, Window, Wormhole};

/// Length of a tick, ns. All times of the model are whole ticks.
pub(crate) const TICK_NS: u64 = 100_000_000;
/// Longest window, ticks.
pub(crate) const WINDOW_MAX: usize = 12;
/// Callers that halt.
pub(crate) const CALLERS: usize = 2;

/// How often something happened, by its age in ticks.
pub(crate) type Ages = [u8; WINDOW_MAX];

/// Where a command comes from. Each source has a command of its own, so that what is in effect tells its source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Voice {
    /// The program.
    Program,
    /// The program, in a promise for one tick.
    Briefly,
    Person,
    /// A promise that has to be refused, for whatever reason but its value.
    Refused,
    /// A promise of an infinite speed.
    NotFinite,
}

impl Voice {
    const ALL: [(Self, f64); 5] = [
        (Self::Program, 1.0),
        (Self::Briefly, 1.5),
        (Self::Person, 2.0),
        (Self::Refused, 3.0),
        (Self::NotFinite, f64::INFINITY),
    ];

    pub(crate) fn command(self) -> Command {
        let (_, speed_m_s) = Self::ALL[self as usize];
        Command { speed_m_s, turn_rate_rad_s: 0.0 }
    }

    pub(crate) fn of(command: Command) -> Self {
        let found = Self::ALL.into_iter().find(|(_, speed_m_s)| *speed_m_s == command.speed_m_s);
        found.expect("only the model's commands are given").0
    }
}

/// The run that a promise is of, beside the one that promised last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Run {
    Older,
    Same,
    Newer,
}

/// See the module's head.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct CoreState {
    pub(crate) mode: Mode,
    pub(crate) driver: Driver,
    pub(crate) sees: bool,
    /// Whether the program, and the person that drives now, have promised, whatever came of it.
    pub(crate) known: [bool; 2],
    /// In a test and with control: ticks until the deadline.
    pub(crate) left: Option<i8>,
    /// Whether the last promise, taken or not, is of the run that is tried or has control.
    pub(crate) is_last_run: bool,
    /// With control.
    pub(crate) voice: Option<Voice>,
    pub(crate) failures: u8,
    pub(crate) recent: Ages,
    /// Ticks until the program is to have promised again.
    pub(crate) wait: Option<i8>,
    pub(crate) held: [bool; CALLERS],
}

/// What a [`CoreState`] leaves open.
pub(crate) struct Frame {
    pub(crate) now_ns: u64,
    /// Numbers of the last promises.
    pub(crate) last: Order,
    /// How far a newer number is ahead: at least one, less than half of all.
    pub(crate) ahead: u32,
    /// Times and commands that nobody reads.
    pub(crate) idle_ns: u64,
    pub(crate) idle: Command,
    /// Failures older than the window.
    pub(crate) forgotten: u64,
}

impl Frame {
    /// A wormhole of this state.
    pub(crate) fn wormhole(&self, state: &CoreState, settings: Settings) -> Wormhole {
        let at_ns = |ticks: i8| self.now_ns.wrapping_add_signed(i64::from(ticks) * TICK_NS as i64);
        let seat = |is_known: bool| Seat { last: is_known.then_some(self.last) };
        let older = self.last.incarnation.wrapping_sub(self.ahead);
        let mut window = Window::default();
        for age in (0..self.forgotten).rev() {
            window.push(self.now_ns - settings.window_ns - age * TICK_NS);
        }
        for (age, count) in state.recent.iter().enumerate().rev() {
            (0..*count).for_each(|_| window.push(self.now_ns - age as u64 * TICK_NS));
        }
        let mut halts = Halts::default();
        for by in (0..CALLERS).filter(|by| state.held[*by]) {
            halts.halt(halt_of(by)).expect("there is room");
        }
        Wormhole {
            settings,
            mode: state.mode,
            driver: state.driver,
            program: seat(state.known[0]),
            person: seat(state.known[1]),
            sees: state.sees,
            deadline_ns: state.left.map_or(self.idle_ns, at_ns),
            incarnation: if state.is_last_run { self.last.incarnation } else { older },
            command: state.voice.map_or(self.idle, Voice::command),
            failures: state.failures.into(),
            window,
            wait_until_ns: state.wait.map(at_ns),
            // Told to others; nothing here depends on it.
            missed: None,
            halts,
        }
    }
}

/// The halt that a caller of the model holds.
pub(crate) fn halt_of(by: usize) -> HaltId {
    HaltId { by: by as u32, number: 1 }
}

impl Wormhole {
    /// What its future depends on.
    pub(crate) fn reduced(&self, now_ns: u64) -> CoreState {
        let ticks = |at_ns: u64| (at_ns.wrapping_sub(now_ns) as i64 / TICK_NS as i64) as i8;
        let is_tried = matches!(self.mode, Mode::Test | Mode::Active);
        let last = self.seat(self.driver).last;
        let mut recent = Ages::default();
        if self.mode != Mode::Failed {
            let mut younger = 0;
            for (age, count) in (1..).zip(&mut recent).take((self.settings.window_ns / TICK_NS) as usize) {
                let so_many = self.window.count(now_ns, age * TICK_NS);
                *count = (so_many - younger) as u8;
                younger = so_many;
            }
        }
        CoreState {
            mode: self.mode,
            driver: self.driver,
            sees: self.sees,
            known: [self.program, self.person].map(|seat| seat.last.is_some()),
            left: is_tried.then(|| ticks(self.deadline_ns)),
            is_last_run: is_tried && last.is_some_and(|last| last.incarnation == self.incarnation),
            voice: (self.mode == Mode::Active).then(|| Voice::of(self.command)),
            failures: self.failures as u8,
            recent,
            wait: self.wait_until_ns.map(ticks),
            held: std::array::from_fn(|by| self.halts.held().any(|halt| halt == halt_of(by))),
        }
    }

    /// Numbers of a promise, beside those of the last one.
    pub(crate) fn order(&self, driver: Driver, run: Run, repeats: bool, ahead: u32) -> Order {
        let last = self.seat(driver).last.unwrap_or(Order { incarnation: 0, sequence: 0 });
        let incarnation = match run {
            Run::Older => last.incarnation.wrapping_sub(ahead),
            Run::Same => last.incarnation,
            Run::Newer => last.incarnation.wrapping_add(ahead),
        };
        Order { incarnation, sequence: if repeats { last.sequence } else { last.sequence.wrapping_add(ahead) } }
    }

    pub(crate) fn settings(&self) -> Settings {
        self.settings
    }

    /// The run of the program that promised last.
    pub(crate) fn last_run(&self) -> Option<u32> {
        self.program.last.map(|last| last.incarnation)
    }

    fn seat(&self, driver: Driver) -> Seat {
        if driver == Driver::Program { self.program } else { self.person }
    }
}
