//! Maps drawn by chance: corridors, rooms and rings, each in one piece.

use rohrpost_team::grid::{Cell, Direction};
use rohrpost_testbed::sim::chance::Chance;
use std::collections::BTreeSet;
use std::fmt::Write;

/// A map's rows; true: a path.
struct Floor {
    columns: usize,
    rows: usize,
    paths: Vec<bool>,
}

impl Floor {
    fn new(columns: usize, rows: usize) -> Self {
        Self { columns, rows, paths: vec![false; columns * rows] }
    }

    fn is_inside(&self, column: usize, row: usize) -> bool {
        (1..self.columns - 1).contains(&column) && (1..self.rows - 1).contains(&row)
    }

    fn set(&mut self, column: usize, row: usize, is_path: bool) {
        if self.is_inside(column, row) {
            self.paths[row * self.columns + column] = is_path;
        }
    }

    fn is_path(&self, cell: Cell) -> bool {
        let (column, row) = (cell.column as usize, cell.row as usize);
        column < self.columns && row < self.rows && self.paths[row * self.columns + column]
    }

    /// The largest piece, by the order of rows.
    fn largest_piece(&self) -> BTreeSet<(u32, u32)> {
        let mut seen = BTreeSet::new();
        let mut best = BTreeSet::new();
        let cells = (0..self.rows as u32).flat_map(|row| (0..self.columns as u32).map(move |column| (row, column)));
        for (row, column) in cells {
            let mut piece = BTreeSet::new();
            let mut todo = vec![Cell { column, row }];
            while let Some(cell) = todo.pop() {
                if self.is_path(cell) && seen.insert((cell.row, cell.column)) {
                    piece.insert((cell.row, cell.column));
                    todo.extend(Direction::ALL.into_iter().filter_map(|step| cell.next(step)));
                }
            }
            if piece.len() > best.len() {
                best = piece;
            }
        }
        best
    }
}

/// Side of the largest maps of a usual draw, in pairs of cells.
pub const USUAL: u64 = 9;

/// A map of our own format, with cells of 1 m, and `most` pairs of cells wide at most.
pub fn draw(chance: &mut Chance, most: u64) -> String {
    let (columns, rows) = (chance.between(most / 2, most), chance.between(most / 3, most - 2));
    let (columns, rows) = (columns as usize * 2 + 1, rows as usize * 2 + 1);
    let mut floor = Floor::new(columns, rows);
    match chance.below(3) {
        0 => corridors(&mut floor, chance),
        1 => rooms(&mut floor, chance),
        _ => rings(&mut floor, chance),
    }
    let piece = floor.largest_piece();
    let mut text = String::from("rohrpost-map 1\ncell_m 1\nmap\n");
    for row in 0..rows as u32 {
        let squares: String =
            (0..columns as u32).map(|column| if piece.contains(&(row, column)) { '.' } else { '#' }).collect();
        let _ = writeln!(text, "{squares}");
    }
    text
}

/// One-cell ways between odd cells: a tree, and some loops.
fn corridors(floor: &mut Floor, chance: &mut Chance) {
    let mut way = vec![(1_usize, 1_usize)];
    floor.set(1, 1, true);
    while let Some(&(column, row)) = way.last() {
        let ahead = [(0_isize, -2_isize), (2, 0), (0, 2), (-2, 0)].into_iter().filter_map(|(east, south)| {
            let to = (column.checked_add_signed(east)?, row.checked_add_signed(south)?);
            let is_new = floor.is_inside(to.0, to.1) && !floor.paths[to.1 * floor.columns + to.0];
            is_new.then_some(to)
        });
        let ahead: Vec<(usize, usize)> = ahead.collect();
        if ahead.is_empty() {
            way.pop();
            continue;
        }
        let to = chance.pick(&ahead);
        floor.set((column + to.0) / 2, (row + to.1) / 2, true);
        floor.set(to.0, to.1, true);
        way.push(to);
    }
    for _ in 0..floor.columns {
        let (column, row) = (chance.below(floor.columns as u64) as usize, chance.below(floor.rows as u64) as usize);
        if (column + row) % 2 == 1 {
            floor.set(column, row, true);
        }
    }
}

/// An open floor, with walls across that have doors, and some posts.
fn rooms(floor: &mut Floor, chance: &mut Chance) {
    for row in 0..floor.rows {
        (0..floor.columns).for_each(|column| floor.set(column, row, true));
    }
    let across = chance.between(3, floor.columns as u64 - 4) as usize;
    let door = chance.between(1, floor.rows as u64 - 2) as usize;
    (0..floor.rows).filter(|row| *row != door).for_each(|row| floor.set(across, row, false));
    for _ in 0..chance.below(6) {
        let (column, row) = (chance.below(floor.columns as u64) as usize, chance.below(floor.rows as u64) as usize);
        floor.set(column, row, false);
    }
    floor.set(across, door, true);
}

/// A ring around the bounds, one within it, and ways between.
fn rings(floor: &mut Floor, chance: &mut Chance) {
    for inset in [1, 3] {
        let (right, bottom) = (floor.columns - 1 - inset, floor.rows - 1 - inset);
        if inset > right || inset > bottom {
            continue;
        }
        for column in inset..=right {
            floor.set(column, inset, true);
            floor.set(column, bottom, true);
        }
        for row in inset..=bottom {
            floor.set(inset, row, true);
            floor.set(right, row, true);
        }
    }
    for _ in 0..chance.between(1, 4) {
        let row = if chance.percent(50) { 2 } else { floor.rows - 3 };
        floor.set(chance.between(3, floor.columns as u64 - 4) as usize, row, true);
    }
}
