//! Steps of all robots to their goals: LaCAM* (Okumura, "LaCAM: Search-based algorithm for quick multi-agent
//! pathfinding", AAAI 2023; "Improving LaCAM for scalable eventually optimal multi-agent pathfinding", IJCAI 2023;
//! "Engineering LaCAM*", AAMAS 2024).
//!
//! A search, depth first, over where all robots are. Each such configuration has a tree of constraints, which say where
//! some robots go next; it grows by one leaf each time that the configuration is looked at. A step by priority
//! inheritance obeys the leaf. So the first steps are good guesses, and in the end all steps are tried.
//!
//! - **Guaranteed:** if the search ends by itself, it has found the least cost, or there is no solution.
//! - **Not guaranteed:** how long that takes; it may be exponential in the robots. So the number of looks is bounded.
//!
//! The cost of a step is the number of robots that are not, before and after it, at their goals.

use super::graph::{Graph, NONE};
use super::pibt::Stepper;
use std::cmp::Reverse;
use std::collections::{HashMap, VecDeque};
use std::rc::Rc;

/// For more robots the first solution counts: to go on searching shortens it less than to refine it.
const IMPROVED_ROBOTS_MAX: usize = 8;

/// How a search ends.
pub(super) enum Found {
    /// The paths of all robots at each moment, and whether none cost less.
    Solution { moments: Vec<Vec<u32>>, is_least: bool },
    /// There is no solution.
    Nothing,
    /// Not one was found with so many looks.
    TooLong,
}

/// Where all robots are.
struct Configuration {
    paths: Rc<[u32]>,
    /// The one before, on the cheapest way from the start.
    before: u32,
    /// Of that way.
    cost: u32,
    /// Of any way on to the goals at least.
    rest: u32,
    /// Known ones that a step leads to.
    next: Vec<u32>,
    /// By robot: steps since it was at its goal last.
    away: Vec<u32>,
    /// Robots, the most urgent first.
    order: Vec<u32>,
    /// Leaves of its tree of constraints, by their number.
    leaves: VecDeque<u32>,
}

/// A leaf: this robot goes there, and what the leaf before it says.
#[derive(Clone, Copy)]
struct Constraint {
    before: u32,
    depth: u32,
    robot: u32,
    to: u32,
}

pub(super) struct Search<'a> {
    graph: &'a Graph,
    distances: &'a [Vec<u32>],
    goals: &'a [u32],
    known: HashMap<Rc<[u32]>, u32>,
    configurations: Vec<Configuration>,
    /// The last one is looked at next.
    open: Vec<u32>,
    constraints: Vec<Constraint>,
    goal: Option<u32>,
}

impl<'a> Search<'a> {
    pub(super) fn new(graph: &'a Graph, distances: &'a [Vec<u32>], starts: &[u32], goals: &'a [u32]) -> Self {
        let root = Constraint { before: NONE, depth: 0, robot: NONE, to: NONE };
        let (known, configurations, open) = (HashMap::new(), Vec::new(), Vec::new());
        let mut search =
            Self { graph, distances, goals, known, configurations, open, constraints: vec![root], goal: None };
        search.add(starts.into(), NONE);
        search
    }

    /// Looks at configurations so many times; then the best solution so far counts.
    pub(super) fn run(mut self, looks_max: u32) -> Found {
        let mut stepper = Stepper::new(self.graph, self.distances);
        let mut forced = Vec::new();
        for _ in 0..looks_max {
            let Some(top) = self.open.last().copied() else { return self.found(true) };
            let here = &self.configurations[top as usize];
            if *here.paths == *self.goals {
                // The way that a search found first ends here; cheaper ones end here, too.
                self.goal = Some(top);
                if self.goals.len() > IMPROVED_ROBOTS_MAX {
                    break;
                }
            }
            if self.goal.is_some_and(|goal| here.cost + here.rest >= self.configurations[goal as usize].cost) {
                self.open.pop();
                continue;
            }
            let Some(leaf) = self.next_leaf(top) else {
                self.open.pop();
                continue;
            };
            self.forced_by(leaf, &mut forced);
            let here = &self.configurations[top as usize];
            if let Some(paths) = stepper.step(&here.paths, &here.order, &forced) {
                match self.known.get(paths).copied() {
                    Some(known) => self.reach_again(top, known),
                    None => self.add(paths.into(), top),
                }
            }
        }
        self.found(false)
    }

