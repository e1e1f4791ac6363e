//! Names of the timelines of a drawing.

/// The timeline of system time: nanoseconds since 1970, as all nodes of an installation agree on it.
pub(crate) const SYSTEM_TIME: &str = "system_time";
/// The timeline that begins with the scene.
pub(crate) const ROBOT_TIME: &str = "robot_time";
