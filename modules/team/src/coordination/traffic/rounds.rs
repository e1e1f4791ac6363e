//! Rounds of planning: robots stand, come to know the same, plan the same, and go.
//!
//! ```text
//!  anything new ──▶ round + 1 ──▶ all say where their step ends ──▶ stances ──▶ all digests equal ──▶ plan, go
//! ```
//!
//! A round is started by any robot: for a new goal, a robot that came or went, a stall. The greatest number counts. A
//! plan keeps an order: a robot enters a cell after those that have it earlier in the plan have left it. In a plan no
//! circle of robots moves at once, so some robot can always go on.
//!
//! **Nobody stands for a round.** A robot that is on its way into a cell is there, as far as plans go: it has the cell
//! for itself. While it drives, all agree; it begins no other step before that.

use super::message::Stance;
use crate::coordination::planning::{NoWays, Trip, plan_ways};
use crate::coordination::post::Target;
use crate::coordination::sharing::{Duty, Participant, Sharing, share_out};
use crate::grid::{Cell, Grid, Obstacle, ObstacleKind, Wave};
use crate::ids::RobotId;
use siphasher::sip::SipHasher13;
use std::collections::{BTreeMap, BTreeSet};
use std::hash::{Hash, Hasher};

/// What all robots of a round say.
pub(super) type Stances = BTreeMap<RobotId, Stance>;

/// What robots plan from, beside the map. Those that have the same plan the same.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(super) struct Known {
    pub(super) stances: Stances,
    pub(super) intruders: Vec<Target>,
    /// Cells of robots that are silent.
    pub(super) silent: BTreeSet<Cell>,
}

impl Known {
    /// A number by which robots tell that they know the same.
    pub(super) fn digest(&self) -> u64 {
        let mut hasher = SipHasher13::new();
        self.hash(&mut hasher);
        hasher.finish()
    }

    /// Cells of what does not move out of the way.
    fn standing(&self) -> Vec<Cell> {
        let frozen = self.stances.values().filter(|stance| stance.is_frozen).map(|stance| stance.cell);
        frozen.chain(self.silent.iter().copied()).collect()
    }

    /// What robots do: they share the exits of intruders, if there are any.
    fn sharing(&self, grid: &Grid) -> Option<Sharing> {
        if self.intruders.is_empty() {
            return None;
        }
        let participant = |(robot, stance): (&RobotId, &Stance)| {
            let cell = Some(stance.cell).filter(|_| !stance.is_frozen);
            Participant { robot: *robot, map: 0, cell, post: stance.post }
        };
        let robots: Vec<Participant> = self.stances.iter().map(participant).collect();
        Some(share_out(&mut Wave::default(), grid, 0, &robots, &self.intruders, &self.standing()))
    }
}

/// The plan of a round.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct RoundPlan {
    pub(super) sharing: Option<Sharing>,
    /// Robots that do not get to their goals, and why.
    pub(super) given_up: Vec<(RobotId, NoWays)>,
    /// The order of cells in moments.
    robots: Vec<RobotId>,
    moments: Vec<Vec<Cell>>,
}

impl RoundPlan {
    /// Plans from what is known. Robots without a way to their goals are planned for without a goal, one after the
    /// other, the greatest id first.
    pub(super) fn new(grid: &Grid, known: &Known, looks_max: u32) -> Self {
        let sharing = known.sharing(grid);
        let goal = |robot: &RobotId, stance: &Stance| match &sharing {
            Some(sharing) => sharing.duties.get(robot).and_then(Duty::cell),
            None => stance.goal,
        };
        let trip = |(robot, stance): (&RobotId, &Stance)| {
            (*robot, Trip { from: stance.cell, to: goal(robot, stance).unwrap_or(stance.cell) })
        };
        let movable = known.stances.iter().filter(|(_, stance)| !stance.is_frozen);
        let (robots, mut trips): (Vec<RobotId>, Vec<Trip>) = movable.map(trip).unzip();
        let stopped = known.standing().into_iter().map(|cell| Obstacle { cell, kind: ObstacleKind::Stopped });
        let bodies = known.intruders.iter().flat_map(|intruder| &intruder.cells);
        let bodies = bodies.map(|cell| Obstacle { cell: *cell, kind: ObstacleKind::Intruder });
        let blocked: Vec<Obstacle> = stopped.chain(bodies).collect();
        let mut given_up = Vec::new();
        let moments = loop {
            match plan_ways(grid, &blocked, &trips, looks_max) {
                Ok(ways) => break ways.moments().to_vec(),
                Err(error) => match to_give_up(&trips, error) {
                    Some(at) => {
                        trips[at].to = trips[at].from;
                        given_up.push((robots[at], error));
                    }
                    // Two are in one cell, or one is beside all paths: nobody goes.
                    None => break vec![trips.iter().map(|trip| trip.from).collect()],
                },
            }
        };
        Self { sharing, given_up, robots, moments }
    }

