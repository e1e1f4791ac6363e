//! Commands for several nodes: how they hear each other, their time, their keys, the files that they run.

pub(crate) mod bundle;
pub(crate) mod keys;
pub(crate) mod net;
pub(crate) mod quantities;
pub(crate) mod round;
pub(crate) mod tables;
pub(crate) mod time;
pub(crate) mod vocabulary;
