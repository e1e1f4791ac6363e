//! The world from above: robots and their trajectories, scans, maps.
//!
//! All of it is flat and drawn in a 2D view. That one shows the whole map upright and fits it to the window by itself;
//! a 3D view would show it from a corner. Entities, below `world`, with a transform that turns y up:
//!
//! ```text
//!   map/MODULE/TILE      one entity for each tile, cropped to the squares that are known
//!   frame                a margin around all of it, and a scale
//!   trajectory/MODULE/CHUNK   see `trajectory`
//!   scan/MODULE          the last sweep, in the world's frame
//!   robot/MODULE         where this module believes the robot to be
//!   team/MODULE          see `team`
//! ```

use crate::error::{DrawError, TILES_MAX};
use crate::palette::{self, Rgb};
use crate::scene::{Scene, entity};
use crate::trajectory::{CHUNKS_MAX, Change};
use nalgebra::{Isometry2, Point2};
use rerun::{Arrows2D, LineStrips2D, Points2D, Radius, RotationAxisAngle, Scalars, SegmentationImage, Transform3D};
use rohrpost::types::{LaserScan, OccupancyGrid, Odometry, Pose, Twist};

pub(crate) mod extent;
mod tile;

use extent::Extent;
pub use tile::MAP_CELLS_MAX;

/// Beams this much longer than most do not make the world larger: glass and open doors let single ones through.
const TRUSTED_BEAMS: f64 = 0.97;

/// How a robot is drawn: the better a place is known, the more it catches the eye.
struct RobotStyle {
    colour: Rgb,
    body_m: f32,
    line: f32,
    order: f32,
}

const BEST: RobotStyle = RobotStyle { colour: palette::ROBOT, body_m: 0.28, line: 2.0, order: 30.0 };
const ODOMETRY: RobotStyle = RobotStyle { colour: palette::ODOMETRY, body_m: 0.2, line: 1.25, order: 20.0 };

impl Scene {
    /// Draws what never changes.
    pub(crate) fn prepare_world(&mut self) {
        // A 2D view counts y downwards, as pictures do; our frames are right-handed.
        self.log_static(entity(&["world"]), &Transform3D::from_scale([1.0, -1.0, 1.0]));
        self.log_static(entity(&["world", "map"]), &tile::colours());
    }

    /// The robot is here, as `module` knows best (localisation, a corrected log).
    pub fn pose(&mut self, module: &str, pose: &Pose) {
        self.robot(module, pose, &BEST);
    }

    /// The robot is here, counted from where it started. Drawn less brightly than [`Scene::pose`].
    pub fn odometry(&mut self, module: &str, odometry: &Odometry) {
        if self.world.carrier.is_empty() {
            self.world.carrier = module.into();
        }
        self.robot(module, &odometry.pose, &ODOMETRY);
    }

    /// How `module` moves: curves below `motion`.
    pub fn motion(&mut self, module: &str, twist: &Twist) {
        for (curve, value) in [("speed m_s", twist.speed_m_s), ("turn rate rad_s", twist.turn_rate_rad_s)] {
            self.log(entity(&["motion", module, curve]), &Scalars::single(value));
        }
    }

    fn robot(&mut self, module: &str, pose: &Pose, style: &RobotStyle) {
        let at = [pose.x_m as f32, pose.y_m as f32];
        let known = self.world.robots.contains_key(module);
        let robot = self.world.robots.entry(module.into()).or_default();
        robot.pose = *pose;
        let change = robot.trajectory.push(at);
        self.world.extent.include(at);
        if !known {
            self.body(module, style);
        }
        self.log(entity(&["world", "robot", module]), &placed(pose, 1.0));
        match change {
            Change::None => {}
            Change::Chunk(chunk) => self.trajectory(module, chunk, style),
            Change::All => (0..CHUNKS_MAX).for_each(|chunk| self.trajectory(module, chunk, style)),
        }
        self.frame();
    }

    /// A disc and an arrow ahead. On a map of a whole building the disc would be lost, but for a dot of fixed size.
    fn body(&mut self, module: &str, style: &RobotStyle) {
        let body = Points2D::new([[0.0f32, 0.0]])
            .with_radii([Radius::new_scene_units(style.body_m)])
            .with_colors([style.colour])
            .with_draw_order(style.order);
        let heading = Arrows2D::from_vectors([[style.body_m * 3.5, 0.0]])
            .with_radii([Radius::new_ui_points(style.line)])
            .with_colors([style.colour])
            .with_draw_order(style.order);
        self.log_static(entity(&["world", "robot", module, "body"]), &body);
        self.log_static(entity(&["world", "robot", module, "heading"]), &heading);
    }

