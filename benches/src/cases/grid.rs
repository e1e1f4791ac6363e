//! Grids of teams: a wave over all cells of a map, beside a breadth-first search in C++.

use crate::floors::WaveFloor;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, OrFail, Scratch, sample_in_child};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_team::grid::{Cell, Grid, Square, Wave};
use std::cell::LazyCell;
use std::time::{Duration, Instant};

/// Columns and rows.
const SIDE: u32 = 1024;
/// Waves of a turn.
const WAVES: usize = 20;
const START: Cell = Cell { column: SIDE / 2, row: SIDE / 2 };
const PATIENCE: Duration = Duration::from_secs(60);

/// All cases, in the order in which they are measured.
pub fn all() -> Vec<Case> {
    vec![
        case("wave, empty", |_| false),
        case("wave, 20 % walls", is_one_of_five),
        case("wave, rooms", is_between_rooms),
    ]
}

/// Cells in no order, equal in each run.
fn is_one_of_five(cell: Cell) -> bool {
    let mixed = u64::from(cell.row * SIDE + cell.column).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed ^ mixed >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 32 < (1 << 32) / 5
}

/// Walls around rooms of 31 x 31 cells, with a door in the middle of each.
fn is_between_rooms(cell: Cell) -> bool {
    let (column, row) = (cell.column % 32, cell.row % 32);
    (column == 0 && row != 16) || (row == 0 && column != 16)
}

fn case(name: &str, is_wall: fn(Cell) -> bool) -> Case {
    Case::new(name, None, "us", move |settings, subject| {
        let ground = Ground::new(is_wall)?;
        let waves = if settings.quick { 2 } else { WAVES };
        let floor = LazyCell::new(WaveFloor::compile);
        let contenders = [
            Contender::sampled("rohrpost", || ground.spread(waves)),
            Contender::sampled("C++", || ground.spread_floor(floor.as_ref().map_err(Clone::clone)?, waves))
                .beside(at_most(1.3), None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

/// A grid, here and in a file.
struct Ground {
    grid: Grid,
    scratch: Scratch,
    /// Of all distances from the start.
    sum: u64,
}

impl Ground {
    fn new(is_wall: fn(Cell) -> bool) -> Result<Self, Failure> {
        let cells = (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| Cell { column, row }));
        let square = |cell| if cell != START && is_wall(cell) { Square::Wall } else { Square::Path };
        let grid = Grid::new(SIDE, cells.map(square).collect());
        let grid = grid.ok_or_else(|| Failure::Failed("the grid is not whole".into()))?;
        let scratch = Scratch::new()?;
        let squares = grid.cells().map(|(_, square)| u8::from(square == Square::Path));
        let file: Vec<u8> = [SIDE, SIDE].into_iter().flat_map(u32::to_ne_bytes).chain(squares).collect();
        std::fs::write(scratch.directory().join("grid"), file).or_fail("the grid's file")?;
        let mut wave = Wave::default();
        wave.start(&grid, START, [], []);
        wave.next_goal();
        let sum = grid.cells().filter_map(|(cell, _)| wave.distance(cell)).map(u64::from).sum();
        Ok(Self { grid, scratch, sum })
    }

    /// Time of each wave, us.
    fn spread(&self, waves: usize) -> Result<Vec<f64>, Failure> {
        sample_in_child(PATIENCE, |samples| {
            let mut wave = Wave::default();
            for _ in 0..waves {
                let began = Instant::now();
                wave.start(&self.grid, START, [], []);
                wave.next_goal();
                samples.push(began.elapsed().as_secs_f64() * 1e6);
            }
            Ok(())
        })
    }

    /// As [`Self::spread`], in C++.
    fn spread_floor(&self, floor: &WaveFloor, waves: usize) -> Result<Vec<f64>, Failure> {
        let start = START.row * SIDE + START.column;
        match floor.spread(&self.scratch.directory().join("grid"), start, waves)? {
            (sum, times) if sum == self.sum => Ok(times),
            (sum, _) => Err(Failure::Failed(format!("distances of {sum} steps in all; ours are {}", self.sum))),
        }
    }
}
