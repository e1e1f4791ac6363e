use super::*;
use std::vec::Vec;

extern crate std;

const MS: u64 = 1_000_000;
const FORWARD: Command = Command { speed_m_s: 0.5, turn_rate_rad_s: 0.0 };

/// A wormhole that sees, and a program that promises for 200 ms each.
struct Rig {
    wormhole: Wormhole,
    now_ns: u64,
    incarnation: u32,
    sequence: u32,
    restarts: Vec<u32>,
    controls: Vec<Control>,
}

impl Rig {
    fn new(settings: Settings) -> Self {
        let mut wormhole = Wormhole::new(settings);
        assert_eq!(wormhole.set_sight(0, true), Change::default());
        let (restarts, controls) = (Vec::new(), Vec::new());
        Self { wormhole, now_ns: 0, incarnation: 1, sequence: 0, restarts, controls }
    }

    fn note(&mut self, change: Change) {
        self.restarts.extend(change.restart);
        self.controls.extend(change.control);
    }

    /// Time passes as for a module that wakes up whenever something is due.
    fn pass(&mut self, ms: u64) {
        let until_ns = self.now_ns + ms * MS;
        while let Some(due_ns) = self.wormhole.due_ns().filter(|due_ns| *due_ns <= until_ns) {
            self.now_ns = due_ns.max(self.now_ns);
            let change = self.wormhole.look(self.now_ns);
            self.note(change);
        }
        self.now_ns = until_ns;
    }

    fn in_effect(&self) -> Option<Command> {
        self.wormhole.in_effect(self.now_ns)
    }

    fn promise_with(&mut self, order: Order, duration_ms: u64, age_ms: u64, command: Command) -> Result<(), Refusal> {
        let promise = Promise { order, duration_ns: duration_ms * MS, command };
        let (change, taken) = self.wormhole.promise(self.now_ns, age_ms * MS, Driver::Program, promise);
        self.note(change);
        taken
    }

    fn next(&mut self) -> Order {
        self.sequence += 1;
        Order { incarnation: self.incarnation, sequence: self.sequence }
    }

    fn promise(&mut self) -> Result<(), Refusal> {
        let order = self.next();
        self.promise_with(order, 200, 0, FORWARD)
    }

    /// Control, gained by two promises.
    fn active(settings: Settings) -> Self {
        let mut rig = Self::new(settings);
        assert_eq!((rig.promise(), rig.wormhole.mode(), rig.in_effect()), (Ok(()), Mode::Test, None));
        rig.pass(100);
        assert_eq!((rig.promise(), rig.wormhole.mode()), (Ok(()), Mode::Active));
        assert_eq!(rig.in_effect(), Some(FORWARD), "the promise that ends the test is in effect");
        rig
    }
}

/// The seed's figure 3.3: p(t2) is missed, p(t3) is a test, p(t4) regains control.
#[test]
fn control_goes_at_the_missed_deadline_and_comes_back_with_the_second_promise() {
    let mut rig = Rig::active(Settings::default());
    rig.pass(199);
    assert_eq!(rig.in_effect(), Some(FORWARD));
    rig.pass(1);
    assert_eq!((rig.in_effect(), rig.wormhole.mode(), rig.wormhole.failures()), (None, Mode::Disabled, 1));
    assert_eq!((rig.promise(), rig.in_effect()), (Ok(()), None));
    rig.pass(150);
    assert_eq!((rig.promise(), rig.in_effect(), rig.wormhole.failures()), (Ok(()), Some(FORWARD), 0));
    assert_eq!(rig.controls, [Control::On, Control::Off, Control::On]);
    rig.pass(10_000);
    assert_eq!(rig.restarts[0], 1);
}

/// The seed's figure 3.4: a crash; after the wait a restart.
#[test]
fn a_program_that_does_not_promise_within_the_wait_is_restarted_and_its_next_run_gains_control() {
    let mut rig = Rig::active(Settings::default());
    rig.pass(200 + 999);
    assert!(rig.restarts.is_empty());
    rig.pass(1);
    assert_eq!(rig.restarts, [1]);
    rig.pass(100_000);
    assert_eq!(rig.restarts, [1], "one restart for one silence; whether it begins is launch's to see");
    rig.incarnation = 2;
    assert_eq!(rig.promise(), Ok(()));
    rig.pass(100);
    assert_eq!((rig.promise(), rig.wormhole.mode(), rig.restarts.len()), (Ok(()), Mode::Active, 1));
}

#[test]
fn a_program_that_misses_again_and_again_without_control_is_restarted() {
    let mut rig = Rig::new(Settings { wait_ns: 3000 * MS, ..Settings::default() });
    for _ in 0..4 {
        assert_eq!((rig.promise(), rig.restarts.len()), (Ok(()), 0));
        rig.pass(2000);
    }
    assert_eq!(rig.restarts, [1]);
}

