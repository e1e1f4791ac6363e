//! One tile of the map: 128 × 128 squares.

use rohrpost_modules::types::{Cell, OccupancyGrid, Pose};

/// Squares along each side of a tile.
pub const TILE_CELLS: u32 = 128;
const SIDE: i64 = TILE_CELLS as i64;
const CELLS: usize = (TILE_CELLS * TILE_CELLS) as usize;

/// Log-odds of a square that was never seen: no sum of scans reaches it.
const UNSEEN: i16 = i16::MIN;

/// Which tile: tile (0, 0) has its outer corner at the origin of the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileIndex {
    /// Along x.
    pub column: i32,
    /// Along y.
    pub row: i32,
}

impl TileIndex {
    /// The tile of a square; none beyond all maps.
    pub(super) fn of(column: i64, row: i64) -> Option<Self> {
        let column = i32::try_from(column.div_euclid(SIDE)).ok()?;
        Some(Self { column, row: i32::try_from(row.div_euclid(SIDE)).ok()? })
    }
}

/// What an update did to a square's log-odds.
pub(super) struct TileChange {
    /// None: seen for the first time.
    pub(super) before: Option<i16>,
    pub(super) after: i16,
}

#[derive(Clone, Debug)]
pub(super) struct Tile {
    index: TileIndex,
    odds: Vec<i16>,
    /// The last scan that touched each square.
    touched: Vec<u16>,
    changed: bool,
}

impl Tile {
    pub(super) fn new(index: TileIndex) -> Self {
        Self { index, odds: vec![UNSEEN; CELLS], touched: vec![0; CELLS], changed: false }
    }

    /// Adds to a square's log-odds, unless this scan did so before.
    pub(super) fn update(&mut self, column: i64, row: i64, odds: i16, bound: i16, scan: u16) -> Option<TileChange> {
        let cell = cell(column, row);
        if self.touched[cell] == scan {
            return None;
        }
        self.touched[cell] = scan;
        let before = (self.odds[cell] != UNSEEN).then_some(self.odds[cell]);
        // Never UNSEEN: `max` guards against a bound of i16::MIN, which no sane setting has.
        let after = before.unwrap_or(0).saturating_add(odds).min(bound).max(bound.saturating_neg()).max(UNSEEN + 1);
        if before == Some(after) {
            return None;
        }
        self.odds[cell] = after;
        self.changed = true;
        Some(TileChange { before, after })
    }

    pub(super) fn percent(&self, column: i64, row: i64) -> Option<u8> {
        percent(self.odds[cell(column, row)])
    }

    pub(super) fn take_changed(&mut self) -> Option<TileIndex> {
        std::mem::take(&mut self.changed).then_some(self.index)
    }

    pub(super) fn grid(&self, resolution_m: f64) -> OccupancyGrid {
        let corner_m = |tile: i32| f64::from(tile) * f64::from(TILE_CELLS) * resolution_m;
        OccupancyGrid {
            origin: Pose { x_m: corner_m(self.index.column), y_m: corner_m(self.index.row), heading_rad: 0.0 },
            resolution_m: resolution_m as f32,
            columns: TILE_CELLS,
            rows: TILE_CELLS,
            cells: self.odds.iter().map(|odds| percent(*odds).map_or(Cell::UNKNOWN.0, |percent| percent)).collect(),
        }
    }
}

fn cell(column: i64, row: i64) -> usize {
    (row.rem_euclid(SIDE) * SIDE + column.rem_euclid(SIDE)) as usize
}

/// Hundredths of log-odds as percent of probability.
fn percent(odds: i16) -> Option<u8> {
    (odds != UNSEEN).then(|| (100.0 / (1.0 + (-f64::from(odds) / 100.0).exp())).round() as u8)
}
