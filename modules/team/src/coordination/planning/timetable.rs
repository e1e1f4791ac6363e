//! Where robots are at each moment of a plan, and the soonest way of one robot between all others.

use super::graph::{Graph, NONE};

/// The paths of robots at moments 0 to the last one; after it they stay.
pub(super) struct Timetable<'a> {
    graph: &'a Graph,
    distances: &'a [Vec<u32>],
    goals: &'a [u32],
    /// By robot, by moment; empty for a robot that is taken out.
    ways: Vec<Vec<u32>>,
    /// By moment, by path: the robot that is there.
    robots: Vec<u32>,
    /// Of a search: by moment, by path, the path before. Cleared after each.
    came_from: Vec<u32>,
}

impl<'a> Timetable<'a> {
    pub(super) fn new(graph: &'a Graph, distances: &'a [Vec<u32>], goals: &'a [u32], moments: &[Vec<u32>]) -> Self {
        let size = moments.len() * graph.paths();
        let ways = (0..goals.len()).map(|robot| moments.iter().map(|paths| paths[robot]).collect::<Vec<u32>>());
        let mut table = Self {
            graph,
            distances,
            goals,
            ways: vec![Vec::new(); goals.len()],
            robots: vec![NONE; size],
            came_from: vec![NONE; size],
        };
        ways.enumerate().for_each(|(robot, way)| table.put(robot, way));
        table
    }

    pub(super) fn ways(&self) -> &[Vec<u32>] {
        &self.ways
    }

    /// Moment from which a robot stays at its goal.
    pub(super) fn arrival(&self, robot: usize) -> u32 {
        let away = self.ways[robot].iter().rposition(|path| *path != self.goals[robot]);
        away.map_or(0, |last| last as u32 + 1)
    }

    /// Moments that the robot takes longer than if it were alone.
    pub(super) fn delay(&self, robot: usize) -> u32 {
        let start = self.ways[robot].first().copied().unwrap_or(self.goals[robot]);
        self.arrival(robot).saturating_sub(self.distances[robot][start as usize])
    }

    pub(super) fn put(&mut self, robot: usize, way: Vec<u32>) {
        self.mark(&way, robot as u32);
        self.ways[robot] = way;
    }

    pub(super) fn take_out(&mut self, robot: usize) -> Vec<u32> {
        let way = std::mem::take(&mut self.ways[robot]);
        self.mark(&way, NONE);
        way
    }

    fn mark(&mut self, way: &[u32], robot: u32) {
        for (moment, path) in way.iter().enumerate() {
            let at = self.at(moment, *path);
            self.robots[at] = robot;
        }
    }

    fn at(&self, moment: usize, path: u32) -> usize {
        moment * self.graph.paths() + path as usize
    }

    fn moments(&self) -> usize {
        self.robots.len() / self.graph.paths().max(1)
    }

    /// Robots that are in the way of this one, if it goes where it is nearer to its goal at each moment.
    pub(super) fn in_the_way(&self, robot: usize) -> Vec<usize> {
        let mut path = self.ways[robot][0];
        let mut found = Vec::new();
        for moment in 1..self.moments() {
            let nearer = |to: &u32| self.distances[robot][*to as usize] < self.distances[robot][path as usize];
            let next: Vec<u32> = self.graph.next(path).filter(nearer).collect();
            let other = |to: &u32| self.robots[self.at(moment, *to)];
            let free = |to: &&u32| matches!(other(to), NONE) || other(to) == robot as u32;
            found.extend(next.iter().map(other).filter(|it| *it != NONE && *it != robot as u32).map(|it| it as usize));
            match next.iter().find(free).or(next.first()) {
                Some(to) => path = *to,
                None => break,
            }
        }
        found
    }

    /// The way of a robot that was taken out by which it arrives first, and before a moment. Tries short delays first:
    /// few paths are in reach then.
    pub(super) fn soonest(&mut self, robot: usize, start: u32, before: u32) -> Option<Vec<u32>> {
        let alone = self.distances[robot][start as usize];
        let delays = (0..u32::BITS).map(|doubled| alone.saturating_add(1 << doubled));
        let mut bounds = delays.take_while(|bound| *bound < before).chain([before]);
        bounds.find_map(|bound| self.sooner_than(robot, start, bound))
    }

    fn sooner_than(&mut self, robot: usize, start: u32, before: u32) -> Option<Vec<u32>> {
        let goal = self.goals[robot];
        let is_taken = |moment: &usize| self.robots[self.at(*moment, goal)] != NONE;
        let free_from = (0..self.moments()).rev().find(is_taken).map_or(0, |last| last + 1);
        let mut layers = vec![vec![start]];
        let mut reached = Vec::new();
        let arrival = loop {
            let (moment, layer) = (layers.len() - 1, &layers[layers.len() - 1]);
            if moment >= free_from && layer.contains(&goal) {
                break Some(moment);
            }
            if layer.is_empty() || moment + 1 >= self.moments() {
                break None;
            }
            let mut next = Vec::new();
            for from in layer {
                for to in self.graph.next(*from).chain([*from]) {
                    let at = self.at(moment + 1, to);
                    let rest = self.distances[robot][to as usize];
                    let is_soon = rest != NONE && moment as u32 + 1 + rest < before;
                    if is_soon && self.came_from[at] == NONE && self.can_go(robot, moment, *from, to) {
                        self.came_from[at] = *from;
                        reached.push(at);
                        next.push(to);
                    }
                }
            }
            layers.push(next);
        };
        let way = arrival.map(|arrival| self.way_back(goal, arrival));
        reached.into_iter().for_each(|at| self.came_from[at] = NONE);
        way
    }

    fn way_back(&self, goal: u32, arrival: usize) -> Vec<u32> {
        let mut way = vec![goal; self.moments()];
        for moment in (0..arrival).rev() {
            way[moment] = self.came_from[self.at(moment + 1, way[moment + 1])];
        }
        way
    }

    /// Whether no other robot is there next, and no circle of robots closes.
    fn can_go(&self, robot: usize, moment: usize, from: u32, to: u32) -> bool {
        if self.robots[self.at(moment + 1, to)] != NONE {
            return false;
        }
        let mut path = to;
        loop {
            let other = self.robots[self.at(moment, path)];
            if from == to || other == NONE {
                return true;
            }
            debug_assert!(other != robot as u32, "it is taken out");
            path = self.ways[other as usize][moment + 1];
            if path == from {
                return false;
            }
        }
    }
}
