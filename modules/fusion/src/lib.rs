//! Fusion by time: stamped records, asked for the value at a time, and sets of records of several streams that belong
//! together.
//!
//! ```text
//! records of one stream ──▶ History ──at(stamp)──▶ value in between, or why there is none
//!
//! records of 2..=8 streams ──▶ Matcher ──next_set──▶ one record of each, close together in time
//! ```
//!
//! Answers depend on stamps, never on the order of arrival. A stream has a *lateness bound*: how far behind the newest
//! record another one may come. What lies so far back is *settled*: nothing comes in between any more. Only settled
//! records answer; before, the answer is [`NoValue::NotYet`].
//!
//! Nothing is extrapolated, and records of two epochs of system time are never put together.
//!
//! Knows no mailbox, no module and no clock: stamps are arguments. After construction, nothing here allocates.

#![forbid(unsafe_code)]

mod angle;
mod history;
mod interpolate;
mod lookup;
mod matcher;
mod nalgebra_types;
mod record;
mod sorted;

pub use angle::wrap_rad;
pub use history::History;
pub use interpolate::{Heading, Interpolate, Share};
pub use lookup::{Around, NoValue, Records};
pub use matcher::{MatchCounts, MatchInput, Matcher, Missing};
pub use record::{Record, Refused, Stamp};
pub use rohrpost_macros::Interpolate;
