//! Which commands are safe: the robot can still stop inside what its scanner saw free.
//!
//! From the scan until the robot stands, its centre stays in a *sector*: with its tip where the robot stood at the scan,
//! as long as the way that it may make meanwhile, and as wide as it may turn meanwhile.
//!
//! ```text
//!              , - left edge: turned as far as it may have
//!   robot (o) <   reach: way at the speed that it had, until the motor obeys; at the new speed, until the next look has
//!              ` - right edge     come and been obeyed; then braking
//! ```
//!
//! A command is safe if no point of the scan is nearer to the sector than outline and margin. So each point allows some
//! reach, and the least of them allows some speed. Turning on the spot has no reach: a round robot always may.
//!
//! - A beam without reading, and a direction without a beam, is an obstacle that touches the robot. Beside the sector, 45°
//!   and more off it, that obstacle is at the margin around the robot: a robot that has turned so far since its scan would
//!   have seen it in its way before, or sees it with the next scan. At the start those leave that ring free who put the
//!   robot there.
//! - A point from which the robot drives away never keeps it from going.
//! - What moves may come nearer by `others_m_s`, from the scan until the robot stands.

use crate::motion::Bounds;
use crate::{Command, Motion, Scan};
use core::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI, TAU};
use libm::{ceil, copysign, fabs, sincos, sqrt};

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

    fn cut(&self, command: Command) -> Command {
        let Bounds { backward_m_s, forward_m_s, right_rad_s, left_rad_s } = self.bounds();
        Command {
            speed_m_s: command.speed_m_s.clamp(backward_m_s, forward_m_s),
            turn_rate_rad_s: command.turn_rate_rad_s.clamp(right_rad_s, left_rad_s),
        }
    }
}

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

/// Judges commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope {
    limits: Limits,
    mounting: Mounting,
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

/// A direction, as its unit vector.
#[derive(Clone, Copy)]
struct Direction {
    x: f64,
    y: f64,
}

impl Direction {
    fn of(angle_rad: f64) -> Self {
        let (y, x) = sincos(angle_rad);
        Self { x, y }
    }

    fn turned(self, by: Self) -> Self {
        Self { x: self.x * by.x - self.y * by.y, y: self.y * by.x + self.x * by.y }
    }
}

/// The directions in which the robot's centre may leave where it was, from `right` counter-clockwise to `left`.
struct Sector {
    right: Direction,
    left: Direction,
    /// Wider than half a turn: everything is inside.
    is_wide: bool,
}

impl Sector {
    /// Whether a point lies in the sector's directions, or near to them.
    fn is_in_the_way(&self, x_m: f64, y_m: f64) -> bool {
        let near_m = IN_THE_WAY_COS * sqrt(x_m * x_m + y_m * y_m);
        let is_near = |edge: &Direction| edge.x * x_m + edge.y * y_m > near_m;
        is_near(&self.right) || is_near(&self.left) || self.contains(x_m, y_m)
    }

    fn contains(&self, x_m: f64, y_m: f64) -> bool {
        let is_between = || {
            self.right.x * y_m - self.right.y * x_m >= 0.0
                && self.left.y * x_m - self.left.x * y_m >= 0.0
                // Of a sector without width, the first two hold behind it, too.
                && (self.right.x + self.left.x) * x_m + (self.right.y + self.left.y) * y_m > 0.0
        };
        self.is_wide || is_between()
    }

    /// The reach at which a disc of `radius_m` that moves in the sector touches a point; infinite if never.
    fn contact_m(&self, x_m: f64, y_m: f64, radius_m: f64) -> f64 {
        if self.contains(x_m, y_m) {
            return (sqrt(x_m * x_m + y_m * y_m) - radius_m).max(0.0);
        }
        let along_edge = |edge: &Direction| {
            let (along_m, across_m) = (edge.x * x_m + edge.y * y_m, edge.x * y_m - edge.y * x_m);
            if along_m <= 0.0 || fabs(across_m) >= radius_m {
                return f64::INFINITY;
            }
            (along_m - sqrt(radius_m * radius_m - across_m * across_m)).max(0.0)
        };
        along_edge(&self.right).min(along_edge(&self.left))
    }
}

/// Directions so near to the sector lie in the way.
const IN_THE_WAY_COS: f64 = FRAC_1_SQRT_2;

impl Envelope {
    /// Of a robot with its scanner.
    pub fn new(limits: Limits, mounting: Mounting) -> Self {
        Self { limits, mounting }
    }

