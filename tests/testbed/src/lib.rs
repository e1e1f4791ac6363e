//! Simulates whole networks of routers. Not published, and compiled for tests only.

#![forbid(unsafe_code)]

pub mod sim;
pub mod stall_detector;