    fn found(self, has_ended: bool) -> Found {
        let Some(goal) = self.goal else { return if has_ended { Found::Nothing } else { Found::TooLong } };
        let mut moments = Vec::new();
        let mut at = goal;
        while at != NONE {
            let configuration = &self.configurations[at as usize];
            moments.push(configuration.paths.to_vec());
            at = configuration.before;
        }
        moments.reverse();
        Found::Solution { moments, is_least: has_ended }
    }

    fn add(&mut self, paths: Rc<[u32]>, before: u32) {
        let number = self.configurations.len() as u32;
        let distance = |robot: usize, path: u32| self.distances[robot][path as usize];
        let parent = self.configurations.get(before as usize);
        let is_away = |(robot, path): (usize, &u32)| u32::from(*path != self.goals[robot]);
        let away: Vec<u32> = match parent {
            Some(parent) => paths.iter().enumerate().map(|it| is_away(it) * (parent.away[it.0] + 1)).collect(),
            None => paths.iter().enumerate().map(is_away).collect(),
        };
        let first = self.configurations.first().map_or(&paths, |first| &first.paths);
        let mut order: Vec<u32> = (0..paths.len() as u32).collect();
        let urgency = |robot: &u32| {
            let robot = *robot as usize;
            (Reverse(away[robot]), Reverse(distance(robot, first[robot])), robot)
        };
        order.sort_unstable_by_key(urgency);
        let cost = parent.map_or(0, |parent| parent.cost + self.cost(&parent.paths, &paths));
        let rest = paths.iter().enumerate().map(|(robot, path)| distance(robot, *path)).sum();
        if let Some(parent) = self.configurations.get_mut(before as usize) {
            parent.next.push(number);
        }
        self.known.insert(paths.clone(), number);
        let leaves = VecDeque::from([0]);
        self.configurations.push(Configuration { paths, before, cost, rest, next: Vec::new(), away, order, leaves });
        self.open.push(number);
    }

    /// Takes the next leaf of a configuration's tree; the tree grows below it.
    fn next_leaf(&mut self, at: u32) -> Option<u32> {
        let here = &mut self.configurations[at as usize];
        let leaf = here.leaves.pop_front()?;
        let depth = self.constraints[leaf as usize].depth;
        if let Some(robot) = here.order.get(depth as usize).copied() {
            let path = here.paths[robot as usize];
            for to in self.graph.next(path).chain([path]) {
                here.leaves.push_back(self.constraints.len() as u32);
                self.constraints.push(Constraint { before: leaf, depth: depth + 1, robot, to });
            }
        }
        Some(leaf)
    }

    fn forced_by(&self, leaf: u32, forced: &mut Vec<(u32, u32)>) {
        forced.clear();
        let mut at = leaf;
        // The root forces nothing.
        while at != 0 {
            let Constraint { before, robot, to, .. } = self.constraints[at as usize];
            forced.push((robot, to));
            at = before;
        }
    }

    fn cost(&self, from: &[u32], to: &[u32]) -> u32 {
        let pairs = from.iter().zip(to).zip(self.goals);
        pairs.filter(|((from, to), goal)| from != goal || to != goal).count() as u32
    }

    /// A step led to what is known: ways through it may be cheaper now. It is looked at next, so the search goes on
    /// elsewhere than where it came from.
    fn reach_again(&mut self, from: u32, to: u32) {
        if !self.configurations[from as usize].next.contains(&to) {
            self.configurations[from as usize].next.push(to);
        }
        let mut queue = VecDeque::from([from]);
        while let Some(at) = queue.pop_front() {
            for beside in self.configurations[at as usize].next.clone() {
                let (here, there) = (&self.configurations[at as usize], &self.configurations[beside as usize]);
                let cost = here.cost + self.cost(&here.paths, &there.paths);
                if cost < there.cost {
                    let there = &mut self.configurations[beside as usize];
                    (there.cost, there.before) = (cost, at);
                    queue.push_back(beside);
                    if self.is_worth_it(beside) {
                        self.open.push(beside);
                    }
                }
            }
        }
        if self.is_worth_it(to) {
            self.open.push(to);
        }
    }

    fn is_worth_it(&self, at: u32) -> bool {
        let here = &self.configurations[at as usize];
        self.goal.is_none_or(|goal| here.cost + here.rest < self.configurations[goal as usize].cost)
    }
}
