//! Modules without Rust types: described while they run, with values that are postcard. Clients in other languages are
//! made of it; a module in them is launched, watched, switched, listed and called like any other.
//!
//! ```text
//! language ──▶ NativeInterface ─▶ run ─▶ Hosted (a `MadeModule`) ─▶ the runtime's loop
//!     ▲                                     │
//!     └──── NativeModule ◀── NativeContext ─┘   parameters, following, peers, streams, record
//! ```
//!
//! All runs in one thread, which [`run`] takes; only [`say`] may be called from any.

#![forbid(unsafe_code)]

mod context;
mod error;
mod following;
mod hosted;
mod module;
mod output;
mod parameters;
mod peers;
mod record;
mod streams;
mod tool;

pub use context::NativeContext;
pub use error::NativeError;
pub use following::{FollowRate, FollowedData};
pub use hosted::run;
pub use module::{NativeInterface, NativeModule};
pub use output::{SayLevel, say};
pub use parameters::NativeParameter;
pub use peers::Peer;
pub use record::RecordRoom;
pub use rohrpost_mailbox::base_directory;
pub use rohrpost_mailbox::{
    Around, Interest, Missed, Name, Next, Ready, RecordInfo, RecordPlace, Stamp, SystemTime, Watch,
};
pub use rohrpost_modules::call::{CallError, Fault};
pub use rohrpost_modules::runtime::{Moment, Start, StartError, StayingBytes, exit, tell_exit};
pub use rohrpost_modules::wire::append;
pub use rohrpost_modules::{CommandFailure, ModuleError};
pub use rohrpost_schema as schema;
pub use streams::{NativeStream, StayingRecord};
pub use tool::{CopiedRecord, NativeTool, ToolData, ToolError, ToolStream};
