//! Maps of the simulated world: a world, or what is wrong with the text.

use rohrpost_robot::world::{World, WorldError};

pub(crate) fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    for read in [World::parse(text), World::parse_octile(text, 0.2)] {
        match read {
            Ok(world) => look_around(&world),
            Err(error) => told(&error, text),
        }
    }
}

fn told(error: &WorldError, text: &str) {
    assert!(!error.to_string().is_empty());
    let line = match error {
        WorldError::Map(error) => error.line(),
        WorldError::SecondStart { line, .. } => *line,
        WorldError::NotThisFormat(_) | WorldError::NoStart | WorldError::CellSize(_) => 1,
    };
    assert!((1..=text.lines().count().max(1)).contains(&line), "{error}");
}

fn look_around(world: &World) {
    let (start, (width_m, height_m)) = (world.start(), world.size_m());
    assert!(!world.is_blocked_at(start.x_m, start.y_m), "the robot starts where it can stand");
    assert!(start.x_m >= 0.0 && start.x_m <= width_m && start.y_m >= 0.0 && start.y_m <= height_m);
    for direction_rad in [0.0, 1.0, 2.5, -1.0, start.heading_rad] {
        if let Some(distance_m) = world.cast(start.x_m, start.y_m, direction_rad, 30.0) {
            assert!((0.0..=30.0).contains(&distance_m), "{distance_m}");
        }
    }
    let _ = world.disc_collides(start.x_m, start.y_m, 0.2);
}
