//! Drives in the place of a program that has missed its deadline: the seed's Safety task (seed 000, 3.1.1 and 5.1.2).
//!
//! No map is known here. The robot turns on the spot until it looks towards the program's last destination, then goes
//! straight there. Where something is in the way the envelope stops it, and it stands there until its time is over: as
//! in the seed, a dead end is the end.
//!
//! ```text
//! the program misses its deadline ──▶ turn ──▶ go ──▶ arrived, time over: halt
//!                                      ▲└───────┘│
//!                                      └─ looks elsewhere
//! ```
//!
//! Decided where the seed is silent:
//!
//! - It begins only after a missed deadline ([`Wormhole::missed`]): not after blindness, a halt, a change of the driver
//!   or [`crate::Mode::Failed`]. A promise that is taken ends it for this loss of control, also if the program then
//!   misses its test.
//! - A destination belongs to the run of the program that named it, and to the frame of the odometry at that moment. A
//!   halt, and a person that takes over, end it: people have moved the robot, or do not want it to move. So does
//!   arriving. The program names it anew.
//! - It drives at half of the robot's limits, and has arrived when the robot covers the destination.
//! - What else moves is the envelope's affair, as for every command.

use crate::limits::Limits;
use crate::{Command, Driver, Missed, Order, Refusal, Wormhole};
use core::f64::consts::{PI, TAU};
use libm::{atan2, fabs, floor, hypot};

/// Drives at this share of the limits.
const SHARE_OF_LIMITS: f64 = 0.5;
/// Off by more than this, the robot turns on the spot.
const OFF_MAX_RAD: f64 = 0.2;
/// Turns at this rate for each radian it is off: slow enough for a motor that obeys a second later, 1/s.
const TURN_GAIN_PER_S: f64 = 1.0;

/// A place in the plane, by the robot's odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Number of the frame: odometry that began anew has another one.
    pub frame: u32,
    /// Along x, metres.
    pub x_m: f64,
    /// Along y, metres.
    pub y_m: f64,
}

/// Where the robot is, by its odometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Located {
    /// The robot's centre.
    pub place: Place,
    /// Where the robot looks, counter-clockwise from x, radians.
    pub heading_rad: f64,
}

/// The destination of one run of the program.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Destination {
    run: u32,
    place: Place,
}

/// See the module's head.
#[derive(Clone, Debug, PartialEq)]
pub struct Safety {
    for_ns: u64,
    speed_m_s: f64,
    turn_rate_rad_s: f64,
    arrived_m: f64,
    last: Option<Order>,
    destination: Option<Destination>,
    /// A person has intervened after this one: it is over.
    ended: Option<Missed>,
}

impl Safety {
    /// Drives for so long at most after control was lost.
    pub fn new(limits: &Limits, for_ns: u64) -> Self {
        Self {
            for_ns,
            speed_m_s: SHARE_OF_LIMITS * limits.speed_max_m_s,
            turn_rate_rad_s: SHARE_OF_LIMITS * limits.turn_rate_max_rad_s,
            arrived_m: limits.radius_m,
            last: None,
            destination: None,
            ended: None,
        }
    }

    /// The program names its destination, or that it has none.
    ///
    /// # Errors
    /// A place that is no number, and a call that is older than the last one; the last destination stays.
    pub fn set_destination(&mut self, order: Order, place: Option<Place>) -> Result<(), Refusal> {
        if place.is_some_and(|place| !(place.x_m.is_finite() && place.y_m.is_finite())) {
            return Err(Refusal::NotFinite);
        }
        self.last.map_or(Ok(()), |last| order.against(last))?;
        self.last = Some(order);
        self.destination = place.map(|place| Destination { run: order.incarnation, place });
        Ok(())
    }

    /// What the motor may be given at this look, within the envelope; none: safety does not drive. To be asked at each
    /// look, since a halt ends the destination. Without `located`, the robot waits where it is.
    pub fn command(&mut self, now_ns: u64, wormhole: &Wormhole, located: Option<Located>) -> Option<Command> {
        if wormhole.halts.is_held() || wormhole.driver() == Driver::Person {
            (self.destination, self.ended) = (None, wormhole.missed());
        }
        let Destination { run, place } = self.destination?;
        if located.is_some_and(|located| located.place.frame != place.frame) {
            self.destination = None;
            return None;
        }
        let missed = wormhole.missed()?;
        if self.ended == Some(missed) || missed.run != run || now_ns.saturating_sub(missed.lost_ns) >= self.for_ns {
            return None;
        }
        let Some(Located { place: at, heading_rad, .. }) = located else { return Some(Command::STOP) };
        let (x_m, y_m) = (place.x_m - at.x_m, place.y_m - at.y_m);
        if hypot(x_m, y_m) <= self.arrived_m {
            self.destination = None;
            return None;
        }
        Some(self.towards(wrapped_rad(atan2(y_m, x_m) - heading_rad)))
    }

    /// Turns to a direction, and goes once the robot looks there.
    fn towards(&self, off_rad: f64) -> Command {
        let speed_m_s = if fabs(off_rad) > OFF_MAX_RAD { 0.0 } else { self.speed_m_s };
        let turn_rate_rad_s = (TURN_GAIN_PER_S * off_rad).clamp(-self.turn_rate_rad_s, self.turn_rate_rad_s);
        Command { speed_m_s, turn_rate_rad_s }
    }
}

/// An angle's direction, from -π to π.
fn wrapped_rad(angle_rad: f64) -> f64 {
    angle_rad - TAU * floor((angle_rad + PI) / TAU)
}

#[cfg(test)]
#[path = "safety_tests.rs"]
mod tests;
