//! A camera in the simulated world: walls, floor and ceiling as a picture of red, green and blue.
//!
//! Walls have one colour, brighter or darker by the side that is seen; the floor has square tiles, so that motion
//! shows. Everything becomes darker with its depth. The lamp is at the camera, and there is no noise: the same pose
//! gives the same picture.
//!
//! Rendering takes nothing from the heap. A picture of 640 by 480 pixels costs less than 1 ms of one core, in the
//! profile of the demo (the example `look_around` measures it).

use super::pinhole::{Pinhole, Walls};
use super::sight::WallSide;
use super::world::World;
use rohrpost_modules::types::{Image, ImageFormat, Pose};

/// A common camera at the front of the robot: 640 by 480 pixels, 70°.
pub const CAMERA: Pinhole = Pinhole {
    width_px: 640,
    height_px: 480,
    field_of_view_rad: 70.0 * std::f64::consts::PI / 180.0,
    depth_max_m: 40.0,
    mounting: Pose { x_m: 0.0, y_m: 0.0, heading_rad: 0.0 },
    height_m: 0.6,
};

/// Side of a tile of the floor.
const TILE_M: f32 = 0.5;
/// At this depth, half of the light is left.
const HALF_LIGHT_M: f32 = 9.0;

const WALL: Colour = [224.0, 214.0, 196.0];
const FLOOR: [Colour; 2] = [[168.0, 132.0, 98.0], [142.0, 110.0, 80.0]];
const CEILING: Colour = [238.0, 240.0, 244.0];

/// Red, green, blue, 0 to 255, before the light is known.
type Colour = [f32; 3];
type Rgb = [u8; 3];

/// Renders pictures; its memory is allocated once.
pub struct SimulatedCamera {
    pinhole: Pinhole,
    walls: Walls,
    /// Colour of each column's wall.
    colours: Vec<Rgb>,
}

impl SimulatedCamera {
    /// A camera that looks so. Width and height are at least 1.
    pub fn new(pinhole: Pinhole) -> Self {
        Self { pinhole, walls: Walls::new(pinhole), colours: vec![Rgb::default(); pinhole.width_px as usize] }
    }

    /// The picture without its pixels.
    pub fn image(&self) -> Image {
        Image::empty(self.pinhole.width_px, self.pinhole.height_px, ImageFormat::Rgb8)
    }

    /// Writes the pixels that a robot at `robot` sees.
    ///
    /// # Panics
    /// If `pixels` does not have the [`raw_bytes`](Image::raw_bytes) of [`SimulatedCamera::image`].
    pub fn render(&mut self, world: &World, robot: &Pose, pixels: &mut [u8]) {
        assert_eq!(pixels.len(), 3 * self.pinhole.pixels(), "three bytes for each pixel");
        let eye = self.walls.look(world, robot);
        for (colour, column) in self.colours.iter_mut().zip(self.walls.columns()) {
            *colour = lit(WALL.map(|part| part * brightness(column.side)), column.depth_m);
        }
        let (pixels, _) = pixels.as_chunks_mut::<3>();
        for (row, pixels) in pixels.chunks_exact_mut(self.colours.len()).enumerate() {
            let row = row as u32;
            if self.pinhole.up(row) < 0.0 {
                self.render_floor(row, &eye, pixels);
            } else {
                self.render_ceiling(row, pixels);
            }
        }
    }

    fn render_ceiling(&self, row: u32, pixels: &mut [Rgb]) {
        let depth_m = self.pinhole.level_depth_m(row) as f32;
        let ceiling = lit(CEILING, depth_m);
        for ((pixel, column), wall) in pixels.iter_mut().zip(self.walls.columns()).zip(&self.colours) {
            *pixel = if column.depth_m <= depth_m { *wall } else { ceiling };
        }
    }

    fn render_floor(&self, row: u32, eye: &Pose, pixels: &mut [Rgb]) {
        let depth_m = self.pinhole.level_depth_m(row) as f32;
        let tiles = FLOOR.map(|colour| lit(colour, depth_m));
        let (sin, cos) = (eye.heading_rad.sin() as f32, eye.heading_rad.cos() as f32);
        // Where the middle of the row meets the floor, and which way is left; in tiles.
        let middle = [eye.x_m as f32 + depth_m * cos, eye.y_m as f32 + depth_m * sin].map(|place_m| place_m / TILE_M);
        let left = [-depth_m * sin, depth_m * cos].map(|metres| metres / TILE_M);
        for ((pixel, column), wall) in pixels.iter_mut().zip(self.walls.columns()).zip(&self.colours) {
            if column.depth_m <= depth_m {
                *pixel = *wall;
            } else {
                // Floor that is seen is on the map, where no place is negative: cutting is rounding down.
                let tile = |axis: usize| (middle[axis] + left[axis] * column.left) as i32;
                *pixel = tiles[((tile(0) ^ tile(1)) & 1) as usize];
            }
        }
    }
}

/// The share of light that a side of a wall gives back.
fn brightness(side: WallSide) -> f32 {
    match side {
        WallSide::West => 1.0,
        WallSide::South => 0.88,
        WallSide::East => 0.78,
        WallSide::North => 0.68,
        WallSide::Inside => 0.0,
    }
}

/// A colour at this depth; black at an infinite one.
fn lit(colour: Colour, depth_m: f32) -> Rgb {
    let light = HALF_LIGHT_M / (HALF_LIGHT_M + depth_m);
    colour.map(|part| (part * light).round() as u8)
}

#[cfg(test)]
#[path = "camera_tests.rs"]
mod tests;
