//! Launch of one node, and what can be seen there.
//!
//! ```text
//! launch      starts the modules of a node, watches over them, stops them
//! launcher    what launch is asked while it runs, and what it knows of its modules
//! survey      what runs on a node and what it does: from shared memory, or by the launch of another node
//! ```
//!
//! The author of a module does not compile it: a module knows of launch what its environment says, and the interface of
//! its process.

#![forbid(unsafe_code)]

mod launch;
pub mod launcher;
pub mod survey;

pub use launch::{
    Event, Launch, LaunchError, LeaseError, NotStarted, Permit, choose_node, events, reap_orphans, stop_flag,
};
