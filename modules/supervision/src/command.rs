//! What a motor is told.

/// A motion in the plane, in the robot's own frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Forward, metres a second.
    pub speed_m_s: f64,
    /// Counter-clockwise, radians a second.
    pub turn_rate_rad_s: f64,
}

impl Command {
    /// The wheels stand.
    pub const STOP: Self = Self { speed_m_s: 0.0, turn_rate_rad_s: 0.0 };

    /// Whether both are numbers.
    pub fn is_finite(self) -> bool {
        self.speed_m_s.is_finite() && self.turn_rate_rad_s.is_finite()
    }
}
