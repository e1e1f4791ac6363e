//! What must hold for all ways.

use rohrpost_team::coordination::{Trip, Ways};
use rohrpost_team::grid::{Cell, Direction, Grid, Obstacle, ObstacleKind};

/// Whether robots may go from one moment to the next one: no two in a cell, and no circle that moves at once.
pub(crate) fn is_step(now: &[Cell], next: &[Cell]) -> bool {
    let shares = |(robot, cell): (usize, &Cell)| next[..robot].contains(cell);
    let owner = |cell: &Cell| now.iter().position(|other| other == cell);
    let circles = |robot: usize| {
        let mut at = robot;
        // As many hops as robots lead back, if at all.
        (0..now.len()).any(|_| {
            let Some(other) = owner(&next[at]) else { return false };
            let moves = now[at] != next[at];
            at = other;
            moves && at == robot
        })
    };
    !next.iter().enumerate().any(shares) && !(0..now.len()).any(circles)
}

/// The direction of a step.
pub(crate) fn direction(from: Cell, to: Cell) -> Option<Direction> {
    Direction::ALL.into_iter().find(|step| from.next(*step) == Some(to))
}

pub(crate) fn check(grid: &Grid, obstacles: &[Obstacle], trips: &[Trip], ways: &Ways, what: &str) {
    let moments = ways.moments();
    let ends = |cells: Option<&Vec<Cell>>, end: fn(&Trip) -> Cell| {
        assert_eq!(*cells.unwrap(), trips.iter().map(end).collect::<Vec<_>>(), "{what}");
    };
    ends(moments.first(), |trip| trip.from);
    ends(moments.last(), |trip| trip.to);
    for pair in moments.windows(2) {
        assert!(is_step(&pair[0], &pair[1]), "{what}: {pair:?}");
        for (from, to) in pair[0].iter().zip(&pair[1]).filter(|(from, to)| from != to) {
            let step = direction(*from, *to).unwrap_or_else(|| panic!("{what}: a jump from {from} to {to}"));
            let lets_in = |it: &Obstacle| it.cell != *to || it.kind == ObstacleKind::Moving(step);
            assert!(grid.is_path(*to) && obstacles.iter().all(lets_in), "{what}: {from} to {to}");
        }
    }
}
