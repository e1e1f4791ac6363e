//! Data that the summary of a demo requests from modules.

use rohrpost::interfaces::MapCounts;
use rohrpost::{Class, Name};
use rohrpost_config::Installation;

/// Functions that the summary calls; their numbers in the interfaces.
pub(super) const FIRST_FUNCTION: u16 = 16;

/// The module of a class, if it runs.
pub(super) fn running(installation: &Installation, class: &str) -> Option<Name> {
    let class: Class = installation.classes.id(class)?;
    installation.modules.iter().flat_map(|module| module.names()).find(|name| name.class() == class)
}

/// The progress of the map.
pub(super) fn map_line(counts: &MapCounts) -> String {
    let MapCounts { scans, odometries, mapped, without_pose, free, occupied } = counts;
    format!(
        "map: {scans} scans and {odometries} odometry received, {mapped} scans mapped ({without_pose} without pose), \
         {free} cells free, {occupied} occupied\n"
    )
}
