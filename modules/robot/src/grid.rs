//! A map of free and occupied squares, made from scans with known poses.
//!
//! Each square holds the log-odds of being occupied, in hundredths. A scan counts once for a square, however many of
//! its beams cross it, and a square that one beam hits is not cleared by another beam that grazes it. The map grows in
//! tiles of 128 × 128 squares, one package each, as they are first touched.

mod dump;
mod tile;

pub use tile::{TILE_CELLS, TileIndex};

use super::traverse::Traversal;
use rohrpost_modules::types::{LaserScan, OccupancyGrid, Pose};
use std::collections::BTreeMap;
use thiserror::Error;
use tile::{Tile, TileChange};

/// Log-odds of one scan and of a square, in hundredths: how sure a scan is, and how sure a square may become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Side of a square.
    pub resolution_m: f64,
    /// A beam with no return clears up to here: beyond, absorbed light looks the same as open space.
    pub clear_max_m: f64,
    /// A hit further away is not believed: the beam clears like one with no return.
    pub hit_max_m: f64,
    /// Tiles at most; a tile takes 64 kB. What lies outside them is counted as refused.
    pub tiles_max: usize,
    /// Added by a hit.
    pub hit: i16,
    /// Taken off by a beam that passes.
    pub miss: i16,
    /// Bound on both sides; a door that opens is learnt within `2 * bound / miss` scans.
    pub bound: i16,
}

impl Default for Settings {
    fn default() -> Self {
        Self { resolution_m: 0.05, clear_max_m: 8.0, hit_max_m: 40.0, tiles_max: 1024, hit: 85, miss: 40, bound: 400 }
    }
}

/// Why a scan did not go into the map.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum IntegrateError {
    /// A pose or a beam's direction that is no number, or a place beyond 100 km.
    #[error("the scanner's pose is no place on the map")]
    Pose,
}

/// What is known of the squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rather free.
    pub free: u64,
    /// Rather occupied.
    pub occupied: u64,
    /// Seen at all: free, occupied, or just as likely.
    pub known: u64,
    /// Squares that could not be noted, for want of tiles. One square may be refused often.
    pub refused: u64,
}

/// The map.
///
/// ```
/// use rohrpost_modules::types::{LaserScan, Pose};
/// use rohrpost_robot::grid::{Mapper, Settings};
/// let mut map = Mapper::new(Settings::default());
/// let scan = LaserScan { range_max_m: 8.0, ranges_m: vec![1.0], ..LaserScan::default() };
/// map.integrate(&scan, &Pose::default()).unwrap();
/// assert_eq!(map.occupancy(1.01, 0.01), Some(70)); // percent, after one hit
/// assert!(map.occupancy(0.5, 0.01).unwrap() < 50 && map.occupancy(2.0, 0.01).is_none());
/// let changed = map.take_changed();
/// let grid = map.tile(changed[0]).unwrap();
/// assert_eq!(grid.cells.len(), 128 * 128);
/// ```
#[derive(Clone, Debug)]
pub struct Mapper {
    settings: Settings,
    places: BTreeMap<TileIndex, usize>,
    tiles: Vec<Tile>,
    counts: Counts,
    /// Number of the scan, from 1, wrapping; squares remember the last one that touched them.
    scan: u16,
}

/// Where the walk is: neighbouring squares are mostly in the same tile, and asking the tree for each would cost more
/// than all else.
struct Cursor {
    index: TileIndex,
    place: Option<usize>,
}

impl Mapper {
    /// An empty map.
    ///
    /// # Panics
    /// If a length in the settings is not a positive number: beams would never end.
    pub fn new(settings: Settings) -> Self {
        for length_m in [settings.resolution_m, settings.clear_max_m, settings.hit_max_m] {
            assert!(length_m.is_finite() && length_m > 0.0, "a map with a length of {length_m} m in its settings");
        }
        Self { settings, places: BTreeMap::new(), tiles: Vec::new(), counts: Counts::default(), scan: 0 }
    }

    /// Adds what was seen from this pose of the scanner (not of the robot: mind the mounting).
    pub fn integrate(&mut self, scan: &LaserScan, sensor: &Pose) -> Result<(), IntegrateError> {
        let on_map = |place_m: f64| place_m.is_finite() && place_m.abs() < 1e5;
        let directions_ok = scan.start_rad.is_finite() && scan.step_rad.is_finite() && sensor.heading_rad.is_finite();
        if !(on_map(sensor.x_m) && on_map(sensor.y_m) && directions_ok) {
            return Err(IntegrateError::Pose);
        }
        // 0 marks squares that no scan has touched. A square last touched 65535 scans ago is left out once: harmless.
        self.scan = self.scan.checked_add(1).unwrap_or(1);
        let mut cursor = self.cursor(TileIndex { column: 0, row: 0 });
        self.mark_hits(scan, sensor, &mut cursor);
        self.clear_ways(scan, sensor, &mut cursor);
        Ok(())
    }

