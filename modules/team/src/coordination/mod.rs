//! How a team acts together: which robot holds which exit of an intruder, by which ways robots go there, and which
//! robot may enter which cell.
//!
//! ```text
//!  agreed view ──▶ share_out ──▶ Duty of each robot ──▶ plan_ways ──▶ cells of all robots, moment by moment
//!       ▲                                                                            │
//!       └────────── Traffic: rounds of planning, and claims on cells ◀───────────────┘
//! ```
//!
//! All of it is computed by every robot on its own, from what all of them know. Numbers are whole, and no chance is
//! asked, so equal knowledge gives equal answers on all machines.

mod assignment;
mod exits;
mod matching;
mod planning;
mod post;
mod sharing;
mod traffic;

pub use planning::{DISTANCES_MAX, NoWays, Trip, Ways, plan_ways};
pub use post::{OpenExit, Post, Target, WhyOpen};
pub use sharing::{Duty, KEPT_STEPS, Participant, Sharing, WhyIdle, share_out};
pub use traffic::{Claim, Planner, Stance, Traffic, TrafficMessage, TrafficSettings};
