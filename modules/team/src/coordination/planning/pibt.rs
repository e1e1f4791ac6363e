//! One step of all robots: priority inheritance with backtracking (Okumura, Machida, Défago and Tamura, "Priority
//! inheritance with backtracking for iterative multi-agent path finding", Artificial Intelligence 310, 2022).
//!
//! The robot with the highest priority goes where it is nearest to its goal. If another robot is there, that one has to
//! go elsewhere first, with the priority of the first; if it cannot, the first one tries the next cell.
//!
//! Here no circle of robots moves at once, be it two that swap or four that turn: a robot enters a cell after another
//! has left it, so one of a circle would have to begin. The paper forbids swaps alone.

use super::graph::{Graph, NONE};
use super::swapping::Occupancy;

/// What a step of all robots is worked out with; the memory serves for the next one.
pub(super) struct Stepper<'a> {
    graph: &'a Graph,
    /// By robot: steps from each path to its goal.
    distances: &'a [Vec<u32>],
    /// By path: the robot that is there before the step.
    occupant: Vec<u32>,
    /// By path: the robot that is there after it.
    taker: Vec<u32>,
    /// By robot: where it is before the step.
    now: Vec<u32>,
    /// By robot: where it is after the step.
    next: Vec<u32>,
    /// Changes between paths that are as good.
    salt: u64,
}

impl<'a> Stepper<'a> {
    pub(super) fn new(graph: &'a Graph, distances: &'a [Vec<u32>]) -> Self {
        let (paths, robots) = (vec![NONE; graph.paths()], vec![NONE; distances.len()]);
        Self { graph, distances, occupant: paths.clone(), taker: paths, now: robots.clone(), next: robots, salt: 0 }
    }

    /// Where all robots are after a step from `now`, if there is one in which some robots go where they have to. Robots
    /// choose in this order.
    pub(super) fn step(&mut self, now: &[u32], order: &[u32], forced: &[(u32, u32)]) -> Option<&[u32]> {
        self.clear();
        self.now.copy_from_slice(now);
        for (robot, path) in (0..).zip(now) {
            self.occupant[*path as usize] = robot;
        }
        for (robot, to) in forced {
            if !self.is_free(*robot, *to) {
                return None;
            }
            self.take(*robot, *to);
        }
        let all = order.iter().all(|robot| self.next[*robot as usize] != NONE || self.goes(*robot));
        all.then_some(&self.next)
    }

    fn clear(&mut self) {
        self.salt = self.salt.wrapping_add(1);
        for robot in 0..self.now.len() {
            for (paths, path) in [(&mut self.occupant, self.now[robot]), (&mut self.taker, self.next[robot])] {
                if path != NONE {
                    paths[path as usize] = NONE;
                }
            }
        }
        self.next.fill(NONE);
    }

    /// Whether the robot finds a path to go to, or to stay in. If not it stays, and takes its path back from the robot
    /// that wanted it.
    fn goes(&mut self, robot: u32) -> bool {
        let here = self.now[robot as usize];
        let mut choice = [(0, false, 0, here); 5];
        let mut count = 0;
        for to in self.graph.next(here).chain([here]) {
            let is_taken = to != here && self.occupant[to as usize] != NONE;
            choice[count] = (self.distances[robot as usize][to as usize], is_taken, self.mixed(robot, to), to);
            count += 1;
        }
        choice[..count].sort_unstable();
        let (graph, distances, occupant) = (self.graph, self.distances, &self.occupant);
        let occupancy = Occupancy { graph, distances, occupant };
        let partner = occupancy.partner(robot, here, choice[0].3, |other| self.next[other as usize] == NONE);
        if partner.is_some() {
            choice[..count].reverse();
        }
        for (turn, (.., to)) in choice.into_iter().take(count).enumerate() {
            if !self.is_free(robot, to) {
                continue;
            }
            self.take(robot, to);
            let other = self.occupant[to as usize];
            if other == NONE || self.next[other as usize] != NONE || self.goes(other) {
                let follower = partner.filter(|it| turn == 0 && self.next[*it as usize] == NONE);
                if let Some(follower) = follower.filter(|follower| self.is_free(*follower, here)) {
                    self.take(follower, here);
                }
                return true;
            }
        }
        self.take(robot, here);
        false
    }

    fn take(&mut self, robot: u32, to: u32) {
        self.next[robot as usize] = to;
        self.taker[to as usize] = robot;
    }

    /// Whether a way leads on from there, no other robot is there after the step, and no circle of robots closes.
    fn is_free(&self, robot: u32, to: u32) -> bool {
        if self.taker[to as usize] != NONE || self.distances[robot as usize][to as usize] == NONE {
            return false;
        }
        if to == self.now[robot as usize] {
            return true;
        }
        let mut path = to;
        loop {
            let other = self.occupant[path as usize];
            if other == robot {
                return false;
            }
            path = if other == NONE { NONE } else { self.next[other as usize] };
            if path == NONE {
                return true;
            }
        }
    }

    /// A number in no order; equal on every machine.
    fn mixed(&self, robot: u32, to: u32) -> u32 {
        let mixed = (self.salt << 40 ^ u64::from(robot) << 24 ^ u64::from(to)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 32) as u32
    }
}
