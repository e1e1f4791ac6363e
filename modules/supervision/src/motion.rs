//! Bounds of how the robot has moved since a scan was taken, by what its motor was told.

use crate::Command;

/// Commands remembered. At 100 a second they reach back further than any scan that is believed.
const COMMANDS: usize = 64;

/// Least and most of speed and turn rate over some time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// At most 0, metres a second.
    pub backward_m_s: f64,
    /// At least 0, metres a second.
    pub forward_m_s: f64,
    /// At most 0, radians a second.
    pub right_rad_s: f64,
    /// At least 0, radians a second.
    pub left_rad_s: f64,
}

impl Bounds {
    /// Bounds of all that either holds.
    pub(crate) fn with(self, other: Self) -> Self {
        Self {
            backward_m_s: self.backward_m_s.min(other.backward_m_s),
            forward_m_s: self.forward_m_s.max(other.forward_m_s),
            right_rad_s: self.right_rad_s.min(other.right_rad_s),
            left_rad_s: self.left_rad_s.max(other.left_rad_s),
        }
    }

    pub(crate) fn of(command: Command) -> Self {
        let Command { speed_m_s, turn_rate_rad_s } = command;
        Self {
            backward_m_s: speed_m_s.min(0.0),
            forward_m_s: speed_m_s.max(0.0),
            right_rad_s: turn_rate_rad_s.min(0.0),
            left_rad_s: turn_rate_rad_s.max(0.0),
        }
    }

    /// After braking for so long.
    fn braked(self, for_s: f64, braking_m_s2: f64, turn_braking_rad_s2: f64) -> Self {
        let (slower, straighter) = (for_s * braking_m_s2, for_s * turn_braking_rad_s2);
        Self {
            backward_m_s: (self.backward_m_s + slower).min(0.0),
            forward_m_s: (self.forward_m_s - slower).max(0.0),
            right_rad_s: (self.right_rad_s + straighter).min(0.0),
            left_rad_s: (self.left_rad_s - straighter).max(0.0),
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Told {
    at_ns: u64,
    /// How the robot moved then at most, this command included.
    bounds: Bounds,
    command: Bounds,
}

/// What the motor was told. A motor obeys after its lag at the latest, and brakes at least as hard as promised; until
/// then the robot may move as it was told before.
#[derive(Clone, Debug)]
pub struct Motion {
    lag_s: f64,
    braking_m_s2: f64,
    turn_braking_rad_s2: f64,
    /// As a ring; `next` is the oldest.
    told: [Option<Told>; COMMANDS],
    next: usize,
    /// What anything forgotten may have been.
    most: Bounds,
}

impl Motion {
    /// Nothing is known of before: the robot may have moved as fast as it can.
    pub fn new(lag_s: f64, braking_m_s2: f64, turn_braking_rad_s2: f64, most: Bounds) -> Self {
        Self { lag_s, braking_m_s2, turn_braking_rad_s2, told: [None; COMMANDS], next: 0, most }
    }

    /// The motor is told this now.
    pub fn tell(&mut self, now_ns: u64, command: Command) {
        let command = Bounds::of(command);
        let bounds = self.at(now_ns).with(command);
        self.told[self.next] = Some(Told { at_ns: now_ns, bounds, command });
        self.next = (self.next + 1) % COMMANDS;
    }

    /// Bounds of the motion at a time, by what was told until then.
    pub fn at(&self, at_ns: u64) -> Bounds {
        match self.newest_first().find(|told| told.at_ns <= at_ns) {
            Some(told) => self.since(told, at_ns),
            None => self.most,
        }
    }

    /// Bounds of all motion from then on, until another command is obeyed.
    pub fn from(&self, from_ns: u64) -> Bounds {
        let later = self.newest_first().take_while(|told| told.at_ns > from_ns);
        later.fold(self.at(from_ns), |bounds, told| bounds.with(told.bounds))
    }

    fn since(&self, told: &Told, at_ns: u64) -> Bounds {
        let obeyed_for_s = at_ns.saturating_sub(told.at_ns) as f64 * 1e-9 - self.lag_s;
        told.bounds.braked(obeyed_for_s.max(0.0), self.braking_m_s2, self.turn_braking_rad_s2).with(told.command)
    }

    fn newest_first(&self) -> impl Iterator<Item = &Told> {
        (1..=COMMANDS).filter_map(move |back| self.told[(self.next + COMMANDS - back) % COMMANDS].as_ref())
    }
}
