//! Calls: a command with an envelope, its reply, and what may go wrong between.
//!
//! `envelope` is the bytes, `deduplicator` decides on the server's side whether a command runs, `link` is the caller's
//! side, `caller` is what its proxies share of it, `tally` counts what came of its calls.

mod absent;
mod caller;
mod deduplicator;
mod envelope;
mod error;
mod link;
mod noted;
mod pending;
mod stand_by;
mod tally;

pub use caller::Caller;
pub use deduplicator::{CALLERS_MAX, Deduplicator, REPLIES_KEPT, Request, VALIDITY_MAX, Verdict, WINDOW};
pub(crate) use envelope::micros;
pub use envelope::{CallEnvelope, ReplyEnvelope, TRANSIT_MAX, append};
pub use error::{CallError, Fault};
pub(crate) use link::is_to;
pub use link::{CALLS_MAX, Link};
pub use pending::Pending;
pub(crate) use stand_by::StandBy;
pub use tally::Tally;
