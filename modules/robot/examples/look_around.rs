//! What the simulated camera and the depth sensor see in a map: `cargo run -p rohrpost-robot
//! --example look_around -- MAP PICTURE.ppm DEPTH.pgm [X_M Y_M HEADING_DEG]`.
//!
//! The depth picture is white at the sensor and black where nothing came back. Prints how long both take.

use rohrpost_modules::types::{Bytes, Pose};
use rohrpost_robot::camera::{CAMERA, SimulatedCamera};
use rohrpost_robot::depth::{DEPTH_SENSOR, SimulatedDepth};
use rohrpost_robot::world::World;
use std::error::Error;
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [map, picture, depth, stand @ ..] = arguments.as_slice() else {
        return Err("usage: look_around MAP PICTURE.ppm DEPTH.pgm [X_M Y_M HEADING_DEG]".into());
    };
    let world = World::parse(&std::fs::read_to_string(map)?)?;
    let stand = match stand {
        [x_m, y_m, heading_deg] => {
            let heading_rad = heading_deg.parse::<f64>()?.to_radians();
            Pose { x_m: x_m.parse()?, y_m: y_m.parse()?, heading_rad }
        }
        _ => world.start(),
    };
    let mut camera = SimulatedCamera::new(CAMERA);
    let mut image = camera.image();
    image.pixels = Bytes(vec![0; usize::try_from(image.raw_bytes())?]);
    println!("{:?} for a picture", shortest(|| camera.render(&world, &stand, &mut image.pixels)));
    let header = format!("P6 {} {} 255\n", image.width_px, image.height_px);
    std::fs::write(picture, [header.as_bytes(), &image.pixels].concat())?;

    let mut sensor = SimulatedDepth::new(DEPTH_SENSOR);
    let mut cloud = sensor.cloud();
    cloud.points = Bytes(vec![0; usize::try_from(cloud.raw_bytes())?]);
    println!("{:?} for {} points", shortest(|| sensor.look(&world, &stand, &mut cloud.points)), cloud.points()?.len());
    let nearness = |x_m: f32| ((1.0 - x_m / DEPTH_SENSOR.depth_max_m as f32) * 255.0) as u8;
    let depths: Vec<u8> = cloud.points()?.map(|point| nearness(point.x_m)).collect();
    let header = format!("P5 {} {} 255\n", cloud.columns, cloud.rows);
    std::fs::write(depth, [header.as_bytes(), &depths].concat())?;
    Ok(())
}

/// The shortest of several runs: the others were interrupted.
fn shortest(mut run: impl FnMut()) -> Duration {
    let timed = |_| {
        let start = Instant::now();
        run();
        start.elapsed()
    };
    (0..50).map(timed).min().unwrap_or_default()
}
