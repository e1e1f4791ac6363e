//! Which commands are safe: the robot can still stop inside what its scanner saw free.
//!
//! From the scan until the robot stands, its centre stays in a *sector*. The tip is where the robot stood at the scan.
//! The sector is as long as the way that the robot may make meanwhile, and as wide as it may turn meanwhile.
//!
//! ```text
//!              , - left edge: turned as far as it may have
//!   robot (o) <   reach: the way at the old speed until the motor obeys, then at the new speed until the next look is
//!              ` - right edge     obeyed, then of braking
//! ```
//!
//! A command is safe if no point of the scan is nearer to the sector than outline and margin. So each point allows some
//! reach, and the least of them allows some speed. Turning on the spot has no reach: a round robot always may.
//!
//! - A beam without reading, and a direction without a beam, is an obstacle that touches the robot. Beside the sector,
//!   45° and more off it, that obstacle is at the margin around the robot: a robot that has turned so far since its
//!   scan would have seen it in its way before, or sees it with the next scan. At the start, people leave that ring
//!   free.
//! - A point from which the robot drives away never keeps it from going.
//! - What moves may come nearer by `others_m_s`, from the scan until the robot stands. A wall that a map knows stands
//!   still, and so does all that it holds back ([`crate::Walls`]).

use crate::limits::Limits;
use crate::sector::{Direction, Sector};
use crate::way::{Course, Heading, Way};
use crate::{Command, Motion, Scan};
use core::f64::consts::{PI, TAU};
use libm::{ceil, copysign, fabs, sqrt};

/// Where the scanner is, in the robot's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mounting {
    /// Forward of the centre, metres.
    pub x_m: f64,
    /// To the left of the centre, metres.
    pub y_m: f64,
    /// Where beams of direction 0 point to, radians.
    pub heading_rad: f64,
}

/// Why a command does not pass as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum Why {
    /// Beyond what the motor is configured for.
    #[error("beyond the robot's greatest speed or turn rate")]
    Limit,
    /// Something was seen there.
    #[error("something is in the way")]
    Seen,
    /// Nothing is known of what is there.
    #[error("it leads where the scanner does not see")]
    Unseen,
}

impl Why {
    /// All of them, to count each by its place here.
    pub const ALL: [Self; 3] = [Self::Limit, Self::Seen, Self::Unseen];
}

/// What becomes of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Passes as it is.
    Passed(Command),
    /// Passes at a lower speed.
    Capped(Capped),
    /// Does not pass at any speed: the robot brakes.
    Refused(Why),
}

/// A command that passes at a lower speed than asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capped {
    /// What passes.
    pub to: Command,
    /// What was in the way of more.
    pub why: Why,
}

impl Verdict {
    /// What the motor is told.
    pub fn command(self) -> Command {
        match self {
            Self::Passed(command) => command,
            Self::Capped(capped) => capped.to,
            Self::Refused(_) => Command::STOP,
        }
    }
}

/// Slower than this is no driving: such a command is refused, not capped.
const CREEP_M_S: f64 = 0.005;
/// Directions without a beam are looked at so close together.
const UNSEEN_STEP_RAD: f64 = PI / 90.0;
/// Beams that are looked at together: where all of them see far, none is turned into a point.
const GROUP: usize = 8;
/// More than rounding takes from a reach, in metres and as a part of it.
const ENOUGH: f64 = 1e-9;

/// Checks commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    limits: Limits,
    mounting: Mounting,
    /// From the robot's centre to its scanner, metres.
    mounted_m: f64,
}

/// The way that a scan leaves in one direction of driving.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Room {
    reach_m: f64,
    why: Why,
}

impl Room {
    fn or(&mut self, reach_m: f64, why: Why) {
        if reach_m < self.reach_m {
            *self = Self { reach_m, why };
        }
    }
}

impl Envelope {
    /// Of a robot with its scanner.
    pub fn new(limits: Limits, mounting: Mounting) -> Self {
        let Mounting { x_m, y_m, .. } = mounting;
        Self { limits, mounting, mounted_m: sqrt(x_m * x_m + y_m * y_m) }
    }

    /// The robot and its times.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// What becomes of a command now, by the newest scan and what the motor was told before. The scan must be one that
    /// [`crate::Sight`] believes.
    ///
    /// A refused command means [`Command::STOP`], which needs no scan: the command before left room for it.
    pub fn check(&self, now_ns: u64, command: Command, scan: &Scan<'_>, motion: &Motion) -> Verdict {
        if !command.is_finite() {
            return Verdict::Refused(Why::Limit);
        }
        let wanted = self.limits.cut(command);
        let mut speed_m_s = fabs(wanted.speed_m_s);
        let mut why = Why::Limit;
        let course = Course::of(&self.limits, now_ns, scan.taken_ns, motion);
        for heading in [Heading::Forward, Heading::Backward] {
            // A robot that still rolls the other way, or rolls out, does so in the new turn.
            let asked_m_s = heading.of(wanted.speed_m_s);
            let way = Way::of(&self.limits, &course, wanted, heading);
            if asked_m_s == 0.0 && way.is_none() {
                continue;
            }
            let enough_m = way.reach_for(&self.limits, asked_m_s) * (1.0 + ENOUGH) + ENOUGH;
            let room = self.room(scan, &way.sector(heading), way.others_m, enough_m);
            match way.speed_within(&self.limits, room.reach_m) {
                None => return Verdict::Refused(room.why),
                Some(safe_m_s) if safe_m_s < asked_m_s => (speed_m_s, why) = (safe_m_s, room.why),
                Some(_) => {}
            }
        }
        if wanted.speed_m_s != 0.0 && speed_m_s < CREEP_M_S {
            return Verdict::Refused(why);
        }
        let to = Command { speed_m_s: copysign(speed_m_s, wanted.speed_m_s), ..wanted };
        if to == command { Verdict::Passed(to) } else { Verdict::Capped(Capped { to, why }) }
    }

