//! An arena: a world, a robot in it, and a referee. The robot's body (motor, wheels, scanner) is elsewhere: it sends
//! [`Drive`]s, and is told each [`Moment`].
//!
//! ```text
//!  body ──Drive──▶ arena ──Moment──▶ body
//!                    └──Touch──▶ referee's list, Report
//! ```

use crate::simulator::{Moment, NoMotion, STEP_NS, Settings, Simulator, Touch};
use crate::world::World;
use rohrpost_modules::types::{Pose, Twist};
use serde::{Deserialize, Serialize};

/// A body's command to its wheels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drive {
    /// When it was given, ns of the monotonic clock that arena and body share: the arena obeys it from then on, however
    /// late it comes.
    pub at_ns: u64,
    /// The motion to reach.
    pub twist: Twist,
}

/// What the referee counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// All touches.
    pub touches: u64,
    /// Touches that count against the robot: it moved towards the point of contact.
    pub counted: u64,
    /// The way that the robot made, metres.
    pub way_m: f64,
    /// Longest time from a command to the last step in which the wheels did not brake, without another command between,
    /// ns: the motor's dead-man time.
    pub went_on_ns: u64,
}

/// A robot in its world, and the referee.
///
/// ```
/// use rohrpost_modules::types::Twist;
/// use rohrpost_robot::arena::{Arena, Drive};
/// use rohrpost_robot::{simulator::Settings, world::World};
/// let world = World::parse("rohrpost-map 1\ncell_m 1\nmap\n#####\n#>  #\n#####\n").unwrap();
/// let mut arena = Arena::new(world, Settings { dead_man_ns: 10_000_000_000, ..Settings::default() }, 0);
/// let ahead = Twist { speed_m_s: 0.7, turn_rate_rad_s: 0.0 };
/// let mut touches = Vec::new();
/// arena.drive(0, Drive { at_ns: 0, twist: ahead }, |touch| touches.push(touch)).unwrap();
/// arena.step_to(8_000_000_000, |touch| touches.push(touch));
/// assert!(touches.len() == 1 && touches[0].is_towards && arena.report().counted == 1);
/// ```
#[derive(Clone, Debug)]
pub struct Arena {
    robot: Simulator,
    report: Report,
    /// When the last command was given, ns.
    driven_ns: u64,
    /// Time up to which the robot was moved, ns.
    now_ns: u64,
}

impl Arena {
    /// The robot stands where the world says.
    pub fn new(world: World, settings: Settings, now_ns: u64) -> Self {
        let mut robot = Simulator::new(world, settings);
        robot.step_to(now_ns);
        Self { robot, report: Report::default(), driven_ns: now_ns, now_ns }
    }

    /// Moves the robot up to the time of a command, then has the wheels obey. A command of the future is one of now.
    ///
    /// # Errors
    /// [`NoMotion`]: the command is not taken.
    pub fn drive(&mut self, now_ns: u64, drive: Drive, told: impl FnMut(Touch)) -> Result<(), NoMotion> {
        let at_ns = drive.at_ns.min(now_ns);
        self.step_to(at_ns, told);
        self.robot.command(drive.twist, at_ns)?;
        self.driven_ns = at_ns;
        Ok(())
    }

    /// Moves the robot. Each touch is told.
    pub fn step_to(&mut self, now_ns: u64, mut told: impl FnMut(Touch)) {
        while self.now_ns + STEP_NS <= now_ns {
            self.now_ns += STEP_NS;
            let (before, bumps) = (self.robot.true_pose(), self.robot.bumps());
            let twist = self.robot.odometry().twist;
            self.robot.step_to(self.now_ns);
            self.report.way_m += distance_m(before, self.robot.true_pose());
            if goes_on(twist, self.robot.odometry().twist) {
                self.report.went_on_ns = self.report.went_on_ns.max(self.now_ns.saturating_sub(self.driven_ns));
            }
            if let Some(touch) = self.robot.last_touch().filter(|_| self.robot.bumps() > bumps) {
                self.report.touches += 1;
                self.report.counted += u64::from(touch.is_towards);
                told(touch);
            }
        }
    }

