//! Commands for several nodes: how they hear each other, their time, their keys.

pub(crate) mod keys;
pub(crate) mod net;
pub(crate) mod quantities;
pub(crate) mod round;
pub(crate) mod tables;
pub(crate) mod time;
pub(crate) mod vocabulary;
