//! Events between the parts of a payload, and between the payloads of a team (seed 000, 3.1.2 and 4.3; digest, 3).
//!
//! ```text
//!  hard ──────▶┌────────┐ next event ┌─ root ──────────────────┐ emit
//!  hear ──────▶│ queues │───────────▶│ group ─▶ leaf, leaf     │──────▶ queues
//!  emit ──────▶└────────┘  dispatch  │   └────▶ group ─▶ leaf  │ send
//!                                    └─────────────────────────┘──────▶ outbox ──▶ teammates: hear
//! ```
//!
//! A *group* passes events on; a *leaf* runs for an event and may produce others. Both may have several parents. A
//! **hard** event starts at the root; one that is **emitted** starts at the parent through which its leaf has run; one
//! that is **sent** starts there on each teammate, and not here. An event visits each leaf once, by the first way that
//! is on. The path in a message is the number of that way, so all robots need the same tree: [`Tree::digest`].
//!
//! - **No cycles.** Leaves declare what they consume and produce. [`Plan::build`] refuses a tree in which a leaf can
//!   cause itself to run, here or over teammates, and names each such cycle: [`PlanError::Cycles`]. A leaf may declare
//!   an exception; then events carry how long their chain of causes is, over all robots, and a long one ends.
//! - **Bounded.** Each type has a queue of its own, so a flood of one loses nothing of another. What is lost is
//!   counted: [`Tree::lost`]. No priority starves: [`Tree::longest_wait`].
//! - **One thread.** [`Tree::dispatch`] runs all leaves of one event to the end. There is no pool of tasks: the seed's
//!   ran under one mutex. A leaf that computes for long belongs into a module of its own.
//!
//! Priorities are of types; what comes from teammates is low.

mod cycles;
mod message;
mod names;
mod plan;
mod queues;
mod shape;
mod tree;

pub use cycles::{Cycle, CycleLink};
pub use message::{EVENT_BYTES_MAX, EVENT_HEAD_BYTES, EventHead};
pub use names::{EventType, GROUPS_MAX, GroupId, LEAVES_MAX, Priority, ROOT, STEPS_MAX, TYPES_MAX};
pub use plan::{Flow, Plan, PlanError};
pub use queues::LossCause;
pub use tree::{Refused, Tree, Turn};
