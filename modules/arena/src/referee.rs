//! What robots must not do, noted with its time.

use rohrpost_team::RobotId;
use rohrpost_team::grid::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Incidents that are kept; more are only counted.
const INCIDENTS_MAX: usize = 10_000;

/// What a robot can touch.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Thing {
    /// A wall, or the bound of the map.
    Wall,
    /// Another robot.
    Robot(RobotId),
    /// An intruder, by the order in which they came.
    Intruder(usize),
}

impl fmt::Display for Thing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Wall => f.write_str("a wall"),
            Self::Robot(robot) => write!(f, "robot {robot}"),
            Self::Intruder(number) => write!(f, "intruder {number}"),
        }
    }
}

/// Something that robots must not do.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Mishap {
    /// A robot that moved has met something.
    Touch {
        /// The robot that moved.
        by: RobotId,
        /// What it met.
        with: Thing,
        /// Whether it moved towards the point of contact. Then the touch counts against it.
        is_towards: bool,
        /// Speed of the robot, metres a second; below zero: backward.
        speed_m_s: f64,
    },
    /// A robot has come into a cell in which another one is.
    TwoInCell {
        /// Where.
        cell: Cell,
        /// The robot that came.
        came: RobotId,
        /// The robot that was there.
        was: RobotId,
    },
    /// Two robots in cells side by side have each come from the other's cell.
    Swap {
        /// The cell of the first one now.
        cell: Cell,
        /// The robot that came last.
        first: RobotId,
        /// The other one.
        second: RobotId,
    },
}

impl fmt::Display for Mishap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Touch { by, with, is_towards, speed_m_s } => {
                let how = if *is_towards { "moving towards it" } else { "not moving towards it" };
                write!(f, "robot {by} touches {with} at {speed_m_s:.2} m/s, {how}")
            }
            Self::TwoInCell { cell, came, was } => write!(f, "robot {came} comes into {cell}, where robot {was} is"),
            Self::Swap { cell, first, second } => {
                write!(f, "robots {first} and {second} have swapped cells; {first} is at {cell}")
            }
        }
    }
}

/// A mishap and its time.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Incident {
    /// Time of the arena, ns.
    pub at_ns: u64,
    /// What happened.
    pub mishap: Mishap,
}

impl fmt::Display for Incident {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} s: {}", self.at_ns as f64 * 1e-9, self.mishap)
    }
}

/// A robot's cell, and the one before.
#[derive(Clone, Copy, Debug)]
struct Track {
    cell: Cell,
    before: Option<Cell>,
}

/// Notes incidents.
#[derive(Clone, Debug, Default)]
pub struct Referee {
    incidents: Vec<Incident>,
    tracks: BTreeMap<RobotId, Track>,
    excepted: BTreeSet<RobotId>,
    towards: u64,
    touches: u64,
    two_in_cell: u64,
    swaps: u64,
}

impl Referee {
    /// The first incidents, by time.
    pub fn incidents(&self) -> &[Incident] {
        &self.incidents
    }

    /// Touches by robots that moved towards what they touched.
    pub fn touches_towards(&self) -> u64 {
        self.towards
    }

    /// All touches.
    pub fn touches(&self) -> u64 {
        self.touches
    }

    /// How often a robot has come into a cell in which another one was.
    pub fn two_in_cell(&self) -> u64 {
        self.two_in_cell
    }

    /// How often two robots have swapped cells.
    pub fn swaps(&self) -> u64 {
        self.swaps
    }

    /// A robot that was pushed does not count in cells and swaps until it has come to a cell by itself.
    pub(crate) fn except(&mut self, robot: RobotId) {
        self.excepted.insert(robot);
        self.tracks.remove(&robot);
    }

    pub(crate) fn touch(&mut self, at_ns: u64, by: RobotId, with: Thing, is_towards: bool, speed_m_s: f64) {
        self.touches += 1;
        self.towards += u64::from(is_towards);
        self.note(at_ns, Mishap::Touch { by, with, is_towards, speed_m_s });
    }

    /// A robot is in a cell now, or still.
    pub(crate) fn place(&mut self, at_ns: u64, robot: RobotId, cell: Cell) {
        let before = self.tracks.get(&robot).map(|track| track.cell);
        if before == Some(cell) {
            return;
        }
        self.tracks.insert(robot, Track { cell, before });
        if before.is_none() {
            return;
        }
        self.excepted.remove(&robot);
        let there = |track: &Track| track.cell == cell;
        let others = self.tracks.iter().filter(|(other, _)| **other != robot && !self.excepted.contains(other));
        let mut found = Vec::new();
        for (other, track) in others {
            if there(track) {
                found.push(Mishap::TwoInCell { cell, came: robot, was: *other });
            } else if Some(track.cell) == before && track.before == Some(cell) {
                found.push(Mishap::Swap { cell, first: robot, second: *other });
            }
        }
        for mishap in found {
            match mishap {
                Mishap::Swap { .. } => self.swaps += 1,
                _ => self.two_in_cell += 1,
            }
            self.note(at_ns, mishap);
        }
    }

    fn note(&mut self, at_ns: u64, mishap: Mishap) {
        if self.incidents.len() < INCIDENTS_MAX {
            self.incidents.push(Incident { at_ns, mishap });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_that_pass_each_other_have_swapped_and_those_that_follow_have_not() {
        let [first, second, third] = [1, 2, 3].map(|id| RobotId::new(id).expect("it is an id"));
        let cell = |column| Cell { column, row: 0 };
        let mut referee = Referee::default();
        for (robot, column) in [(first, 1), (second, 2), (third, 9)] {
            referee.place(0, robot, cell(column));
        }
        referee.place(1, first, cell(2));
        referee.place(2, second, cell(1));
        assert_eq!((referee.two_in_cell(), referee.swaps()), (1, 1), "{:?}", referee.incidents());
        referee.place(3, first, cell(3));
        referee.place(4, second, cell(2));
        assert_eq!((referee.two_in_cell(), referee.swaps()), (1, 1), "one follows the other");
        referee.except(second);
        referee.place(5, first, cell(2));
        assert_eq!(referee.two_in_cell(), 1, "a robot that was carried away has no cell");
    }
}
