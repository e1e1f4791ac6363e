//! Names of robots, and the versions by which newer is told from older without a clock.

/// A robot, or a station that takes part as one: its system number, 1 to 254.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct RobotId(u8);

impl RobotId {
    /// The robot of this system number; `None` for 0 and 255, which name no single system.
    pub const fn new(system: u8) -> Option<Self> {
        if system == 0 || system == u8::MAX { None } else { Some(Self(system)) }
    }

    /// The system number.
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl std::fmt::Display for RobotId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// Place of a statement in the order of all that one robot says. A robot alone raises its own.
///
/// Compared first by incarnation: what a restarted robot says is newer than all that it said before.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct Version {
    /// Run of the robot; a restart begins the next one.
    pub incarnation: u32,
    /// Number in this run.
    pub counter: u32,
}

impl Version {
    /// The version after this one; a counter that is used up goes on in the next incarnation. The last one stays.
    #[must_use]
    pub const fn next(self) -> Self {
        match (self.counter.checked_add(1), self.incarnation.checked_add(1)) {
            (Some(counter), _) => Self { incarnation: self.incarnation, counter },
            (None, Some(incarnation)) => Self { incarnation, counter: 0 },
            (None, None) => self,
        }
    }
}

/// One run of a robot.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Run {
    /// The robot.
    pub robot: RobotId,
    /// Which run.
    pub incarnation: u32,
}

/// A point of the team's map, millimetres: whole numbers, so that equal records are equal on every machine.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct Position {
    /// Eastward, mm.
    pub x_mm: i32,
    /// Northward, mm.
    pub y_mm: i32,
}

impl Position {
    /// Whether the other point is at most so far away, mm.
    pub fn is_within(self, other: Self, distance_mm: u64) -> bool {
        let square = |a: i32, b: i32| u128::from(a.abs_diff(b)).pow(2);
        square(self.x_mm, other.x_mm) + square(self.y_mm, other.y_mm) <= u128::from(distance_mm).pow(2)
    }
}
