//! What the summary of a demo asks modules for.

use rohrpost::interfaces::MapCounts;
use rohrpost::{Class, Name};
use rohrpost_config::Installation;

/// Functions asked for in the summary; their numbers in the interfaces.
pub(super) const FIRST_FUNCTION: u16 = 16;

/// The module of a class, if it runs.
pub(super) fn running(installation: &Installation, class: &str) -> Option<Name> {
    let class: Class = installation.classes.id(class)?;
    installation.modules.iter().flat_map(|module| module.names()).find(|name| name.class() == class)
}

/// How far the map has come.
pub(super) fn map_line(counts: &MapCounts) -> String {
    let MapCounts { scans, odometries, mapped, without_pose, free, occupied } = counts;
    format!(
        "map: {scans} scans and {odometries} odometry received, {mapped} scans mapped ({without_pose} without pose), \
         {free} cells free, {occupied} occupied\n"
    )
}
