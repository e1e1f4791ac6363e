//! What arena and bodies tell each other, as datagrams of one computer.

use rohrpost_modules::types::{LaserScan, Odometry, Twist};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// No command takes more bytes: a number of a robot, and two of a motion.
pub(crate) const DRIVE_BYTES_MAX: usize = 32;
/// No sensing takes more bytes: those of a scan with 10 000 beams, and some numbers.
pub(crate) const SENSED_BYTES_MAX: usize = 41_000;

/// A body's command to its wheels.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Drive {
    /// System number of the robot.
    pub(crate) robot: u8,
    /// The motion to reach.
    pub(crate) twist: Twist,
}

/// What the sensors of a robot say.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Sensing {
    /// When, ns of the monotonic clock that arena and body share.
    pub(crate) at_ns: u64,
    /// Where the robot is on the map, as a localisation tells it, and how it moves.
    pub(crate) located: Odometry,
    /// What it sees from there, if the scanner has looked.
    pub(crate) scan: Option<LaserScan>,
}

/// The socket of a robot's body, beside that of its arena.
pub(crate) fn body_path(arena: &Path, robot: u8) -> PathBuf {
    let mut path = arena.as_os_str().to_owned();
    path.push(format!(".{robot}"));
    path.into()
}
