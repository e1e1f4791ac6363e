//! Rohrpost for C and C++. The header `include/rohrpost.h` is made of this crate, docs included; `include/rohrpost.hpp`
//! has C++ wrappers.
//!
//! ```text
//!  C ──▶ edge ──▶ table: handle ─▶ object ──▶ node, mailbox, stream ──▶ rohrpost-mailbox
//!         │ a panic becomes a code, its text the last error of the thread
//! ```
//!
//! - **Codes.** Each call returns a `rohrpost_code`: 0 when it is done, above 0 when there is nothing to hand out,
//!   below 0 when it failed. `rohrpost_error_text` has words for a code, `rohrpost_last_error` what exactly was wrong.
//! - **Handles** are numbers, not pointers: a handle that is closed, of another kind, of another thread or from before
//!   a fork is a code, whatever else is there by now.
//! - **Threads.** A handle belongs to the thread that opened it; other threads open their own. Functions without a
//!   handle may be called by any thread. What a thread has not closed is closed when it ends.
//! - **Fork.** A child process cannot use what its parent has opened, nor be its module: the parent's locks say that
//!   the parent lives. It gets a code, and should call `exec` or `_exit`; one that returns from a function of a module
//!   ends.
//! - **Memory** that a call hands out lies in shared memory, aligned to nothing, and is valid until the next call that
//!   takes from the same handle, whatever that returns, gives it back, or closes it. No call keeps a pointer that it
//!   was given.

pub mod code;
pub mod decode;
pub mod description;
pub mod edge;
pub mod encode;
mod fork;
mod lender;
pub mod mailbox;
pub mod module;
pub mod node;
mod objects;
pub mod stream;
mod table;
pub mod waiting;
