//! Simulates whole networks of routers. Not published, and compiled for tests only.

#![forbid(unsafe_code)]

pub mod lan;
pub mod pair;
pub mod sim;
pub mod stalls;

pub use rohrpost_test_report as report;
