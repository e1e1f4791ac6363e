use super::*;
use crate::{Control, HaltId, Mode, Promise, Settings};

extern crate std;

const S: u64 = 1_000_000_000;
const FRAME: u32 = 7;
const LIMITS: Limits = Limits {
    radius_m: 0.25,
    margin_m: 0.05,
    speed_max_m_s: 0.8,
    turn_rate_max_rad_s: 1.0,
    braking_m_s2: 1.0,
    turn_braking_rad_s2: 4.0,
    lag_s: 0.05,
    look_s: 0.1,
    others_m_s: 0.0,
};

/// A program that has named a destination 10 m ahead, and has control until 1 s.
struct Rig {
    wormhole: Wormhole,
    safety: Safety,
    sequence: u32,
}

impl Rig {
    fn new() -> Self {
        let mut rig =
            Self { wormhole: Wormhole::new(Settings::default()), safety: Safety::new(&LIMITS, 5 * S), sequence: 0 };
        let _ = rig.wormhole.set_sight(0, true);
        rig.promise(0);
        rig.name(1, Some(ahead(10.0))).expect("it is a place");
        rig.promise(0);
        assert_eq!((rig.wormhole.mode(), rig.command(0)), (Mode::Active, None), "the program drives");
        rig
    }

    /// One that has missed its deadline.
    fn missed() -> Self {
        let mut rig = Self::new();
        assert_eq!(rig.wormhole.look(S).control, Some(Control::Off));
        rig
    }

    fn order(&mut self, incarnation: u32) -> Order {
        self.sequence += 1;
        Order { incarnation, sequence: self.sequence }
    }

    fn promise(&mut self, now_ns: u64) {
        let promise = Promise { order: self.order(1), duration_ns: S, command: Command::STOP };
        self.wormhole.promise(now_ns, 0, Driver::Program, promise).1.expect("it is taken");
    }

    fn name(&mut self, incarnation: u32, place: Option<Place>) -> Result<(), Refusal> {
        let order = self.order(incarnation);
        self.safety.set_destination(order, place)
    }

    fn command(&mut self, now_ns: u64) -> Option<Command> {
        self.command_at(now_ns, located(0.0, 0.0))
    }

    fn command_at(&mut self, now_ns: u64, located: Located) -> Option<Command> {
        self.safety.command(now_ns, &self.wormhole, Some(located))
    }
}

fn ahead(x_m: f64) -> Place {
    Place { frame: FRAME, x_m, y_m: 0.0 }
}

fn located(x_m: f64, heading_rad: f64) -> Located {
    Located { place: ahead(x_m), heading_rad }
}

const GO: Command = Command { speed_m_s: 0.4, turn_rate_rad_s: 0.0 };

#[test]
fn after_a_missed_deadline_it_turns_goes_and_stands_when_it_has_arrived_or_its_time_is_over() {
    let mut rig = Rig::missed();
    for (heading_rad, speed_m_s, turn_rate_rad_s) in [
        (0.0, 0.4, 0.0),
        (0.1, 0.4, -0.1),
        (-0.3, 0.0, 0.3),
        (2.0, 0.0, -0.5),
        (-2.0, 0.0, 0.5),
        (TAU - 0.1, 0.4, 0.1),
        (-3.0 * TAU + 0.3, 0.0, -0.3),
    ] {
        let told = rig.command_at(S, located(0.0, heading_rad)).expect("it drives");
        let off = (told.speed_m_s - speed_m_s).abs() + (told.turn_rate_rad_s - turn_rate_rad_s).abs();
        assert!(off < 1e-9, "{heading_rad}: {told:?}");
    }
    assert_eq!((rig.command(6 * S - 1), rig.command(6 * S)), (Some(GO), None), "its time is over");
    assert_eq!(rig.command_at(2 * S, located(9.74, 0.0)), Some(GO));
    assert_eq!(rig.command_at(2 * S, located(9.76, 0.0)), None, "the robot covers the destination");
    assert_eq!(rig.command(2 * S), None, "pushed away, it stays there");
}

#[test]
fn without_odometry_it_waits_and_odometry_that_began_anew_ends_the_destination() {
    let mut rig = Rig::missed();
    assert_eq!(rig.safety.command(S, &rig.wormhole, None), Some(Command::STOP));
    assert_eq!(rig.command(S), Some(GO));
    let anew = Located { place: Place { frame: FRAME + 1, ..ahead(0.0) }, heading_rad: 0.0 };
    assert_eq!(rig.command_at(S, anew), None);
    assert_eq!(rig.command(S), None);
}

#[test]
fn a_promise_that_is_taken_ends_it_for_this_loss_and_control_is_regained_as_ever() {
    let mut rig = Rig::missed();
    assert_eq!(rig.command(S), Some(GO));
    rig.promise(S);
    assert_eq!((rig.wormhole.mode(), rig.command(S)), (Mode::Test, None));
    let _ = rig.wormhole.look(2 * S);
    assert_eq!((rig.wormhole.mode(), rig.command(2 * S)), (Mode::Disabled, None), "the test was missed");
    rig.promise(2 * S);
    rig.promise(2 * S);
    assert_eq!(rig.wormhole.mode(), Mode::Active);
    let _ = rig.wormhole.look(3 * S);
    assert_eq!(rig.command(3 * S), Some(GO), "another loss");
}

#[test]
fn the_restart_is_not_hindered_and_the_next_run_has_a_destination_of_its_own() {
    let mut rig = Rig::missed();
    assert_eq!(rig.command(S), Some(GO));
    assert_eq!(rig.wormhole.look(2 * S).restart, Some(1));
    assert_eq!(rig.command(2 * S), Some(GO), "until it promises");
    rig.name(2, None).expect("a newer run");
    assert_eq!(rig.name(1, Some(ahead(3.0))), Err(Refusal::OldIncarnation));
    assert_eq!(rig.command(2 * S), None);
    let nowhere = Some(ahead(f64::NAN));
    assert_eq!(rig.name(2, nowhere), Err(Refusal::NotFinite));
}

#[test]
fn neither_blindness_nor_a_halt_nor_a_person_nor_failing_too_often_begins_it_or_lets_it_go_on() {
    type Event = fn(&mut Wormhole);
    let events: [(Event, Event); 4] = [
        (|w| _ = w.set_sight(S / 2, false), |w| _ = w.set_sight(S, true)),
        (
            |w| w.halts.halt(HaltId { by: 1, number: 1 }).expect("there is room"),
            |w| w.halts.resume(HaltId { by: 1, number: 1 }),
        ),
        (|w| _ = w.set_driver(S / 2, Driver::Person), |w| _ = w.set_driver(S, Driver::Program)),
        (Wormhole::set_failed, |w| w.reset(S)),
    ];
    for (number, (comes, goes)) in events.into_iter().enumerate() {
        for mut rig in [Rig::new(), Rig::missed()] {
            comes(&mut rig.wormhole);
            let _ = rig.wormhole.look(S);
            assert_eq!(rig.command(S), None, "event {number}");
            goes(&mut rig.wormhole);
            assert_eq!(rig.command(S), None, "after event {number}");
        }
    }
}
