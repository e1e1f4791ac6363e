//! Module template, interfaces, launch and built-in modules.

pub mod types;
pub mod value;
