//! Commands for a robot that runs: what it is, says and publishes, and what a person asks of it.

pub(crate) mod call;
pub(crate) mod control;
pub(crate) mod echo;
pub(crate) mod halt;
pub(crate) mod list;
pub(crate) mod log;
pub(crate) mod param;
pub(crate) mod status;
pub(crate) mod top;