    /// The least reach that any point of the scan, or any direction without one, allows; `enough_m` if they allow more.
    fn room(&self, scan: &Scan<'_>, sector: &Sector, others_m: f64, enough_m: f64) -> Room {
        let ring_m = self.limits.radius_m + self.limits.margin_m;
        let mut room = Room { reach_m: enough_m, why: Why::Seen };
        let turn = Direction::of(scan.step_rad);
        let mut turns = [Direction::of(0.0); GROUP];
        (1..GROUP).for_each(|beam| turns[beam] = turns[beam - 1].turned(turn));
        let mut first = Direction::of(self.mounting.heading_rad + scan.start_rad);
        for (group, ranges_m) in scan.ranges_m.chunks(GROUP).enumerate() {
            // As seen from the scanner: what is further away touches the disc at no smaller reach, in no direction.
            let touched_m = room.reach_m + ring_m + others_m + self.mounted_m;
            let is_far = |range_m: &f32| f64::from(*range_m) >= touched_m;
            if scan.range_max_m < touched_m || !ranges_m.iter().all(is_far) {
                for (turned, number) in turns.iter().zip(group * GROUP..).take(ranges_m.len()) {
                    self.look_along(&mut room, scan, number, first.turned(*turned), (sector, others_m));
                }
            }
            first = first.turned(turns[GROUP - 1]).turned(turn);
        }
        self.between_last_and_first(scan, |direction| room.or(self.unseen_m(direction, sector, others_m), Why::Unseen));
        room
    }

    /// Takes what one beam allows.
    fn look_along(
        &self,
        room: &mut Room,
        scan: &Scan<'_>,
        number: usize,
        beam: Direction,
        (sector, others_m): (&Sector, f64),
    ) {
        let range_m = scan.ranges_m[number];
        if !Scan::is_reading(range_m) {
            return room.or(self.unseen_m(beam, sector, others_m), Why::Unseen);
        }
        let mut at = |range_m: f64, radius_m: f64| {
            let (x_m, y_m) = (self.mounting.x_m + range_m * beam.x, self.mounting.y_m + range_m * beam.y);
            let touched_m = room.reach_m + radius_m;
            if x_m * x_m + y_m * y_m < touched_m * touched_m {
                room.or(sector.contact_m(x_m, y_m, radius_m), Why::Seen);
            }
        };
        let ring_m = self.limits.radius_m + self.limits.margin_m;
        // Nothing came back: what is further than that is not known.
        let range_m = f64::from(range_m).min(scan.range_max_m);
        let moving_m = scan.moving_m.get(number).map_or(range_m, |moving_m| range_m.max((*moving_m).into()));
        at(moving_m, ring_m + others_m);
        // What stands still, nearer than what moves.
        if moving_m > range_m {
            at(range_m, ring_m);
        }
    }

    /// Each direction outside of the scanner's fan.
    fn between_last_and_first(&self, scan: &Scan<'_>, mut look: impl FnMut(Direction)) {
        let beams = scan.ranges_m.len() as f64;
        let step_rad = fabs(scan.step_rad);
        let gap_rad = TAU - (beams - 1.0) * step_rad;
        if gap_rad <= step_rad.max(UNSEEN_STEP_RAD) {
            return;
        }
        // From the last beam on, in the direction in which the scanner turns.
        let count = ceil(gap_rad / UNSEEN_STEP_RAD);
        let by_rad = if scan.step_rad < 0.0 { -gap_rad / count } else { gap_rad / count };
        let last_rad = scan.start_rad + (beams - 1.0) * scan.step_rad;
        let (turn, mut direction) = (Direction::of(by_rad), Direction::of(self.mounting.heading_rad + last_rad));
        for _ in 1..count as u32 {
            direction = direction.turned(turn);
            look(direction);
        }
    }

    /// The reach that a direction without reading allows.
    fn unseen_m(&self, beam: Direction, sector: &Sector, others_m: f64) -> f64 {
        let Limits { radius_m, margin_m, .. } = self.limits;
        let Mounting { x_m, y_m, .. } = self.mounting;
        let ring_m = radius_m + margin_m;
        // Where the beam leaves the ring: |mounting + t * beam| = ring.
        let along_m = x_m * beam.x + y_m * beam.y;
        let inside_m2 = ring_m * ring_m - (x_m * x_m + y_m * y_m) + along_m * along_m;
        let leaves_m = (sqrt(inside_m2.max(0.0)) - along_m).max(0.0);
        let (x_m, y_m) = (x_m + leaves_m * beam.x, y_m + leaves_m * beam.y);
        if sector.is_in_the_way(x_m, y_m) { 0.0 } else { sector.contact_m(x_m, y_m, radius_m + others_m) }
    }
}

#[cfg(test)]
#[path = "envelope_tests.rs"]
mod tests;