    fn trajectory(&mut self, module: &str, chunk: usize, style: &RobotStyle) {
        let points = self.world.robots.get(module).map_or(&[][..], |robot| robot.trajectory.chunk(chunk));
        let strips = if points.len() < 2 { vec![] } else { vec![points.to_vec()] };
        let line = LineStrips2D::new(strips)
            .with_radii([Radius::new_ui_points(style.line)])
            .with_colors([palette::muted(style.colour)])
            .with_draw_order(style.order - 1.0);
        self.log(entity(&["world", "trajectory", module, &chunk.to_string()]), &line);
    }

    /// The module with the odometry that was drawn first: it carries scanners that send no pose.
    pub fn carrier(&self) -> &str {
        &self.world.carrier
    }

    /// The last pose drawn for a module.
    pub(crate) fn pose_of(&self, module: &str) -> Pose {
        self.world.robots.get(module).map(|robot| robot.pose).unwrap_or_default()
    }

    /// A sweep of the scanner `module`. It is drawn where the scan says that its scanner stood; else `mount` on the
    /// robot, at the last pose drawn for `carrier`.
    pub fn scan(&mut self, module: &str, scan: &LaserScan, carrier: &str, mount: &Pose) {
        let carried = || self.pose_of(carrier).isometry() * mount.isometry();
        let stand = scan.pose.map_or_else(carried, |pose| pose.isometry());
        let points = hits(scan, &stand, &mut self.world.extent);
        let cloud = Points2D::new(points)
            .with_radii([Radius::new_scene_units(0.045)])
            .with_colors([palette::SCAN])
            .with_draw_order(10.0);
        self.log(entity(&["world", "scan", module]), &cloud);
        self.frame();
    }

    /// A tile of `module`'s map, or all of it. A tile replaces the one that had its origin; nothing else is erased.
    pub fn grid(&mut self, module: &str, grid: &OccupancyGrid) -> Result<(), DrawError> {
        let at = tile::check(module, grid)?;
        let Some(part) = tile::known(grid) else { return Ok(()) };
        let tiles = self.world.tiles.entry(module.into()).or_default();
        if !tiles.contains(&at) && tiles.len() == TILES_MAX {
            return Err(DrawError::Tiles(module.into()));
        }
        tiles.insert(at);
        part.corners().into_iter().for_each(|corner| self.world.extent.include(corner));
        let place = entity(&["world", "map", module, &format!("{} {}", at.0, at.1)]);
        let image = SegmentationImage::new(part.cells, tile::format(part.columns, part.rows))
            .with_opacity(1.0)
            .with_draw_order(-10.0);
        self.log(place.clone(), &placed(&part.origin, grid.resolution_m));
        self.log(place, &image);
        self.frame();
        Ok(())
    }

    /// Draws the frame anew if the world has grown.
    pub(crate) fn frame(&mut self) {
        let Some(frame) = self.world.extent.grown() else { return };
        let (bar, metres) = frame.scale();
        // A view makes room for what is drawn, seen or not: the outline in the ground's colour is a margin.
        let lines = LineStrips2D::new([frame.outline(), bar])
            .with_radii([Radius::new_ui_points(0.5), Radius::new_ui_points(1.25)])
            .with_colors([palette::GROUND, palette::AID])
            .with_labels([String::new(), format!("{metres} m")])
            .with_draw_order(-20.0);
        self.log(entity(&["world", "frame"]), &lines);
    }
}

/// The transform that puts a flat thing at `pose`.
pub(crate) fn placed(pose: &Pose, scale: f32) -> Transform3D {
    let turn = RotationAxisAngle::new([0.0, 0.0, 1.0], rerun::Angle::from_radians(pose.heading_rad as f32));
    let at = [pose.x_m as f32, pose.y_m as f32, 0.0];
    Transform3D::from_translation_rotation_scale(at, turn, [scale, scale, 1.0])
}

/// Where the beams ended, in the world's frame and inside of its extent, which most of them may enlarge.
fn hits(scan: &LaserScan, stand: &Isometry2<f64>, extent: &mut Extent) -> Vec<[f32; 2]> {
    let mut ranges: Vec<f64> = scan.hits().map(|(_, range)| range).collect();
    ranges.sort_by(f64::total_cmp);
    let trusted = ranges.get((ranges.len() as f64 * TRUSTED_BEAMS) as usize).copied().unwrap_or(f64::INFINITY);
    let place = |(angle, range): (f64, f64)| {
        let end = stand * Point2::new(range * angle.cos(), range * angle.sin());
        [end.x as f32, end.y as f32]
    };
    scan.hits().filter(|(_, range)| *range <= trusted).for_each(|beam| extent.include(place(beam)));
    scan.hits().map(place).filter(|point| extent.contains(*point)).collect()
}

#[cfg(test)]
mod tests;
