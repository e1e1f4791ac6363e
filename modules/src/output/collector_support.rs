//! What the collector of lines bounds them by, as the modules that say them do. Not for people: the collector is in
//! another crate.

pub use super::allowance::Bucket;
pub use super::layer::cut;
pub use super::way::{LANES, WAITING_LINES};
