//! The robot and its times, at their worst.

use crate::motion::Bounds;
use crate::{Command, Motion};

/// The robot, its brakes and its times. What is promised is as true as these are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The robot is a disc, metres.
    pub radius_m: f64,
    /// Kept free around it, metres; above all errors of scan and motion.
    pub margin_m: f64,
    /// Commands are cut to it, metres a second.
    pub speed_max_m_s: f64,
    /// Commands are cut to it, radians a second.
    pub turn_rate_max_rad_s: f64,
    /// The wheels brake at least so hard, metres a second squared.
    pub braking_m_s2: f64,
    /// Turning ends at least so hard, radians a second squared.
    pub turn_braking_rad_s2: f64,
    /// From a command being sent until the motor obeys, at worst, seconds.
    pub lag_s: f64,
    /// From one look at the command in effect to the next, at worst, late wake-ups included, seconds.
    pub look_s: f64,
    /// Speed of what else moves, metres a second; 0: only what stands is promised.
    pub others_m_s: f64,
}

impl Limits {
    /// What the motor may do at most.
    pub fn bounds(&self) -> Bounds {
        Bounds {
            backward_m_s: -self.speed_max_m_s,
            forward_m_s: self.speed_max_m_s,
            right_rad_s: -self.turn_rate_max_rad_s,
            left_rad_s: self.turn_rate_max_rad_s,
        }
    }

    /// A motor of this kind of which nothing is known yet.
    pub fn motion(&self) -> Motion {
        Motion::new(self.lag_s, self.braking_m_s2, self.turn_braking_rad_s2, self.bounds())
    }

    pub(crate) fn cut(&self, command: Command) -> Command {
        let Bounds { backward_m_s, forward_m_s, right_rad_s, left_rad_s } = self.bounds();
        Command {
            speed_m_s: command.speed_m_s.clamp(backward_m_s, forward_m_s),
            turn_rate_rad_s: command.turn_rate_rad_s.clamp(right_rad_s, left_rad_s),
        }
    }
}
