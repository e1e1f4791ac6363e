//! Mistakes that are planted in copies of Rohrpost's sources: a test that fails with none of them proves nothing.
//!
//! ```text
//!  sources ── edits of a catalogue ──▶ one copy with all mistakes (`copied`, `planted`), of which a process makes one
//!     │                                at a time (`is_made`) and is watched by another (`run`)
//!     └────── edits of one mistake ──▶ a copy for each (`Variants`), where no question at run time may disturb
//! ```
//!
//! The build script of each such crate writes its copy; what it cannot write is an error of that crate's tests.

#![forbid(unsafe_code)]

mod copies;
mod edit;
mod generated;
mod mistake;
mod mistaken;
mod models;
mod process;
mod variants;

pub use copies::{copied, planted, without_inner_lines};
pub use edit::{Change, Edit, and_not, before, edit, instead, left_out, or};
pub use mistake::{Catalog, Mistake, all_pass_without_a_mistake, is_noticed, mistake};
pub use mistaken::Mistaken;
pub use models::{Models, Part};
pub use process::{MISTAKE_VARIABLE, Ran, Verdict, is_made, made, run};
pub use variants::Variants;