    /// The robot as it is now.
    pub fn moment(&self) -> Moment {
        self.robot.moment()
    }

    /// What was counted so far.
    pub fn report(&self) -> Report {
        self.report
    }
}

/// Whether the wheels roll, or turn the robot, as fast as a step before or faster.
fn goes_on(before: Twist, now: Twist) -> bool {
    let is_kept = |before: f64, now: f64| now != 0.0 && now.abs() >= before.abs();
    is_kept(before.speed_m_s, now.speed_m_s) || is_kept(before.turn_rate_rad_s, now.turn_rate_rad_s)
}

fn distance_m(from: Pose, to: Pose) -> f64 {
    (to.x_m - from.x_m).hypot(to.y_m - from.y_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: u64 = 1_000_000_000;

    /// A room of 6 m with the robot in its middle, which looks to the right.
    fn arena() -> Arena {
        let room = "rohrpost-map 1\ncell_m 1\nmap\n########\n#      #\n#      #\n#   >  #\n#      #\n########\n";
        Arena::new(World::parse(room).expect("it is a map"), Settings::default(), 0)
    }

    fn drive(at_ns: u64, speed_m_s: f64) -> Drive {
        Drive { at_ns, twist: Twist { speed_m_s, turn_rate_rad_s: 0.0 } }
    }

    #[test]
    fn a_body_that_says_nothing_is_braked_by_the_arena() {
        let mut arena = arena();
        arena.drive(0, drive(0, 0.7), |touch| panic!("{touch:?}")).expect("a motion");
        arena.step_to(60 * SECOND_NS, |touch| panic!("{touch:?}"));
        assert!(arena.report().way_m > 0.2 && arena.report().way_m < 0.3, "{:?}", arena.report());
        assert_eq!(arena.moment().odometry.twist, Twist::default());
        let went_on_ns = arena.report().went_on_ns;
        assert!(went_on_ns.abs_diff(Settings::default().dead_man_ns) <= STEP_NS, "the dead-man time: {went_on_ns} ns");
    }

    #[test]
    fn touches_are_counted_once_with_their_place_and_speed_forward_and_backward() {
        let mut arena = arena();
        let mut touches = Vec::new();
        for (from_s, speed_m_s) in [(0, 0.7), (20, -0.7)] {
            for tenth in 0..100 {
                let at_ns = from_s * SECOND_NS + tenth * SECOND_NS / 10;
                arena.drive(at_ns, drive(at_ns, speed_m_s), |touch| touches.push(touch)).expect("a motion");
            }
        }
        let [ahead, back] = touches[..] else { panic!("{touches:?}") };
        assert!(ahead.is_towards && (ahead.x_m, ahead.speed_m_s) == (7.0, 0.7), "{ahead:?}");
        assert!(back.is_towards && (back.x_m, back.speed_m_s) == (1.0, -0.7), "{back:?}");
        assert_eq!((arena.report().touches, arena.report().counted), (2, 2));
    }

    #[test]
    fn a_command_that_comes_late_is_obeyed_from_when_it_was_given() {
        let (mut late, mut in_time) = (arena(), arena());
        in_time.drive(0, drive(0, 0.7), |_| ()).expect("a motion");
        in_time.step_to(SECOND_NS / 2, |_| ());
        late.drive(SECOND_NS / 2, drive(0, 0.7), |_| ()).expect("a motion");
        late.step_to(SECOND_NS / 2, |_| ());
        assert_eq!(late.moment(), in_time.moment());
        let refused = late.drive(SECOND_NS, drive(SECOND_NS, f64::NAN), |_| ());
        assert!(refused.is_err(), "no motion: the dead-man time runs on");
    }
}
