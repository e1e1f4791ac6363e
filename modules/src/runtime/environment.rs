//! Environment by which launch tells a module what it is.

/// The configuration's file.
pub const CONFIG: &str = "ROHRPOST_CONFIG";
/// The module's name.
pub const MODULE: &str = "ROHRPOST_MODULE";
/// The node that it runs on.
pub const NODE: &str = "ROHRPOST_NODE";
/// Set: the last two descriptors that launch hands on are an event and a timer. The module stands by until the event is
/// there; when the timer fires, its time on this node is over.
pub const LEASE: &str = "ROHRPOST_LEASE";
/// Process id of launch.
pub const LAUNCHER: &str = "ROHRPOST_LAUNCHER";
/// Times that it was started again.
pub const RESTARTS: &str = "ROHRPOST_RESTARTS";
/// Set: it begins switched off, and launch switches it on when it is time.
pub const OFF: &str = "ROHRPOST_OFF";
/// Time for which it keeps its lines of output to itself, ms: earlier processes printed the like and ended soon.
pub const QUIET_MS: &str = "ROHRPOST_QUIET_MS";