    /// What is known of the square at a place: percent occupied; none if it was never seen.
    pub fn occupancy(&self, x_m: f64, y_m: f64) -> Option<u8> {
        let (column, row) = (self.cells(x_m).floor() as i64, self.cells(y_m).floor() as i64);
        let place = self.places.get(&TileIndex::of(column, row)?)?;
        self.tiles[*place].percent(column, row)
    }

    /// The tiles that changed since this was last asked, in the order they came to be.
    pub fn take_changed(&mut self) -> Vec<TileIndex> {
        self.tiles.iter_mut().filter_map(Tile::take_changed).collect()
    }

    /// All tiles, from south-west to north-east by columns.
    pub fn tiles(&self) -> impl Iterator<Item = TileIndex> + '_ {
        self.places.keys().copied()
    }

    /// One tile as a package's data.
    pub fn tile(&self, index: TileIndex) -> Option<OccupancyGrid> {
        self.places.get(&index).map(|place| self.tiles[*place].grid(self.settings.resolution_m))
    }

    /// What is known.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    fn cells(&self, length_m: f64) -> f64 {
        length_m / self.settings.resolution_m
    }

    /// The squares where beams end.
    fn mark_hits(&mut self, scan: &LaserScan, sensor: &Pose, cursor: &mut Cursor) {
        let hit_max_m = self.settings.hit_max_m;
        for (angle_rad, range_m) in scan.hits().filter(|(_, range_m)| *range_m <= hit_max_m) {
            let (sin, cos) = (sensor.heading_rad + angle_rad).sin_cos();
            let column = self.cells(sensor.x_m + range_m * cos).floor() as i64;
            let row = self.cells(sensor.y_m + range_m * sin).floor() as i64;
            self.update(column, row, self.settings.hit, cursor);
        }
    }

    /// The squares that beams cross before they end.
    fn clear_ways(&mut self, scan: &LaserScan, sensor: &Pose, cursor: &mut Cursor) {
        let (x, y) = (self.cells(sensor.x_m), self.cells(sensor.y_m));
        for (beam, range_m) in scan.ranges_m.iter().enumerate() {
            if range_m.is_nan() || *range_m <= 0.0 {
                continue;
            }
            let returned = *range_m < scan.range_max_m && f64::from(*range_m) <= self.settings.hit_max_m;
            // A range limit below the clearing limit: nothing is known beyond it.
            let open_m = self.settings.clear_max_m.min(f64::from(scan.range_max_m));
            let way = self.cells(if returned { f64::from(*range_m) } else { open_m });
            let direction_rad = sensor.heading_rad + scan.angle_rad(beam);
            for crossing in Traversal::new(x, y, direction_rad).take_while(|crossing| crossing.entry < way) {
                self.update(crossing.column, crossing.row, -self.settings.miss, cursor);
            }
        }
    }

    fn cursor(&self, index: TileIndex) -> Cursor {
        Cursor { index, place: self.places.get(&index).copied() }
    }

    fn update(&mut self, column: i64, row: i64, odds: i16, cursor: &mut Cursor) {
        let Some(index) = TileIndex::of(column, row) else { return self.counts.refused += 1 };
        if index != cursor.index {
            *cursor = self.cursor(index);
        }
        let Some(place) = cursor.place.or_else(|| self.grow(index)) else { return self.counts.refused += 1 };
        cursor.place = Some(place);
        match self.tiles[place].update(column, row, odds, self.settings.bound, self.scan) {
            None => {}
            Some(TileChange { before, after }) => self.counts.recount(before, after),
        }
    }

    fn grow(&mut self, index: TileIndex) -> Option<usize> {
        if self.tiles.len() >= self.settings.tiles_max {
            return None;
        }
        self.tiles.push(Tile::new(index));
        self.places.insert(index, self.tiles.len() - 1);
        Some(self.tiles.len() - 1)
    }
}

impl Counts {
    fn recount(&mut self, before: Option<i16>, after: i16) {
        match before {
            None => self.known += 1,
            Some(odds) if odds < 0 => self.free -= 1,
            Some(odds) => self.occupied -= u64::from(odds > 0),
        }
        self.free += u64::from(after < 0);
        self.occupied += u64::from(after > 0);
    }
}

#[cfg(test)]
mod tests;
