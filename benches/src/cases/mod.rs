//! Cases.
pub mod many;
pub mod startup;
