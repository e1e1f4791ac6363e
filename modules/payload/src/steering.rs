//! From a place on the floor to the next one (seed 000, figure 4.11).

use rohrpost_modules::fusion::wrap_rad;
use rohrpost_modules::types::Pose;
use rohrpost_supervision::Command;

/// Off by more than this, the robot turns on the spot.
const OFF_MAX_RAD: f64 = 0.35;
/// Turns at this rate for each radian that it is off, 1/s.
const TURN_GAIN_PER_S: f64 = 2.0;
/// Drives at this speed for each metre to where it is to stand, 1/s.
const BRAKE_GAIN_PER_S: f64 = 1.2;
/// The robot stands where it should, metres.
pub(crate) const ARRIVED_M: f64 = 0.08;

/// Where to, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heading {
    /// The place, metres.
    pub(crate) to_m: (f64, f64),
    /// Speed on the way, metres a second.
    pub(crate) speed_m_s: f64,
    /// Greatest turn rate, radians a second.
    pub(crate) turn_rate_max_rad_s: f64,
    /// Whether the robot is to stand there.
    pub(crate) stands: bool,
}

impl Heading {
    /// What the motor is to do at a pose.
    pub(crate) fn command(self, pose: Pose) -> Command {
        let (ahead_m, aside_m) = (self.to_m.0 - pose.x_m, self.to_m.1 - pose.y_m);
        let apart_m = ahead_m.hypot(aside_m);
        if self.stands && apart_m <= ARRIVED_M {
            return Command::STOP;
        }
        let off_rad = wrap_rad(aside_m.atan2(ahead_m) - pose.heading_rad);
        let turn_max = self.turn_rate_max_rad_s;
        let turn_rate_rad_s = (TURN_GAIN_PER_S * off_rad).clamp(-turn_max, turn_max);
        let slow_m_s = if self.stands { BRAKE_GAIN_PER_S * apart_m } else { f64::INFINITY };
        let speed_m_s = if off_rad.abs() > OFF_MAX_RAD { 0.0 } else { self.speed_m_s.min(slow_m_s) };
        Command { speed_m_s, turn_rate_rad_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn a_robot_turns_first_then_drives_and_slows_down_where_it_is_to_stand() {
        let pose = |heading_rad| Pose { x_m: 1.0, y_m: 1.0, heading_rad };
        let to = |x_m, y_m, stands| Heading { to_m: (x_m, y_m), speed_m_s: 0.5, turn_rate_max_rad_s: 1.0, stands };
        for (heading, heading_rad, speed_m_s, turns, why) in [
            (to(2.0, 1.0, false), 0.0, 0.5, 0.0, "straight ahead"),
            (to(2.0, 1.0, false), FRAC_PI_2, 0.0, -1.0, "to the right first"),
            (to(1.0, 2.0, false), 0.0, 0.0, 1.0, "to the left first"),
            (to(0.0, 1.0, false), -PI + 0.1, 0.5, -0.2, "the short way round"),
            (to(1.2, 1.0, true), 0.0, 0.24, 0.0, "slowly, to stand there"),
            (to(1.05, 1.0, true), 2.0, 0.0, 0.0, "it is there"),
        ] {
            let command = heading.command(pose(heading_rad));
            let is_near = |one: f64, other: f64| (one - other).abs() < 1e-9;
            assert!(
                is_near(command.speed_m_s, speed_m_s) && is_near(command.turn_rate_rad_s, turns),
                "{why}: {command:?}"
            );
        }
    }
}
