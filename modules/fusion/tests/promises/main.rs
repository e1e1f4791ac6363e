//! What fusion by time promises, as properties. `modules/fusion/proof` runs the same on a copy with planted mistakes.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod arrival;
mod interpolation;
mod lookups;
mod matching;
mod reference;
