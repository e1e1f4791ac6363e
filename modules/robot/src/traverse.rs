//! The cells that a ray crosses, in order and without a gap (Amanatides and Woo, "A Fast Voxel Traversal Algorithm").
//!
//! All lengths are in cells: cell (c, r) covers [c, c+1) × [r, r+1). The world's rays and the map's beams both walk
//! here.

/// A step of the walk: the cell, and how far from the ray's origin it is entered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crossing {
    pub(super) column: i64,
    pub(super) row: i64,
    pub(super) entry: f64,
}

/// Walks on for ever; the caller stops at its range.
pub(super) struct Traversal {
    next: Crossing,
    step: (i64, i64),
    /// Distance along the ray from one column (row) border to the next; infinite along an axis.
    delta: (f64, f64),
    /// Distance along the ray to the next column (row) border.
    border: (f64, f64),
}

impl Traversal {
    /// From a place, in a direction. All finite; the caller has checked.
    pub(super) fn new(column: f64, row: f64, direction_rad: f64) -> Self {
        let (sin, cos) = direction_rad.sin_cos();
        let (column_step, column_delta, column_border) = axis(column, cos);
        let (row_step, row_delta, row_border) = axis(row, sin);
        Self {
            next: Crossing { column: column.floor() as i64, row: row.floor() as i64, entry: 0.0 },
            step: (column_step, row_step),
            delta: (column_delta, row_delta),
            border: (column_border, row_border),
        }
    }
}

impl Iterator for Traversal {
    type Item = Crossing;

    fn next(&mut self) -> Option<Crossing> {
        let here = self.next;
        if self.border.0 < self.border.1 {
            self.next.column += self.step.0;
            self.next.entry = self.border.0;
            self.border.0 += self.delta.0;
        } else {
            self.next.row += self.step.1;
            self.next.entry = self.border.1;
            self.border.1 += self.delta.1;
        }
        Some(here)
    }
}

/// Step, distance between borders and distance to the first one, along one axis.
fn axis(place: f64, slope: f64) -> (i64, f64, f64) {
    let inside = place - place.floor();
    // A sine of π is 1e-16, not 0: dividing by it would overflow nothing, but the walk would drift off its axis.
    if slope.abs() < 1e-12 {
        (0, f64::INFINITY, f64::INFINITY)
    } else if slope > 0.0 {
        (1, 1.0 / slope, (1.0 - inside) / slope)
    } else {
        (-1, -1.0 / slope, inside / -slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    #[test]
    fn along_an_axis_only_that_axis_changes() {
        for (direction_rad, step) in [(0.0, (1, 0)), (PI, (-1, 0)), (0.5 * PI, (0, 1)), (-0.5 * PI, (0, -1))] {
            let fifth = Traversal::new(0.5, 0.5, direction_rad).nth(5).unwrap();
            assert_eq!((fifth.column, fifth.row), (5 * step.0, 5 * step.1));
            assert!((fifth.entry - 4.5).abs() < 1e-9);
        }
    }

    proptest! {
        #[test]
        fn each_cell_touches_the_last_and_holds_the_ray(x in -50.0..50.0, y in -50.0..50.0, direction in -7.0..7.0) {
            let walk: Vec<Crossing> = Traversal::new(x, y, direction).take(200).collect();
            for pair in walk.windows(2) {
                let moved = (pair[1].column - pair[0].column).abs() + (pair[1].row - pair[0].row).abs();
                prop_assert_eq!(moved, 1);
                prop_assert!(pair[1].entry >= pair[0].entry);
                let middle = 0.5 * (pair[0].entry + pair[1].entry);
                let (at_x, at_y) = (x + middle * direction.cos(), y + middle * direction.sin());
                prop_assert!((at_x - pair[0].column as f64 - 0.5).abs() < 0.5 + 1e-6);
                prop_assert!((at_y - pair[0].row as f64 - 0.5).abs() < 0.5 + 1e-6);
            }
        }
    }
}
