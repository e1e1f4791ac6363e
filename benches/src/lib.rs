//! Rohrpost's mailboxes and streams, measured beside the floors of this very computer and beside what else could be
//! used.
//!
//! ```text
//!  cases ── which contenders, which sizes, which targets ──▶ rounds ── contenders in turn, round after round
//!    │                                                         │
//!    │   ours · streams · floors · peers: how each sends       ▼
//!    └────────────────────────────▶ harness ── two processes, pinned and scheduled, samples in shared memory
//!                                                              │
//!                             table (people, JSON) ◀── rows ◀── statistics: ratios within a round, medians over rounds
//! ```
//!
//! A case is added in `cases`: anything that has a name and gives rows. All processes are forked from a parent without
//! threads, end when it ends, and are killed when their time is over.

pub mod cases;
pub mod counting;
pub mod environment;
pub mod floors;
pub mod harness;
#[cfg(feature = "lan")]
pub mod lan;
#[cfg(feature = "languages")]
pub mod languages;
#[cfg(any(feature = "languages", feature = "recording"))]
pub mod motor;
pub mod one_way;
pub mod ours;
#[cfg(feature = "peers")]
pub mod peers;
#[cfg(feature = "languages")]
pub mod player;
pub mod report;
pub mod rounds;
pub mod settings;
pub mod statistics;
pub mod streams;
pub mod table;
#[cfg(feature = "lan")]
pub mod tcp;
#[cfg(feature = "lan")]
pub mod tdma;

pub use harness::Failure;
pub use settings::Settings;
