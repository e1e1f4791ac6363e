//! The map of a station, as its settings name it.

use crate::team::station::link::StationLink;
use crate::terminal::Failure;
use rohrpost_team::grid::{Cell, Direction, Grid, Map, Placement, Square};
use serde::Deserialize;

/// What the station's settings say of its map; the rest is its own.
#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
struct MapSettings {
    map: String,
    cell_m: Option<f64>,
}

pub(super) struct StationGround {
    grid: Grid,
    placement: Placement,
}

impl StationGround {
    pub(super) fn read(link: &StationLink) -> Result<Self, Failure> {
        let installation = &link.running.installation;
        let module = installation.module(link.module).ok_or("the configuration has no such station")?;
        let settings: MapSettings = installation.document().settings_without_saved(module)?;
        let file = installation.resolve(&settings.map);
        let at = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
        let map = Map::read(&std::fs::read(&file).map_err(|error| at(&error))?).map_err(|error| at(&error))?;
        let cell_m = map.cell_m.or(settings.cell_m).ok_or_else(|| at(&"it does not say how large a cell is"))?;
        // Whatever is somewhere in a cell is drawn there.
        let placement = Placement::new(cell_m, cell_m / 2.0).ok_or_else(|| at(&"a cell has no size"))?;
        Ok(Self { grid: map.grid, placement })
    }

    pub(super) fn grid(&self) -> &Grid {
        &self.grid
    }

    pub(super) fn cell(&self, x_m: f64, y_m: f64) -> Option<Cell> {
        self.placement.cell(&self.grid, x_m, y_m)
    }

    pub(super) fn middle_m(&self, cell: Cell) -> (f64, f64) {
        self.placement.middle_m(&self.grid, cell)
    }

    pub(super) fn first_path(&self) -> Cell {
        let mut paths = self.grid.cells().filter(|(_, square)| *square == Square::Path);
        paths.next().map_or(Cell { column: 0, row: 0 }, |(cell, _)| cell)
    }

    /// The cell beside one, or itself at the rim.
    pub(super) fn beside(&self, cell: Cell, direction: Direction) -> Cell {
        let Cell { column, row } = cell;
        let last = (self.grid.columns() - 1, self.grid.rows() - 1);
        match direction {
            Direction::North => Cell { row: row.saturating_sub(1), ..cell },
            Direction::South => Cell { row: (row + 1).min(last.1), ..cell },
            Direction::West => Cell { column: column.saturating_sub(1), ..cell },
            Direction::East => Cell { column: (column + 1).min(last.0), ..cell },
        }
    }
}
