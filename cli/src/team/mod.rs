//! Commands for teams of robots: what they know of each other, and what they plan on the grid of a map.

pub(crate) mod entrances;
mod ground;
pub(crate) mod members;
pub(crate) mod path;
