//! A search that is obviously right, and slow: labels fall until none falls any more, as seed 000, 2.4.2 says it.

use rohrpost_team::grid::{Cell, Direction, Grid, Obstacle, ObstacleKind};
use std::collections::BTreeMap;

/// Steps to each cell that has any.
pub(crate) type Labels = BTreeMap<Cell, u32>;

/// The cell behind a step, if a robot may go there: table 3.1.
pub(crate) fn entered(grid: &Grid, obstacles: &[Obstacle], from: Cell, step: Direction) -> Option<Cell> {
    let to = from.next(step).filter(|to| grid.is_path(*to))?;
    let in_it = obstacles.iter().filter(|obstacle| obstacle.cell == to);
    in_it.into_iter().all(|obstacle| obstacle.kind == ObstacleKind::Moving(step)).then_some(to)
}

/// From a start to every cell.
pub(crate) fn distances(grid: &Grid, obstacles: &[Obstacle], start: Cell) -> Labels {
    let edge = |cell, step| Some((cell, entered(grid, obstacles, cell, step)?));
    settled(grid, [start], edge)
}

/// From every cell to the nearest goal.
pub(crate) fn to_goals(grid: &Grid, obstacles: &[Obstacle], goals: &[Cell]) -> Labels {
    let edge = |cell, step| Some((entered(grid, obstacles, cell, step)?, cell));
    settled(grid, goals.iter().copied(), edge)
}

fn settled(
    grid: &Grid,
    starts: impl IntoIterator<Item = Cell>,
    edge: impl Fn(Cell, Direction) -> Option<(Cell, Cell)>,
) -> Labels {
    let mut labels: Labels = starts.into_iter().filter(|start| grid.is_path(*start)).map(|start| (start, 0)).collect();
    let cells: Vec<Cell> = grid.cells().map(|(cell, _)| cell).filter(|cell| grid.is_path(*cell)).collect();
    let edges: Vec<_> = cells.iter().flat_map(|cell| Direction::ALL.map(|step| edge(*cell, step))).flatten().collect();
    loop {
        let mut falls = false;
        for (from, to) in &edges {
            let Some(label) = labels.get(from).map(|label| label + 1) else { continue };
            if labels.get(to).is_none_or(|old| label < *old) {
                labels.insert(*to, label);
                falls = true;
            }
        }
        if !falls {
            return labels;
        }
    }
}

/// Step by step the first direction that leads nearer to a goal.
pub(crate) fn path(grid: &Grid, obstacles: &[Obstacle], start: Cell, goals: &[Cell]) -> Option<Vec<Cell>> {
    let labels = to_goals(grid, obstacles, goals);
    let mut path = vec![start];
    let (mut here, mut left) = (start, *labels.get(&start)?);
    while left > 0 {
        left -= 1;
        let nexts = Direction::ALL.into_iter().filter_map(|step| entered(grid, obstacles, here, step));
        here = nexts.into_iter().find(|next| labels.get(next) == Some(&left)).expect("a label comes from a neighbour");
        path.push(here);
    }
    Some(path)
}