    /// The cell that a robot has to be in next, and its moment then. `None` when it has arrived, or has to wait for
    /// another one; `moment_of` says how far the others are.
    pub(super) fn next(&self, me: RobotId, moment: u32, moment_of: impl Fn(RobotId) -> u32) -> Option<(Cell, u32)> {
        let at = self.robots.binary_search(&me).ok()?;
        let (next, cell) = self.step_after(at, moment)?;
        let has_left = |(other, robot): (usize, &RobotId)| {
            let last = self.moments[..next].iter().rposition(|cells| cells[other] == cell);
            other == at || last.is_none_or(|last| moment_of(*robot) as usize > last)
        };
        self.robots.iter().enumerate().all(has_left).then_some((cell, next as u32))
    }

    /// Cells to which a robot goes after a moment, the next one first.
    pub(super) fn way(&self, me: RobotId, mut moment: u32) -> Vec<Cell> {
        let Ok(at) = self.robots.binary_search(&me) else { return Vec::new() };
        let steps = std::iter::from_fn(|| {
            let (next, cell) = self.step_after(at, moment)?;
            moment = next as u32;
            Some(cell)
        });
        steps.collect()
    }

    /// Whether the plan has a robot in this cell at a moment, if it has the robot at all.
    pub(super) fn is_at(&self, me: RobotId, moment: u32, cell: Cell) -> bool {
        let at = self.robots.binary_search(&me).ok();
        at.is_none_or(|at| self.moments.get(moment as usize).is_some_and(|cells| cells[at] == cell))
    }

    /// Steps that a robot still has to go.
    pub(super) fn steps_left(&self, me: RobotId, moment: u32) -> usize {
        let Ok(at) = self.robots.binary_search(&me) else { return 0 };
        let rest = self.moments.get(moment as usize..).unwrap_or_default();
        rest.windows(2).filter(|pair| pair[0][at] != pair[1][at]).count()
    }

    /// Whether a robot has not arrived yet, or another plan may give it more to do: it has no way to its goal, or it
    /// holds no exit while some are open.
    pub(super) fn wants_more(&self, me: RobotId, moment: u32) -> bool {
        let is_on_its_way = self.robots.binary_search(&me).is_ok_and(|at| self.step_after(at, moment).is_some());
        let has_no_way = self.given_up.iter().any(|(robot, _)| *robot == me);
        let is_missed = self.sharing.as_ref().is_some_and(|sharing| {
            !sharing.open.is_empty() && !matches!(sharing.duties.get(&me), Some(Duty::Hold { .. }))
        });
        is_on_its_way || has_no_way || is_missed
    }

    /// The next moment at which a robot is elsewhere, and where.
    fn step_after(&self, at: usize, moment: u32) -> Option<(usize, Cell)> {
        let here = self.moments.get(moment as usize)?[at];
        let mut later = self.moments.iter().enumerate().skip(moment as usize + 1);
        later.find(|(_, cells)| cells[at] != here).map(|(next, cells)| (next, cells[at]))
    }
}

/// The robot that has no way to its goal, or the last one that has a goal elsewhere.
fn to_give_up(trips: &[Trip], error: NoWays) -> Option<usize> {
    let goes = |trip: &Trip| trip.from != trip.to;
    trips.iter().rposition(|trip| match error {
        NoWays::Parted { from, .. } => trip.from == from,
        NoWays::NotAPath { cell } | NoWays::Shared { cell } => goes(trip) && trip.to == cell,
        NoWays::Impossible | NoWays::GivenUp { .. } | NoWays::TooLarge { .. } => goes(trip),
    })
}
