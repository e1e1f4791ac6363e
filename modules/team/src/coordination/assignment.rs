//! Robots assigned to places: the least longest way, then the least sum, then the least sum of squares, then ids.
//!
//! 1. The bottleneck: the least bound under which all places are covered, by bisection over matchings.
//! 2. Under that bound the least sum: the Hungarian method with potentials (Kuhn 1955, Munkres 1957; Jonker and
//!    Volgenant 1987 for the shortest augmenting path).
//! 3. An assignment is optimal if and only if it uses no edge with a reduced cost above 0. Of those, robot after robot
//!    takes the first place that leaves an assignment for the rest.
//!
//! Squares decide between equal sums, since robots in a corridor have equal sums whether they pass each other or not.

use super::matching::Matching;

/// A way between a robot and a place, steps; `None`: out of reach.
pub(super) type Way = Option<u32>;

/// For each robot the place that it takes. All places are taken, so there are at most as many as robots.
///
/// `ways` has a row for each robot, by rising id. `None` if not all places can be taken.
pub(super) fn assign(ways: &[Vec<Way>], places: usize) -> Option<Vec<Option<usize>>> {
    let bound = bottleneck(ways, places)?;
    let costs = Costs::new(ways, places, bound);
    let mut optimal = Optimal::solve(&costs);
    optimal.first_by_ids();
    Some(optimal.place_of.into_iter().map(|place| Some(place).filter(|place| *place < places)).collect())
}

/// The least longest way of all assignments that cover every place.
fn bottleneck(ways: &[Vec<Way>], places: usize) -> Option<u32> {
    let mut lengths: Vec<u32> = ways.iter().flatten().flatten().copied().collect();
    lengths.push(0);
    lengths.sort_unstable();
    lengths.dedup();
    let covers = |bound: u32| {
        let mut matching = Matching::new(ways.len());
        let can = |robot: usize, place: usize| ways[robot][place].is_some_and(|way| way <= bound);
        (0..places).all(|place| matching.cover(place, &can))
    };
    let first = lengths.partition_point(|bound| !covers(*bound));
    lengths.get(first).copied()
}

/// Costs of a square: robots, and places with as many more that cost nothing as are missing.
struct Costs<'a> {
    ways: &'a [Vec<Way>],
    places: usize,
    bound: u32,
    /// More than all squares together.
    step: i128,
}

impl<'a> Costs<'a> {
    fn new(ways: &'a [Vec<Way>], places: usize, bound: u32) -> Self {
        let step = ways.len() as i128 * i128::from(bound).pow(2) + 1;
        Self { ways, places, bound, step }
    }

    fn cost(&self, robot: usize, place: usize) -> i128 {
        if place >= self.places {
            return 0;
        }
        match self.ways[robot][place].filter(|way| *way <= self.bound) {
            Some(way) => i128::from(way) * self.step + i128::from(way).pow(2),
            // More than all allowed ways together.
            None => (i128::from(self.bound) + 1) * self.step * (self.ways.len() as i128 + 1),
        }
    }
}

/// An optimal assignment, and which edges such ones use.
struct Optimal {
    place_of: Vec<usize>,
    robot_of: Vec<usize>,
    /// For each robot the places that some optimal assignment may give it.
    tight: Vec<Vec<bool>>,
    /// Places that stand for none: all the same.
    first_none: usize,
}

impl Optimal {
    /// The Hungarian method. Row 0 and column 0 of its arrays are helpers.
    fn solve(costs: &Costs<'_>) -> Self {
        let size = costs.ways.len();
        let (mut of_robot, mut of_place) = (vec![0_i128; size + 1], vec![0_i128; size + 1]);
        let mut robot_of = vec![0; size + 1];
        for robot in 1..=size {
            robot_of[0] = robot;
            let (mut least, mut came_from) = (vec![i128::MAX; size + 1], vec![0; size + 1]);
            let mut done = vec![false; size + 1];
            let mut place = 0;
            while robot_of[place] != 0 {
                done[place] = true;
                let (row, mut delta, mut next) = (robot_of[place], i128::MAX, 0);
                for column in (1..=size).filter(|column| !done[*column]) {
                    let reduced = costs.cost(row - 1, column - 1) - of_robot[row] - of_place[column];
                    if reduced < least[column] {
                        (least[column], came_from[column]) = (reduced, place);
                    }
                    if least[column] < delta {
                        (delta, next) = (least[column], column);
                    }
                }
                for column in 0..=size {
                    if done[column] {
                        of_robot[robot_of[column]] += delta;
                        of_place[column] -= delta;
                    } else if column > 0 {
                        least[column] -= delta;
                    }
                }
                place = next;
            }
            while place != 0 {
                robot_of[place] = robot_of[came_from[place]];
                place = came_from[place];
            }
        }
        let is_tight = |robot, place| costs.cost(robot, place) == of_robot[robot + 1] + of_place[place + 1];
        let tight = (0..size).map(|robot| (0..size).map(|place| is_tight(robot, place)).collect()).collect();
        let robot_of: Vec<usize> = robot_of[1..].iter().map(|robot| robot - 1).collect();
        let mut place_of = vec![0; size];
        robot_of.iter().enumerate().for_each(|(place, robot)| place_of[*robot] = place);
        Self { place_of, robot_of, tight, first_none: costs.places }
    }

    /// Of all optimal assignments the one in which robot after robot has the first place.
    fn first_by_ids(&mut self) {
        for robot in 0..self.place_of.len() {
            let has = self.place_of[robot].min(self.first_none);
            for place in 0..has {
                if self.tight[robot][place] && self.gives(robot, place) {
                    break;
                }
            }
        }
    }

    /// Gives a place to a robot, if the robots after it can have the rest.
    fn gives(&mut self, robot: usize, place: usize) -> bool {
        let (loser, free) = (self.robot_of[place], self.place_of[robot]);
        if loser < robot {
            return false;
        }
        let mut tried = vec![false; self.place_of.len()];
        tried[place] = true;
        let rerouted = self.reroutes(loser, free, robot, &mut tried);
        if rerouted {
            self.put(robot, place);
        }
        rerouted
    }

    /// Gives a robot another place than it has, so that in the end the free one is taken. Robots up to `fixed` keep
    /// theirs.
    fn reroutes(&mut self, robot: usize, free: usize, fixed: usize, tried: &mut [bool]) -> bool {
        for place in 0..self.place_of.len() {
            if tried[place] || !self.tight[robot][place] {
                continue;
            }
            tried[place] = true;
            let owner = self.robot_of[place];
            if place == free || owner > fixed && self.reroutes(owner, free, fixed, tried) {
                self.put(robot, place);
                return true;
            }
        }
        false
    }

    fn put(&mut self, robot: usize, place: usize) {
        (self.place_of[robot], self.robot_of[place]) = (place, robot);
    }
}

#[cfg(test)]
#[path = "assignment_tests.rs"]
mod tests;
