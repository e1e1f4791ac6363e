//! Rohrpost's mailboxes, measured beside the floors of this very computer: what `rohrpost bench local` runs, and what
//! the bench with its peers is built on.
//!
//! ```text
//!  latency ── which contenders, which sizes, which targets ──▶ rounds ── contenders in turn, round after round
//!    │                                                           │
//!    │   ours · hand_over: how each sends                        ▼
//!    └────────────────────────▶ harness ── two processes, pinned and scheduled, samples in shared memory
//!                                                                │
//!                               table (people, JSON) ◀── rows ◀── statistics: ratios within a round, medians over rounds
//! ```
//!
//! All processes are forked from a parent without threads, end when it ends, and are killed when their time is over.

mod case;
pub mod environment;
pub mod hand_over;
pub mod harness;
pub mod latency;
pub mod ours;
pub mod report;
pub mod rounds;
pub mod settings;
pub mod statistics;
pub mod table;

pub use case::Case;
pub use harness::{Failure, OrFail};
pub use settings::Settings;
