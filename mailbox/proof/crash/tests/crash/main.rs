//! Every operation on a mailbox is killed at each of its steps, one process a death; then a healthy process looks at
//! what was left: everything usable, nothing torn, no loss that is not counted. `tests/mistaken` runs the same scenes
//! on a mailbox with mistakes, and shows that each step is died at.
//!
//! ```text
//! for k in 1..:  scene (parent) ─▶ victim: its own scene, arm(k), one operation ─▶ abort at step k ─▶ aftermath (parent)
//!                                                                              └─▶ survived: k - 1 steps in all, done
//! ```

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod aftermath;
mod ground;
mod making;
mod receiving;
mod sending;
mod streams;
mod time;
mod victim;
