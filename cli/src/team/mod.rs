//! Commands for teams of robots: what they know of each other, and what they plan on the grid of a map.

pub(crate) mod drawing;
pub(crate) mod entrances;
mod ground;
mod kill;
pub(crate) mod launch;
pub(crate) mod members;
pub(crate) mod path;
pub(crate) mod referee;
pub(crate) mod squad;
pub(crate) mod station;
pub(crate) mod two_files;
