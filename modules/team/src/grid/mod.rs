//! The grid on which the robots of a team plan (seed 000, 2.4, 3.3 and A.7; digest, section 6).
//!
//! ```text
//!  text ──▶ Map ──▶ Grid ──┬─▶ Wave ──▶ shortest_path, entrances
//!                          │     ▲
//!  place ── Placement ─────┘     └── Obstacle: intruders, robots and where they move
//! ```
//!
//! Cells count from 0, from the upper left of the file. A step leads to the next cell north, east, south or west; of
//! several shortest paths, the one counts that goes north before east before south before west where they part.

mod cell;
mod entrances;
mod map;
mod map_error;
mod obstacle;
mod path;
mod placement;
mod spacing;
mod squares;
mod wave;

pub use cell::{Cell, Direction, NotACell};
pub use entrances::{Entrance, entrances};
pub use map::{Format, Map};
pub use map_error::MapError;
pub use obstacle::{Obstacle, ObstacleError, ObstacleKind};
pub use path::{NoPath, shortest_path};
pub use placement::Placement;
pub use spacing::{Disagreement, Near, TooClose};
pub use squares::{CELLS_MAX, Grid, Square};
pub use wave::Wave;
