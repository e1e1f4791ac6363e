//! Commands for this computer: whether it fits a robot, what a crash left, versions, completions, built-in modules.

pub(crate) mod clean;
pub(crate) mod completions;
pub(crate) mod doctor;
pub(crate) mod run;
pub(crate) mod version;
