//! Where the intruder of a team's demo comes.

use crate::team::referee::ArenaReferee;
use crate::terminal::Failure;
use rohrpost::interfaces::{ArenaRobot, TeamCell};
use rohrpost_team::grid::{Cell, Direction, Map};

/// Cells between the intruder and the nearest robot, at least.
const APART_CELLS: u32 = 3;

/// Puts an intruder near a robot, but not beside one, where it has two ways at least.
pub(super) fn come(referee: &mut ArenaReferee, map: &str) -> Result<(), Failure> {
    let map = Map::read(map.as_bytes())?;
    let cell = place(&map, &referee.state.robots).ok_or("the map has no room for an intruder")?;
    let Cell { column, row } = cell;
    referee.add_intruder(TeamCell { column, row })
}

fn place(map: &Map, robots: &[ArenaRobot]) -> Option<Cell> {
    let nearest = |cell: Cell| {
        let apart = |it: TeamCell| it.column.abs_diff(cell.column) + it.row.abs_diff(cell.row);
        robots.iter().filter_map(|robot| robot.cell).map(apart).min().unwrap_or(u32::MAX)
    };
    let is_path = |cell: &Cell| map.grid.is_path(*cell);
    let ways = |cell: Cell| Direction::ALL.into_iter().filter_map(|step| cell.next(step)).filter(is_path).count();
    let cells = map.grid.cells().map(|(cell, _)| cell).filter(|cell| is_path(cell) && ways(*cell) >= 2);
    let apart = cells.map(|cell| (nearest(cell), cell));
    // Where robots stand everywhere, as far from them as can be.
    let far: Vec<(u32, Cell)> = apart.collect();
    let enough = far.iter().filter(|(apart, _)| *apart >= APART_CELLS).min();
    enough.or_else(|| far.iter().max()).map(|(_, cell)| *cell)
}
