//! Built-in modules for recordings: `logd` records what modules publish, `replay` plays it in their place.
//!
//! Files are read and written in `rohrpost-recording`, which knows no module. What a person asks for stands in the
//! command: it makes a replay's configuration, of which [`player`] has the settings.
//!
//! ```text
//!  streams, data, output ─▶ logd ─▶ NODE-0001.mcap ─▶ player ─▶ the same, as published by the modules
//! ```

mod logd;
pub mod player;

pub use logd::run as run_recorder;
pub use player::run as run_player;
