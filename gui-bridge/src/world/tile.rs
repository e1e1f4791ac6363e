//! A tile of a map: whether it can be true, what of it is known, and its colours.

use crate::error::DrawError;
use crate::palette;
use rerun::components::ImageFormat;
use rerun::{AnnotationContext, AnnotationInfo, ChannelDatatype, ColorModel, Rgba32};
use rohrpost::types::{Cell, OccupancyGrid, Pose};

/// Cells of a tile: what a graphics card takes as one texture.
pub const MAP_CELLS_MAX: usize = 4096 * 4096;
/// The byte of a cell never seen.
const UNKNOWN: u8 = Cell::UNKNOWN.0;
/// Cells along one side, for the same reason.
const SIDE_MAX: u32 = 8192;

/// What is known of a tile: the least rectangle around it.
pub(crate) struct Known {
    pub(crate) origin: Pose,
    pub(crate) columns: u32,
    pub(crate) rows: u32,
    pub(crate) cells: Vec<u8>,
    resolution_m: f32,
}

impl Known {
    /// Its four corners in the world.
    pub(crate) fn corners(&self) -> [[f32; 2]; 4] {
        let (width, height) = (self.columns as f32 * self.resolution_m, self.rows as f32 * self.resolution_m);
        [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]].map(|corner| moved(&self.origin, corner))
    }
}

/// Believes nothing that came over the wire. The answer is the tile's place, counted in its own cells.
pub(crate) fn check(module: &str, grid: &OccupancyGrid) -> Result<(i64, i64), DrawError> {
    let (columns, rows) = (grid.columns, grid.rows);
    let announced = u64::from(columns) * u64::from(rows);
    let bounded = announced <= MAP_CELLS_MAX as u64 && columns <= SIDE_MAX && rows <= SIDE_MAX;
    if !bounded || announced != grid.cells.len() as u64 {
        return Err(DrawError::Shape { module: module.into(), columns, rows, cells: grid.cells.len() });
    }
    let (origin, resolution) = (&grid.origin, f64::from(grid.resolution_m));
    let finite = [origin.x_m, origin.y_m, origin.heading_rad, resolution].iter().all(|part| part.is_finite());
    if !finite || resolution <= 0.0 {
        return Err(DrawError::Place(module.into()));
    }
    Ok(((origin.x_m / resolution).round() as i64, (origin.y_m / resolution).round() as i64))
}

/// Cuts away the unknown squares around the known ones. Without it a view would make room for them.
pub(crate) fn known(grid: &OccupancyGrid) -> Option<Known> {
    let columns = grid.columns as usize;
    let seen = |cell: &u8| *cell != UNKNOWN;
    let lines: Vec<&[u8]> = grid.cells.chunks_exact(columns.max(1)).collect();
    let first = lines.iter().position(|line| line.iter().any(seen))?;
    let last = lines.iter().rposition(|line| line.iter().any(seen))?;
    let left = lines.iter().filter_map(|line| line.iter().position(seen)).min()?;
    let right = lines.iter().filter_map(|line| line.iter().rposition(seen)).max()?;
    let cells = lines[first..=last].iter().flat_map(|line| &line[left..=right]).copied().collect();
    let corner = moved(&grid.origin, [left, first].map(|index| index as f32 * grid.resolution_m));
    Some(Known {
        origin: Pose { x_m: corner[0].into(), y_m: corner[1].into(), ..grid.origin },
        columns: (right - left + 1) as u32,
        rows: (last - first + 1) as u32,
        cells,
        resolution_m: grid.resolution_m,
    })
}

fn moved(origin: &Pose, [x, y]: [f32; 2]) -> [f32; 2] {
    let at = origin.isometry() * nalgebra::Point2::new(f64::from(x), f64::from(y));
    [at.x as f32, at.y as f32]
}

/// One byte a cell.
pub(crate) fn format(columns: u32, rows: u32) -> ImageFormat {
    ImageFormat::from_color_model([columns, rows], ColorModel::L, ChannelDatatype::U8)
}

/// What a cell's byte looks like; what is not a percentage cannot be seen.
pub(crate) fn colours() -> AnnotationContext {
    AnnotationContext::new((0..=u8::MAX).map(|cell| {
        let (label, [red, green, blue], alpha) = match cell {
            0..=100 => (format!("{cell} % occupied"), palette::occupancy(cell), 255),
            UNKNOWN => ("unknown".into(), palette::GROUND, 0),
            _ => ("not a cell".into(), palette::GROUND, 0),
        };
        let colour = Rgba32::from_unmultiplied_rgba(red, green, blue, alpha);
        AnnotationInfo::from((u16::from(cell), label.as_str(), colour))
    }))
}