#[test]
fn a_program_that_hung_while_the_robot_was_blind_or_a_person_drove_is_restarted_after_that() {
    let mut rig = Rig::active(Settings::default());
    let change = rig.wormhole.set_sight(rig.now_ns, false);
    rig.note(change);
    rig.pass(10_000);
    assert!(rig.restarts.is_empty(), "it cannot promise");
    let change = rig.wormhole.set_sight(rig.now_ns, true);
    rig.note(change);
    rig.pass(1_000);
    assert_eq!(rig.restarts, [1]);
    let mut rig = Rig::active(Settings::default());
    let _ = rig.wormhole.set_driver(rig.now_ns, Driver::Person);
    let _ = rig.wormhole.set_driver(rig.now_ns, Driver::Program);
    rig.pass(1_000);
    assert_eq!(rig.restarts, [1]);
}

/// [B1]: three promises, then a missed one, for ever.
#[test]
fn a_program_that_fails_again_and_again_is_kept_off_until_a_person_has_looked() {
    let mut rig = Rig::new(Settings::default());
    while rig.wormhole.mode() != Mode::Failed {
        assert!(rig.now_ns < 30_000 * MS, "it goes on for ever");
        (0..3).for_each(|_| assert_eq!(rig.promise(), Ok(())));
        rig.pass(500);
    }
    assert_eq!(rig.controls.iter().filter(|control| **control == Control::Off).count(), 10);
    assert_eq!((rig.promise(), rig.wormhole.due_ns()), (Err(Refusal::Failed), None), "nothing is waited for");
    rig.pass(100_000);
    assert_eq!(rig.promise(), Err(Refusal::Failed), "time alone heals nothing");
    rig.wormhole.reset(rig.now_ns);
    assert_eq!((rig.promise(), rig.promise(), rig.wormhole.mode()), (Ok(()), Ok(()), Mode::Active));
}

/// [B2]: a promise for an hour, then nothing.
#[test]
fn no_promise_reaches_beyond_the_horizon_and_age_and_delay_only_shorten_it() {
    for (duration_ms, age_ms, deadline_ms) in [(3_600_000, 0, 1000), (3_600_000, 400, 600), (200, 50, 150)] {
        let mut rig = Rig::new(Settings::default());
        let order = rig.next();
        assert_eq!(rig.promise_with(order, duration_ms, age_ms, FORWARD), Ok(()));
        assert_eq!(rig.wormhole.due_ns(), Some(deadline_ms * MS), "{duration_ms} ms, {age_ms} ms old");
    }
}

#[test]
fn a_promise_that_is_old_late_blind_or_no_number_changes_nothing() {
    let mut rig = Rig::active(Settings::default());
    let due_ns = rig.wormhole.due_ns();
    let not_a_number = Command { speed_m_s: f64::NAN, ..FORWARD };
    let order = |incarnation, sequence| Order { incarnation, sequence };
    for (order, age_ms, command, refusal) in [
        (order(1, 2), 0, FORWARD, Refusal::OldSequence),
        (order(1, 1), 0, FORWARD, Refusal::OldSequence),
        (order(0, 9), 0, FORWARD, Refusal::OldIncarnation),
        (order(1, 3), 0, not_a_number, Refusal::NotFinite),
        (order(1, 3), 200, FORWARD, Refusal::Late),
        (order(1, 3), 0, FORWARD, Refusal::OldSequence),
    ] {
        assert_eq!(rig.promise_with(order, 200, age_ms, command), Err(refusal));
    }
    assert_eq!((rig.wormhole.due_ns(), rig.in_effect()), (due_ns, Some(FORWARD)));
    let change = rig.wormhole.set_sight(rig.now_ns, false);
    assert_eq!((change.control, rig.in_effect()), (Some(Control::Off), None));
    rig.sequence = 3;
    assert_eq!(rig.promise(), Err(Refusal::Blind));
    assert_eq!((rig.wormhole.failures(), rig.wormhole.due_ns()), (0, None), "the program is not blamed");
}

#[test]
fn of_two_runs_of_a_program_only_the_newer_has_control() {
    let mut rig = Rig::active(Settings::default());
    rig.incarnation = 2;
    assert_eq!((rig.promise(), rig.wormhole.mode()), (Ok(()), Mode::Test), "it is tried as any other");
    assert_eq!(rig.controls, [Control::On, Control::Off]);
    let old = Order { incarnation: 1, sequence: 99 };
    assert_eq!(rig.promise_with(old, 200, 0, FORWARD), Err(Refusal::OldIncarnation));
    assert_eq!((rig.promise(), rig.wormhole.mode(), rig.wormhole.failures()), (Ok(()), Mode::Active, 0));
}

/// The numbers of the late promise are used up; the run that made it has shown nothing yet.
#[test]
fn a_newer_run_that_was_late_at_first_does_not_inherit_control() {
    let mut rig = Rig::active(Settings::default());
    rig.incarnation = 2;
    let order = rig.next();
    assert_eq!(rig.promise_with(order, 200, 200, FORWARD), Err(Refusal::Late));
    assert_eq!(rig.in_effect(), Some(FORWARD), "the run before keeps what it has promised");
    assert_eq!((rig.promise(), rig.wormhole.mode(), rig.in_effect()), (Ok(()), Mode::Test, None));
    assert_eq!(rig.controls, [Control::On, Control::Off]);
}

