//! Commands for this computer: whether it fits a robot, what a crash left, versions, completions, manual pages,
//! built-in modules.

pub(crate) mod clean;
pub(crate) mod completions;
pub(crate) mod doctor;
pub(crate) mod man;
pub(crate) mod run;
pub(crate) mod version;
