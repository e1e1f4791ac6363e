//! The floor of a team, from the map that its robots share: walls as boxes, and the paths between them.

use crate::palette::{self, Rgb};
use crate::scene::{Scene, entity};
use rerun::{Boxes3D, FillMode};
use rohrpost_team::grid::{Grid, Map, Square};
use std::path::Path;

/// Height of a wall, and of the plate of a path, m.
const WALL_M: f32 = 0.3;
const PATH_M: f32 = 0.04;

/// A map in the world: x grows to the right of the file, y upwards, from its lower left corner.
pub(crate) struct Floor {
    walls: Vec<Block>,
    paths: Vec<Block>,
    size_m: [f32; 2],
}

/// A rectangle along the axes.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Block {
    middle_m: [f32; 2],
    half_m: [f32; 2],
}

/// Columns of a row, from the first to before the last, and rows that have the same below it.
#[derive(Clone, Copy)]
struct Run {
    columns: [u32; 2],
    rows: [u32; 2],
}

impl Floor {
    /// Reads a map; `cell_m` is the side of its cells where the map does not say.
    ///
    /// # Errors
    /// Why there is no such floor, in words.
    pub(crate) fn read(path: &Path, cell_m: Option<f64>) -> Result<Self, String> {
        let told = |why: String| format!("{}: {why}", path.display());
        let text = std::fs::read(path).map_err(|error| told(error.to_string()))?;
        let map = Map::read(&text).map_err(|error| told(error.to_string()))?;
        let cell_m = map.cell_m.or(cell_m).filter(|cell_m| (0.001..1000.0).contains(cell_m));
        let cell_m = cell_m.ok_or_else(|| told("its cells have no size; say it in metres: cell-m = 1.0".into()))?;
        Ok(Self::of(&map.grid, cell_m as f32))
    }

    fn of(grid: &Grid, cell_m: f32) -> Self {
        let blocks = |kind| runs(grid, kind).map(|run| run.block(grid.rows(), cell_m)).collect();
        let size_m = [grid.columns(), grid.rows()].map(|cells| cells as f32 * cell_m);
        Self { walls: blocks(Square::Wall), paths: blocks(Square::Path), size_m }
    }

    /// From where all of it is seen, and what is looked at: metres.
    pub(crate) fn eye_m(&self) -> [[f32; 3]; 2] {
        let [width, depth] = self.size_m;
        let away = width.max(1.6 * depth);
        [[width / 2.0, depth / 2.0 - 0.26 * away, 0.66 * away], [width / 2.0, depth * 0.48, 0.0]]
    }
}

impl Run {
    fn block(self, rows: u32, cell_m: f32) -> Block {
        let [left, right] = self.columns.map(|column| column as f32 * cell_m);
        let [top, bottom] = self.rows.map(|row| (rows - row) as f32 * cell_m);
        Block {
            middle_m: [(left + right) / 2.0, (top + bottom) / 2.0],
            half_m: [(right - left) / 2.0, (top - bottom) / 2.0],
        }
    }
}

/// Rectangles that together are all squares of a kind: a row's runs, joined with equal ones below.
fn runs(grid: &Grid, kind: Square) -> impl Iterator<Item = Run> {
    let mut done: Vec<Run> = Vec::new();
    let mut open: Vec<Run> = Vec::new();
    for (row, squares) in (0..).zip(grid.rows_of_squares()) {
        let mut next = Vec::new();
        let mut column = 0;
        for part in squares.chunk_by(|a, b| (*a == kind) == (*b == kind)) {
            let columns = [column, column + part.len() as u32];
            column = columns[1];
            if part.first() == Some(&kind) {
                let above = open.iter().position(|run| run.columns == columns).map(|at| open.swap_remove(at));
                next.push(Run { columns, rows: [above.map_or(row, |above| above.rows[0]), row + 1] });
            }
        }
        done.append(&mut open);
        open = next;
    }
    done.append(&mut open);
    done.into_iter()
}

impl Scene {
    /// Draws a floor, for all times.
    pub(super) fn floor(&mut self, floor: &Floor) {
        for (part, blocks, colour, bottom_m, height_m) in [
            ("walls", &floor.walls, palette::WALL, 0.0, WALL_M),
            ("paths", &floor.paths, palette::PATH, -PATH_M, PATH_M),
        ] {
            self.log_static(entity(&["space", part]), &boxes(blocks, colour, bottom_m, height_m));
        }
    }
}

fn boxes(blocks: &[Block], colour: Rgb, bottom_m: f32, height_m: f32) -> Boxes3D {
    let half_m = height_m / 2.0;
    let middles = blocks.iter().map(|block| [block.middle_m[0], block.middle_m[1], bottom_m + half_m]);
    Boxes3D::from_half_sizes(blocks.iter().map(|block| [block.half_m[0], block.half_m[1], half_m]))
        .with_centers(middles)
        .with_colors([colour])
        .with_fill_mode(FillMode::Solid)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_are_few_boxes_where_the_file_has_them() {
        let map = Map::read(b"rohrpost-map 1\ncell_m 0.5\nmap\n####\n#  #\n# ##\n####\n").unwrap();
        let floor = Floor::of(&map.grid, 0.5);
        let area = |blocks: &[Block]| blocks.iter().map(|block| 4.0 * block.half_m[0] * block.half_m[1]).sum::<f32>();
        assert_eq!((area(&floor.walls), area(&floor.paths)), (13.0 * 0.25, 3.0 * 0.25));
        assert_eq!(floor.walls.len(), 5, "top, left, two on the right, bottom: {:?}", floor.walls);
        assert_eq!(floor.paths[0], Block { middle_m: [1.0, 1.25], half_m: [0.5, 0.25] }, "the upper path");
    }

    #[test]
    fn a_map_without_size_or_that_is_none_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("team.map");
        for (text, why) in [("****\n*..*\n****\n", "cell-m = 1.0"), ("?", "line 1")] {
            std::fs::write(&path, text).unwrap();
            let told = Floor::read(&path, None).err().unwrap();
            assert!(told.contains("team.map") && told.contains(why), "{told}");
        }
        std::fs::write(&path, "****\n*..*\n****\n").unwrap();
        assert!(Floor::read(&path, Some(1.0)).is_ok());
    }
}
