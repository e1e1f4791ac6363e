//! Tries all steps of all robots.

use crate::valid::is_step;
use rohrpost_team::coordination::Trip;
use rohrpost_team::grid::{Cell, Direction, Grid, Obstacle, ObstacleKind};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// The least sum over moments of robots that are not at their goals before and after; `None` if there is no solution.
pub(crate) fn least_cost(grid: &Grid, obstacles: &[Obstacle], trips: &[Trip]) -> Option<u64> {
    let starts: Vec<Cell> = trips.iter().map(|trip| trip.from).collect();
    let goals: Vec<Cell> = trips.iter().map(|trip| trip.to).collect();
    let mut least = BTreeMap::from([(starts.clone(), 0)]);
    let mut open = BinaryHeap::from([(Reverse(0), starts)]);
    while let Some((Reverse(cost), now)) = open.pop() {
        if now == goals {
            return Some(cost);
        }
        if least[&now] < cost {
            continue;
        }
        for next in steps(grid, obstacles, &now) {
            let away = now.iter().zip(&next).zip(&goals).filter(|((from, to), goal)| from != goal || to != goal);
            let cost = cost + away.count() as u64;
            if least.get(&next).is_none_or(|old| cost < *old) {
                least.insert(next.clone(), cost);
                open.push((Reverse(cost), next));
            }
        }
    }
    None
}

fn steps(grid: &Grid, obstacles: &[Obstacle], now: &[Cell]) -> Vec<Vec<Cell>> {
    let mut all: Vec<Vec<Cell>> = vec![Vec::new()];
    for cell in now {
        let lets_in = |to: Cell, step: Direction| {
            let mut in_it = obstacles.iter().filter(|obstacle| obstacle.cell == to);
            grid.is_path(to) && in_it.all(|obstacle| obstacle.kind == ObstacleKind::Moving(step))
        };
        let beside = |step| cell.next(step).filter(|to| lets_in(*to, step));
        let choice: Vec<Cell> = Direction::ALL.into_iter().filter_map(beside).chain([*cell]).collect();
        let with = |rest: &Vec<Cell>| {
            let free = choice.iter().filter(|to| !rest.contains(to));
            free.map(|to| [&rest[..], &[*to]].concat()).collect::<Vec<_>>()
        };
        all = all.iter().flat_map(with).collect();
    }
    all.retain(|next| is_step(now, next));
    all
}
