use super::*;
use crate::grid::Map;

/// Two cells of path, a wall between, and blanks around; a side is half a metre.
const TEXT: &[u8] = b"     \n .*. \n     \n";

fn found(x_m: f64, y_m: f64, margin_m: f64) -> Option<(u32, u32)> {
    let grid = Map::read(TEXT).unwrap().grid;
    let cell = Placement::new(0.5, margin_m).unwrap().cell(&grid, x_m, y_m)?;
    Some((cell.column, cell.row))
}

#[test]
fn a_place_belongs_to_the_nearest_path_within_the_margin() {
    for (x_m, y_m, margin_m, cell, why) in [
        (0.75, 0.75, 0.0, Some((1, 1)), "in the middle of a path"),
        (0.5, 1.0, 0.0, Some((1, 1)), "its corner"),
        (0.49, 0.75, 0.0, None, "beside it"),
        (0.45, 0.75, 0.05 + 1e-9, Some((1, 1)), "within the margin"),
        (0.45, 0.75, 0.04, None, "beyond it"),
        (1.1, 0.75, 1.0, Some((1, 1)), "in the wall, nearer to the left"),
        (1.4, 0.75, 1.0, Some((3, 1)), "nearer to the right"),
        (1.25, 0.75, 1.0, Some((1, 1)), "half way: the first in the file"),
        (-3.0, 0.75, 3.5, Some((1, 1)), "outside of the map"),
        (0.75, 9.0, 1.0, None, "far outside"),
        (1e300, -1e300, 1e300, None, "further than numbers of cells go"),
        (f64::NAN, 0.75, 1.0, None, "nowhere"),
        (0.75, f64::INFINITY, 1.0, None, "nowhere"),
    ] {
        assert_eq!(found(x_m, y_m, margin_m), cell, "{why}");
    }
}

#[test]
fn the_middle_of_each_path_belongs_to_it_and_the_first_row_is_the_northern_one() {
    let grid = Map::read(b"...\n.*.\n..\n").unwrap().grid;
    let placement = Placement::new(0.2, 0.0).unwrap();
    for (cell, _) in grid.cells().filter(|(cell, _)| grid.is_path(*cell)) {
        let (x_m, y_m) = placement.middle_m(&grid, cell);
        assert_eq!(placement.cell(&grid, x_m, y_m), Some(cell));
    }
    let (x_m, y_m) = placement.middle_m(&grid, Cell { column: 2, row: 0 });
    assert!((x_m - 0.5).abs() < 1e-9 && (y_m - 0.5).abs() < 1e-9, "{x_m} {y_m}");
}

#[test]
fn sizes_that_mean_nothing_are_refused() {
    for (cell_m, margin_m) in
        [(0.0, 1.0), (-1.0, 1.0), (f64::NAN, 1.0), (f64::INFINITY, 1.0), (1.0, -0.1), (1.0, f64::NAN)]
    {
        assert_eq!(Placement::new(cell_m, margin_m), None, "{cell_m} {margin_m}");
    }
}
