//! Bounds of how the robot has moved since a scan was taken, by what its motor was told.

use crate::Command;

/// Changes of the command remembered. At 100 a second they reach back further than any scan that is believed; of more,
/// the robot may have moved as fast as it can.
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

/// A command, and when the one after it was sent.
#[derive(Clone, Copy, Debug)]
struct Told {
    at_ns: u64,
    /// In effect until a lag after this; none: it is the last one.
    replaced_ns: Option<u64>,
    bounds: Bounds,
}

/// What the motor was told. A motor obeys after its lag at the latest, and brakes at least as hard as promised. So each
/// command bounds the motion until a lag after the next one was sent, and from then on less and less.
#[derive(Clone, Debug)]
pub struct Motion {
    lag_s: f64,
    braking_m_s2: f64,
    turn_braking_rad_s2: f64,
    /// As a ring; `next` is the oldest. At first what nobody knows: anything, until the first command.
    told: [Option<Told>; COMMANDS],
    next: usize,
    /// Bounds of all that is forgotten, from when it was obeyed no more; before that, anything may have been.
    forgotten: (Bounds, u64),
    most: Bounds,
}

impl Motion {
    /// Nothing is known of before: the robot may have moved as fast as it can.
    pub fn new(lag_s: f64, braking_m_s2: f64, turn_braking_rad_s2: f64, most: Bounds) -> Self {
        let mut told = [None; COMMANDS];
        told[0] = Some(Told { at_ns: 0, replaced_ns: None, bounds: most });
        let forgotten = (Bounds::default(), 0);
        Self { lag_s, braking_m_s2, turn_braking_rad_s2, told, next: 1, forgotten, most }
    }

    /// The motor is told this now. Told the same again, nothing changes.
    pub fn tell(&mut self, now_ns: u64, command: Command) {
        let (last, bounds) = ((self.next + COMMANDS - 1) % COMMANDS, Bounds::of(command));
        if let Some(last) = &mut self.told[last] {
            if last.bounds == bounds {
                return;
            }
            last.replaced_ns = Some(now_ns);
        }
        let told = Told { at_ns: now_ns, replaced_ns: None, bounds };
        if let Some(oldest) = self.told[self.next].replace(told) {
            let (bounds, since_ns) = self.forgotten;
            let obeyed_ns = oldest.replaced_ns.unwrap_or(now_ns).saturating_add(self.lag_ns()).max(since_ns);
            let rest = self.braked(bounds, since_ns, obeyed_ns).with(self.of(&oldest, obeyed_ns));
            self.forgotten = (rest, obeyed_ns);
        }
        self.next = (self.next + 1) % COMMANDS;
    }

    /// Bounds of the motion at a time, by what was told until then.
    pub fn at(&self, at_ns: u64) -> Bounds {
        self.bounds(at_ns, at_ns)
    }

    /// Bounds of all motion from then on, by all that was told.
    pub fn from(&self, from_ns: u64) -> Bounds {
        self.bounds(from_ns, u64::MAX)
    }

    /// Bounds from a time on, by what was told until another. No command bounds less than it did before.
    fn bounds(&self, from_ns: u64, until_ns: u64) -> Bounds {
        let (bounds, since_ns) = self.forgotten;
        let rest = if from_ns < since_ns { self.most } else { self.braked(bounds, since_ns, from_ns) };
        let told = self.told.iter().flatten().filter(|told| told.at_ns <= until_ns);
        told.fold(rest, |all, told| all.with(self.of(told, from_ns.max(told.at_ns))))
    }

    /// What a command leaves of its motion at a time.
    fn of(&self, told: &Told, at_ns: u64) -> Bounds {
        match told.replaced_ns {
            Some(replaced_ns) => self.braked(told.bounds, replaced_ns.saturating_add(self.lag_ns()), at_ns),
            None => told.bounds,
        }
    }

    fn lag_ns(&self) -> u64 {
        (self.lag_s * 1e9) as u64
    }

    fn braked(&self, bounds: Bounds, from_ns: u64, at_ns: u64) -> Bounds {
        let for_s = at_ns.saturating_sub(from_ns) as f64 * 1e-9;
        bounds.braked(for_s, self.braking_m_s2, self.turn_braking_rad_s2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const MOST: Bounds = Bounds { backward_m_s: -2.0, forward_m_s: 2.0, right_rad_s: -1.0, left_rad_s: 1.0 };

    fn ahead(speed_m_s: f64) -> Command {
        Command { speed_m_s, turn_rate_rad_s: 0.0 }
    }

    /// Brakes with 1 m/s², after 50 ms.
    fn motion() -> Motion {
        Motion::new(0.05, 1.0, 4.0, MOST)
    }

    #[track_caller]
    fn assert_forward(motion: &Motion, at_ms: u64, speed_m_s: f64) {
        let bound = motion.at(at_ms * MS).forward_m_s;
        assert!((bound - speed_m_s).abs() < 1e-9, "{bound} at {at_ms} ms");
    }

    #[test]
    fn what_is_not_known_is_the_most_and_ends_by_braking_however_often_it_is_told_to_stand() {
        let mut motion = motion();
        assert_eq!(motion.at(0), MOST);
        (0..60).for_each(|look| motion.tell(look * 40 * MS, Command::STOP));
        assert_forward(&motion, 50, 2.0);
        assert_forward(&motion, 1050, 1.0);
        assert_eq!(motion.at(2050 * MS), Bounds::default());
    }

    #[test]
    fn a_command_bounds_the_motion_until_a_lag_after_the_next_and_the_braking_from_there() {
        let mut motion = motion();
        motion.tell(0, Command::STOP);
        motion.tell(10_000 * MS, ahead(1.0));
        motion.tell(11_000 * MS, ahead(0.4));
        for (at_ms, speed_m_s) in
            [(9_999, 0.0), (10_000, 1.0), (11_050, 1.0), (11_250, 0.8), (11_650, 0.4), (20_000, 0.4)]
        {
            assert_forward(&motion, at_ms, speed_m_s);
        }
        assert!((motion.from(11_350 * MS).forward_m_s - 0.7).abs() < 1e-9);
        assert!(motion.from(9_000 * MS).forward_m_s == 1.0, "all that was told since");
    }

    #[test]
    fn what_is_forgotten_still_brakes_and_before_that_anything_may_have_been() {
        let mut motion = motion();
        motion.tell(0, Command::STOP);
        motion.tell(10_000 * MS, ahead(1.5));
        (1..=80).for_each(|look| motion.tell((10_000 + look * 10) * MS, ahead(0.001 * (look % 2) as f64)));
        // The first of them was sent 10 ms after, and obeyed 50 ms later.
        assert_forward(&motion, 10_810, 1.5 - 0.75);
        assert!((motion.from(10_560 * MS).forward_m_s - 1.0).abs() < 1e-9, "what is remembered reaches back further");
        assert_eq!(motion.from(10_000 * MS), MOST);
    }
}