    /// The robot and its times.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// What becomes of a command now, by the newest scan and what the motor was told before. The scan must be one that
    /// [`crate::Sight`] believes.
    ///
    /// A refused command means [`Command::STOP`], which needs no scan: the command before left room for it.
    pub fn judge(&self, now_ns: u64, command: Command, scan: &Scan<'_>, motion: &Motion) -> Verdict {
        if !command.is_finite() {
            return Verdict::Refused(Why::Limit);
        }
        let wanted = self.limits.cut(command);
        let mut speed_m_s = fabs(wanted.speed_m_s);
        let mut why = Why::Limit;
        for heading in [Heading::Forward, Heading::Backward] {
            // A robot that still rolls the other way, or rolls out, does so in the new turn.
            let asked_m_s = heading.of(wanted.speed_m_s);
            let way = Way::of(&self.limits, now_ns, wanted, heading, scan.taken_ns, motion);
            if asked_m_s == 0.0 && way.is_none() {
                continue;
            }
            let room = self.room(scan, &way.sector(heading), way.others_m);
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

    /// The least reach that any point of the scan, or any direction without one, allows.
    fn room(&self, scan: &Scan<'_>, sector: &Sector, others_m: f64) -> Room {
        let Limits { radius_m, margin_m, .. } = self.limits;
        let ring_m = radius_m + margin_m;
        let mut room = Room { reach_m: f64::INFINITY, why: Why::Seen };
        let turn = Direction::of(scan.step_rad);
        let mut beam = Direction::of(self.mounting.heading_rad + scan.start_rad);
        for range_m in scan.ranges_m {
            let range_m = f64::from(*range_m);
            if range_m > 0.0 {
                let (x_m, y_m) = (self.mounting.x_m + range_m * beam.x, self.mounting.y_m + range_m * beam.y);
                room.or(sector.contact_m(x_m, y_m, ring_m + others_m), Why::Seen);
            } else {
                room.or(self.unseen_m(beam, sector, others_m), Why::Unseen);
            }
            beam = beam.turned(turn);
        }
        self.between_last_and_first(scan, |direction| room.or(self.unseen_m(direction, sector, others_m), Why::Unseen));
        room
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

/// Which way the robot rolls.
#[derive(Clone, Copy, PartialEq)]
enum Heading {
    Forward,
    Backward,
}

impl Heading {
    /// Speed this way; 0 for one that goes the other way.
    fn of(self, speed_m_s: f64) -> f64 {
        if self == Self::Forward { speed_m_s.max(0.0) } else { (-speed_m_s).max(0.0) }
    }

    fn most(self, bounds: Bounds) -> f64 {
        if self == Self::Forward { bounds.forward_m_s } else { -bounds.backward_m_s }
    }
}

/// How the robot may move one way, from the scan until it stands.
struct Way {
    /// Way by the commands before, until the motor obeys this one.
    before_m: f64,
    /// How fast it may still be when it obeys this one.
    slowing_m_s: f64,
    /// How long this command is obeyed, until that of the next look is.
    held_s: f64,
    right_rad: f64,
    left_rad: f64,
    /// How near others may have come.
    others_m: f64,
}

impl Way {
    fn of(limits: &Limits, now_ns: u64, command: Command, heading: Heading, scan_ns: u64, motion: &Motion) -> Self {
        let Limits { lag_s, look_s, braking_m_s2, turn_braking_rad_s2, others_m_s, .. } = *limits;
        let age_s = now_ns.saturating_sub(scan_ns) as f64 * 1e-9;
        let obeyed_at_ns = now_ns.saturating_add((lag_s * 1e9) as u64);
        let (since, then) = (motion.from(scan_ns), motion.at(obeyed_at_ns));
        let all = since.with(Bounds::of(command));
        // The next look's own command is obeyed a lag later, as this one is.
        let held_s = look_s + lag_s;
        let turning_s = age_s + lag_s + held_s;
        let turned = |rate_rad_s: f64| rate_rad_s * (turning_s + fabs(rate_rad_s) / (2.0 * turn_braking_rad_s2));
        Self {
            before_m: heading.most(since) * (age_s + lag_s),
            slowing_m_s: heading.most(then),
            held_s,
            right_rad: turned(all.right_rad_s),
            left_rad: turned(all.left_rad_s),
            others_m: others_m_s * (turning_s + heading.most(all) / braking_m_s2),
        }
    }

    /// It does not roll this way at all, but for the command.
    fn is_none(&self) -> bool {
        self.before_m == 0.0 && self.slowing_m_s == 0.0
    }

    fn sector(&self, heading: Heading) -> Sector {
        let behind_rad = if heading == Heading::Backward { PI } else { 0.0 };
        Sector {
            right: Direction::of(behind_rad + self.right_rad.max(-FRAC_PI_2)),
            left: Direction::of(behind_rad + self.left_rad.min(FRAC_PI_2)),
            is_wide: self.left_rad - self.right_rad >= PI || self.left_rad > FRAC_PI_2 || self.right_rad < -FRAC_PI_2,
        }
    }

    /// The greatest speed this way with which the robot stands within a reach; none: it is to brake. From when the motor
    /// obeys, the command is held for L and the robot brakes at b then; m is how fast it may still be:
    ///
    /// ```text
    /// v >= m:  v * L + v² / 2b                        <= what is left of the reach
    /// v < m:   m² / 2b + v * max(0, L - (m - v) / b)  <= the same; it slows down to v meanwhile
    /// ```
    fn speed_within(&self, limits: &Limits, reach_m: f64) -> Option<f64> {
        let (braking, held_s, fast) = (limits.braking_m_s2, self.held_s, self.slowing_m_s);
        let left_m = reach_m - self.before_m;
        let spare_m = left_m - fast * fast / (2.0 * braking);
        if spare_m < 0.0 {
            return None;
        }
        if left_m == f64::INFINITY {
            return Some(f64::INFINITY);
        }
        let lag = braking * held_s;
        let steady = sqrt(lag * lag + 2.0 * braking * left_m) - lag;
        if steady >= fast {
            return Some(steady);
        }
        let late = lag - fast;
        let slower = 0.5 * (sqrt(late * late + 4.0 * braking * spare_m) - late);
        Some(slower.max(fast - lag).clamp(0.0, fast))
    }
}

#[cfg(test)]
#[path = "envelope_tests.rs"]
mod tests;
