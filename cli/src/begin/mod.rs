//! Commands to begin with: show a robot, make a module or its interface, check a configuration.

pub(crate) mod arena;
pub(crate) mod check;
pub(crate) mod demo;
pub(crate) mod interface;
pub(crate) mod new;
