//! The floor on which a team drives: a map, with the size of its cells.

use rohrpost_robot::world::{World, WorldError};
use rohrpost_team::coordination::Planner;
use rohrpost_team::grid::{Cell, Grid, Map, MapError, Placement};
use rohrpost_team::view::map_digest;
use rohrpost_team::{Position, group};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Why a text is no floor for a team.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoGround {
    /// The text is no map.
    #[error(transparent)]
    Map(#[from] MapError),
    /// The size of a cell is none.
    #[error(transparent)]
    Cells(#[from] WorldError),
    /// Neither the map nor the caller says how large a cell is.
    #[error("how large a cell is, the map does not say; give the side of a cell in metres")]
    NoSize,
    /// Nothing to drive on.
    #[error("the map has no path, so nobody can drive there; mark paths")]
    NoPath,
}

/// A map as robots know it; the same for all robots of a team.
#[derive(Clone, Debug)]
pub struct Ground {
    pub(crate) grid: Grid,
    pub(crate) world: World,
    pub(crate) placement: Placement,
    pub(crate) digest: u64,
    /// Of all robots that share this floor.
    planner: Arc<Mutex<Planner>>,
    cell_m: f64,
}

impl Ground {
    /// Reads a map. `cell_m` is needed where the format does not say how large a cell is. A robot further than
    /// `margin_m` from all paths is in no cell.
    ///
    /// # Errors
    /// The text is no map, has no path, or a size is missing.
    pub fn read(text: &[u8], cell_m: Option<f64>, margin_m: f64) -> Result<Self, NoGround> {
        let map = Map::read(text)?;
        let cell_m = map.cell_m.or(cell_m).ok_or(NoGround::NoSize)?;
        let first = map.grid.cells().map(|(cell, _)| cell).find(|cell| map.grid.is_path(*cell));
        let world = World::with_walls(&map, cell_m, first.ok_or(NoGround::NoPath)?, None)?;
        let placement = Placement::new(cell_m, margin_m).ok_or(WorldError::CellSize(margin_m))?;
        let planner = Arc::new(Mutex::new(Planner::new(map.grid.clone())));
        Ok(Self { planner, grid: map.grid, world, placement, digest: map_digest(text), cell_m })
    }

    /// What plans on this floor. A plan that panicked was not kept.
    pub(crate) fn planner(&self) -> MutexGuard<'_, Planner> {
        self.planner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Walls and paths.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Walls alone, as a scanner sees them.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Side of a cell, metres.
    pub fn cell_m(&self) -> f64 {
        self.cell_m
    }

    /// Digest of the map, as teams tell it.
    pub fn digest(&self) -> u64 {
        self.digest
    }

    /// The middle of a cell: x and y, metres.
    pub fn middle_m(&self, cell: Cell) -> (f64, f64) {
        self.placement.middle_m(&self.grid, cell)
    }

    /// The cell of a place that a teammate has told.
    pub fn cell_at(&self, Position { x_mm, y_mm }: Position) -> Option<Cell> {
        self.placement.cell(&self.grid, f64::from(x_mm) / 1000.0, f64::from(y_mm) / 1000.0)
    }
}

/// A place in whole millimetres; `None` beyond what they can say.
pub(crate) fn position(x_m: f64, y_m: f64) -> Option<Position> {
    let mm = |metres: f64| {
        let mm = (metres * 1000.0).round();
        (mm.abs() <= f64::from(i32::MAX)).then_some(mm as i32)
    };
    Some(Position { x_mm: mm(x_m)?, y_mm: mm(y_m)? })
}

/// A pose as hellos tell it.
pub(crate) fn told(pose: rohrpost_modules::types::Pose, speed_m_s: f64) -> Option<group::Pose> {
    let turned_rad = pose.heading_rad.sin().atan2(pose.heading_rad.cos());
    // A cast of what is not finite is 0 or the limit.
    Some(group::Pose {
        position: position(pose.x_m, pose.y_m)?,
        heading_mrad: (turned_rad * 1000.0).round() as i16,
        speed_mm_s: (speed_m_s * 1000.0).round() as i16,
    })
}
