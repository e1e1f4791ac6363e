//! The map that a module's settings name.

use rohrpost_modules::ModuleError;
use rohrpost_modules::types::Pose;
use rohrpost_payload::Ground;
use rohrpost_robot::world::World;
use rohrpost_team::view::map_digest;
use std::path::Path;

/// Reads the map of a file, and its digest.
///
/// # Errors
/// The file cannot be read, or is no map.
pub(crate) fn read_map(path: &Path) -> Result<(World, u64), ModuleError> {
    let text = std::fs::read_to_string(path).map_err(|error| ModuleError::at(path.display(), error))?;
    let world = World::parse(&text).map_err(|error| ModuleError::at(path.display(), error))?;
    Ok((world, map_digest(text.as_bytes())))
}

/// Reads the walls of a map, and where odometry begins on it. With `is_absolute`, odometry tells places on the map
/// itself, and walls alone count, as robots of a team know them.
///
/// # Errors
/// The file cannot be read, or is no map.
pub(crate) fn read_walls(path: &Path, is_absolute: bool) -> Result<(World, Pose), ModuleError> {
    if !is_absolute {
        let (world, _) = read_map(path)?;
        let start = world.start();
        return Ok((world, start));
    }
    let text = std::fs::read(path).map_err(|error| ModuleError::at(path.display(), error))?;
    let ground = Ground::read(&text, None, 0.0).map_err(|error| ModuleError::at(path.display(), error))?;
    Ok((ground.world().clone(), Pose::default()))
}
