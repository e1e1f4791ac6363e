//! The module template, interfaces and proxies, calls, subscriptions, and output.
//!
//! ```text
//! types, interfaces   what modules exchange            journal          a module's run, to be repeated
//! call                commands, at most once           runtime          the loop of a module's thread
//! publish             subscribers of data              output           lines of output
//! parameter           settings that may change
//! ```
//!
//! Module authors use it through the crate `rohrpost`. Modules that come with Rohrpost are in the crate
//! `rohrpost-builtin`; what starts and watches modules is in `rohrpost-launch`.

#![forbid(unsafe_code)]

pub mod call;
pub mod common;
pub mod description;
pub mod interface;
pub mod interfaces;
pub mod journal;
#[doc(hidden)]
pub mod launch_support;
#[doc(hidden)]
pub mod macro_support;
mod made;
mod module;
pub mod output;
pub mod parameter;
mod places;
mod publish;
pub mod runtime;
pub mod types;
pub mod wire;

pub use made::{CommandFailure, MadeModule};
pub use module::{Module, ModuleError, NoSettings};
pub use rohrpost_fusion as fusion;
pub use rohrpost_macros::{choice, data, interface, parameters};
pub use rohrpost_schema as schema;
pub use runtime::run;
/// The version of serde that the attributes derive with.
pub use serde;
