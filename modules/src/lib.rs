//! Module template, interfaces, launch and built-in modules.

pub mod robot;
pub mod types;
