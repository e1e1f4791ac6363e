//! Places in the world, and the cells that they belong to.

use super::cell::Cell;
use super::squares::Grid;

/// How a grid lies in the world: x grows to the east, y to the north, and (0, 0) is the outer corner of the lower left
/// cell, as in the simulated world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    cell_m: f64,
    margin_m: f64,
}

impl Placement {
    /// Cells with sides of `cell_m`, and how far from its path a robot may be, m. `None` if a cell has no size, or the
    /// margin is negative, or either is not finite.
    pub fn new(cell_m: f64, margin_m: f64) -> Option<Self> {
        let valid = cell_m.is_finite() && cell_m > 0.0 && margin_m.is_finite() && margin_m >= 0.0;
        valid.then_some(Self { cell_m, margin_m })
    }

    /// The path nearest to a place, m. `None` if none is within the margin: a robot there is lost. Of several as near,
    /// the one with the nearer middle, then the first in the file.
    pub fn cell(&self, grid: &Grid, x_m: f64, y_m: f64) -> Option<Cell> {
        // In cells, from the upper left.
        let (x, y) = (x_m / self.cell_m, f64::from(grid.rows()) - y_m / self.cell_m);
        if !(x.is_finite() && y.is_finite()) {
            return None;
        }
        let margin = self.margin_m / self.cell_m;
        // A cell that only touches the margin is within it. A cast saturates.
        let within = |place: f64, cells: u32| {
            let first = (place - margin).ceil() as i64 - 1;
            let last = ((place + margin).floor() as i64).min(i64::from(cells) - 1);
            (first.max(0)..=last).map(|cell| cell as u32)
        };
        let columns = within(x, grid.columns());
        let cells = within(y, grid.rows()).flat_map(|row| columns.clone().map(move |column| Cell { column, row }));
        let near = cells.filter(|cell| grid.is_path(*cell)).filter_map(|cell| {
            let off = |place: f64, cell: u32| place - place.clamp(f64::from(cell), f64::from(cell) + 1.0);
            let off_middle = |place: f64, cell: u32| place - f64::from(cell) - 0.5;
            let distance = off(x, cell.column).hypot(off(y, cell.row));
            let to_middle = off_middle(x, cell.column).hypot(off_middle(y, cell.row));
            (distance <= margin).then_some((distance, to_middle, cell))
        });
        let nearer = |a: &(f64, f64, Cell), b: &(f64, f64, Cell)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
        near.min_by(nearer).map(|(_, _, cell)| cell)
    }

    /// The middle of a cell: x and y, m.
    pub fn middle_m(&self, grid: &Grid, cell: Cell) -> (f64, f64) {
        let x = f64::from(cell.column) + 0.5;
        let y = f64::from(grid.rows()) - f64::from(cell.row) - 0.5;
        (x * self.cell_m, y * self.cell_m)
    }
}

#[cfg(test)]
#[path = "placement_tests.rs"]
mod tests;