#[test]
fn a_caller_that_looks_late_gets_no_command_after_its_deadline() {
    let mut rig = Rig::active(Settings::default());
    rig.wormhole.halts.halt(crate::HaltId { by: 7, number: 1 }).expect("there is room");
    rig.now_ns += 200 * MS;
    rig.wormhole.halts.resume(crate::HaltId { by: 7, number: 1 });
    assert_eq!((rig.wormhole.mode(), rig.in_effect()), (Mode::Active, None));
    rig.pass(0);
    assert_eq!(rig.controls, [Control::On, Control::Off]);
}

#[test]
fn numbers_may_wrap() {
    let mut rig = Rig::new(Settings::default());
    for sequence in [u32::MAX - 1, u32::MAX, 0, 1] {
        assert_eq!(rig.promise_with(Order { incarnation: u32::MAX, sequence }, 200, 0, FORWARD), Ok(()));
    }
    assert_eq!(rig.promise_with(Order { incarnation: 0, sequence: 7 }, 200, 0, FORWARD), Ok(()));
    let before = Order { incarnation: u32::MAX, sequence: 2 };
    assert_eq!(rig.promise_with(before, 200, 0, FORWARD), Err(Refusal::OldIncarnation));
}

#[test]
fn while_a_person_drives_the_program_does_not_and_neither_is_blamed_for_the_change() {
    let mut rig = Rig::active(Settings::default());
    let change = rig.wormhole.set_driver(rig.now_ns, Driver::Person);
    assert_eq!((change.control, rig.in_effect()), (Some(Control::Off), None));
    assert_eq!(rig.promise(), Err(Refusal::OtherDriver));
    for sequence in [1, 2] {
        let promise = Promise { order: Order { incarnation: 7, sequence }, duration_ns: 200 * MS, command: FORWARD };
        assert_eq!(rig.wormhole.promise(rig.now_ns, 0, Driver::Person, promise).1, Ok(()));
    }
    assert_eq!(rig.in_effect(), Some(FORWARD));
    let change = rig.wormhole.set_driver(rig.now_ns, Driver::Person);
    assert_eq!((change.control, rig.in_effect()), (Some(Control::Off), None), "another person");
    let promise = Promise { order: Order { incarnation: 3, sequence: 1 }, duration_ns: 200 * MS, command: FORWARD };
    assert_eq!(rig.wormhole.promise(rig.now_ns, 0, Driver::Person, promise).1, Ok(()), "with numbers of its own");
    rig.pass(5_000);
    assert_eq!(rig.in_effect(), None, "a person that lets go stops the robot");
    assert!(rig.restarts.is_empty() && rig.wormhole.failures() == 0);
    assert_eq!(rig.wormhole.set_driver(rig.now_ns, Driver::Program).control, None);
    assert_eq!((rig.promise(), rig.promise(), rig.wormhole.mode()), (Ok(()), Ok(()), Mode::Active));
}

#[test]
fn a_halt_stops_the_robot_in_every_mode_and_the_deadline_goes_on() {
    let mut rig = Rig::active(Settings::default());
    rig.wormhole.halts.halt(crate::HaltId { by: 7, number: 1 }).expect("there is room");
    assert_eq!((rig.in_effect(), rig.wormhole.mode()), (None, Mode::Active));
    rig.pass(100);
    assert_eq!((rig.promise(), rig.in_effect()), (Ok(()), None));
    rig.wormhole.halts.resume(crate::HaltId { by: 7, number: 1 });
    assert_eq!(rig.in_effect(), Some(FORWARD));
    rig.pass(200);
    assert_eq!(rig.in_effect(), None);
}

/// Runs of another computer are numbered by that computer.
#[test]
fn a_program_that_moves_to_another_computer_is_tried_with_numbers_of_its_own() {
    let mut rig = Rig::active(Settings::default());
    rig.incarnation = 0;
    let earlier = rig.next();
    assert_eq!(rig.promise_with(earlier, 200, 0, FORWARD), Err(Refusal::OldIncarnation));
    assert_eq!(rig.wormhole.forget_program(rig.now_ns).control, Some(Control::Off));
    assert_eq!((rig.wormhole.mode(), rig.in_effect(), rig.wormhole.failures()), (Mode::Disabled, None, 0));
    assert_eq!((rig.promise(), rig.in_effect()), (Ok(()), None), "it is tried first");
    assert_eq!((rig.promise(), rig.in_effect()), (Ok(()), Some(FORWARD)));
    // A person goes on driving meanwhile.
    let _ = rig.wormhole.set_driver(rig.now_ns, Driver::Person);
    assert_eq!(rig.wormhole.forget_program(rig.now_ns).control, None);
    assert_eq!(rig.wormhole.driver(), Driver::Person);
}
