//! Commands for several nodes: how they hear each other, their time, their keys.

pub(crate) mod flows;
pub(crate) mod keys;
pub(crate) mod net;
pub(crate) mod quantities;
pub(crate) mod round;
pub(crate) mod slots;
pub(crate) mod time;
pub(crate) mod vocabulary;
