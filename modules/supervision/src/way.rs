//! How far a robot rolls until it stands.

use crate::limits::Limits;
use crate::motion::Bounds;
use crate::sector::{Direction, Sector};
use crate::{Command, Motion};
use core::f64::consts::{FRAC_PI_2, PI};
use libm::{fabs, sqrt};

/// Which way the robot rolls.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Heading {
    Forward,
    Backward,
}

impl Heading {
    /// Speed this way; 0 for one that goes the other way.
    pub(crate) fn of(self, speed_m_s: f64) -> f64 {
        if self == Self::Forward { speed_m_s.max(0.0) } else { (-speed_m_s).max(0.0) }
    }

    pub(crate) fn most(self, bounds: Bounds) -> f64 {
        if self == Self::Forward { bounds.forward_m_s } else { -bounds.backward_m_s }
    }
}

/// How the robot may move by the commands before.
pub(crate) struct Course {
    /// Age of the scan.
    age_s: f64,
    /// From the scan on.
    since: Bounds,
    /// When the motor obeys the command that is checked.
    then: Bounds,
}

impl Course {
    pub(crate) fn of(limits: &Limits, now_ns: u64, scan_ns: u64, motion: &Motion) -> Self {
        let age_s = now_ns.saturating_sub(scan_ns) as f64 * 1e-9;
        let obeyed_at_ns = now_ns.saturating_add((limits.lag_s * 1e9) as u64);
        Self { age_s, since: motion.from(scan_ns), then: motion.at(obeyed_at_ns) }
    }
}

/// How the robot may move one way, from the scan until it stands.
pub(crate) struct Way {
    /// Way by the commands before, until the motor obeys this one.
    before_m: f64,
    /// How fast it may still be when it obeys this one.
    slowing_m_s: f64,
    /// How long this command is obeyed, until that of the next look is.
    held_s: f64,
    right_rad: f64,
    left_rad: f64,
    /// How near others may have come.
    pub(crate) others_m: f64,
}

impl Way {
    pub(crate) fn of(limits: &Limits, course: &Course, command: Command, heading: Heading) -> Self {
        let Limits { lag_s, look_s, braking_m_s2, turn_braking_rad_s2, others_m_s, .. } = *limits;
        let Course { age_s, since, then } = *course;
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

    /// Whether the robot does not roll this way at all, but for the command.
    pub(crate) fn is_none(&self) -> bool {
        self.before_m == 0.0 && self.slowing_m_s == 0.0
    }

    pub(crate) fn sector(&self, heading: Heading) -> Sector {
        let behind_rad = if heading == Heading::Backward { PI } else { 0.0 };
        Sector {
            right: Direction::of(behind_rad + self.right_rad.max(-FRAC_PI_2)),
            left: Direction::of(behind_rad + self.left_rad.min(FRAC_PI_2)),
            is_wide: self.left_rad - self.right_rad >= PI || self.left_rad > FRAC_PI_2 || self.right_rad < -FRAC_PI_2,
        }
    }

    /// The least reach that allows a speed this way: what [`Way::speed_within`] answers, the other way round.
    pub(crate) fn reach_for(&self, limits: &Limits, speed_m_s: f64) -> f64 {
        let (braking, fast) = (limits.braking_m_s2, self.slowing_m_s);
        let slowing_s = (fast - speed_m_s).max(0.0) / braking;
        let most = fast.max(speed_m_s);
        self.before_m + most * most / (2.0 * braking) + speed_m_s * (self.held_s - slowing_s).max(0.0)
    }

    /// The greatest speed this way with which the robot stands within a reach; none: it is to brake. When the motor
    /// obeys, the command is held for L and the robot brakes at b then; m is how fast it may still be:
    ///
    /// ```text
    /// v >= m:  v * L + v² / 2b                        <= what is left of the reach
    /// v < m:   m² / 2b + v * max(0, L - (m - v) / b)  <= the same; it slows down to v meanwhile
    /// ```
    pub(crate) fn speed_within(&self, limits: &Limits, reach_m: f64) -> Option<f64> {
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
