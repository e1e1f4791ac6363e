//! The map that a module's settings name.

use rohrpost_modules::ModuleError;
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
