//! Reads, checks and explains the configuration of an installation: one TOML file that says which modules run where,
//! with which priority, mailboxes and settings.
//!
//! [`Installation::load`] gives an installation in which everything holds, or [`Errors`]: everything that is wrong with
//! the file, each with its line and with what would be right. Nothing falls back silently, an unknown key is an error.
//! [`explain`] says in words what a file means, as `rohrpost check` prints it.
//!
//! ```
//! use rohrpost_config::Installation;
//! let text = r#"
//! installation = "small"
//! [system]
//! name = "robot"
//! id = 1
//! [classes]
//! mapper = { id = 96, text = "Draws the map" }
//! tool = { id = 16 }
//! [nodes.main]
//! [[module]]
//! name = "mapper.0"
//! builtin = "mapper"
//! calls = ["laser.0"]
//! "#;
//! let errors = Installation::parse(text, "small.toml".as_ref()).unwrap_err();
//! assert_eq!(
//!     errors.to_string(),
//!     "small.toml:13: module `mapper.0` calls `laser.0`, which no [[module]] defines; \
//!      add one, or drop it from `calls`"
//! );
//! ```
//!
//! Each section has a file that reads and checks it and words its mistakes (`module`, `classes`, `flow`, `tdma` …);
//! `errors` prints them, `sources` joins the files that one includes, `reader` words wrong types and unknown keys.
//! `config/tests/broken` has an example of each.
//!
//! Every key of the file is described in `docs/src/configuration.md`.
#![forbid(unsafe_code)]

mod access;
mod alone;
mod beyond;
mod calls;
mod check;
mod classes;
mod contents;
mod digest;
mod directory;
mod errors;
mod exact;
pub mod examples;
mod explain;
mod flow;
mod gui;
mod installation;
mod keys;
mod lan;
mod line_ends;
mod load;
mod log_control;
mod mailbox;
mod module;
mod module_nodes;
mod network;
mod node;
mod output;
mod plan;
mod principal;
mod program;
mod reader;
mod record;
mod replica;
mod replicated;
mod restart;
mod saved;
mod scheduling;
mod settings;
mod sources;
mod standby;
mod stopping;
mod stream;
mod tcp;
mod tdma;
mod team;
mod time;
mod units;
mod watchdog;

pub use access::{Access, AccessRule, ClassSet, Commanded};
pub use calls::{CALL_TIMEOUT, CallLimits, DownwardCalls, Downwards};
pub use classes::{ClassEntry, ClassTable, GUI, NameTextError, ROUTER, TCP, TEAM_ROUTER, TOOL};
pub use contents::{Contents, ContentsError};
pub use digest::Digest;
pub use errors::{Errors, Problem, SettingsError};
pub use exact::{ExactModule, JOURNAL, RECORDED_BYTES_MAX, may_have_journal};
pub use explain::explain;
pub use flow::Flow;
pub use gui::{Gui, Show};
pub use installation::Installation;
pub use keys::{KEY_BYTES, Key, Keys, KeysError, open_secret};
pub use mailbox::{CLAIMS_MAX, MailboxSpec, Mailboxes, SLOTS_MAX, TRANSIT};
pub use module::{BUILTINS, Module, Program, RECORDER, REPLAY, SPIN_MAX, Start, TCP_CLIENT, TCP_ROUTER};
pub use module_nodes::{NODES_OF_MODULE_MAX, Standby};
pub use node::{Node, Reach, System};
pub use output::{Level, LineFormat, Output};
pub use plan::{bounds, records_left};
pub use principal::Principal;
pub use program::{MissingProgram, find_program};
pub use reader::{is_word as is_class_name, nearest};
pub use record::{RecordedItems, Recording, Sampling};
pub use replica::{REPLICAS_MAX, Replica};
pub use restart::{Restart, RestartPolicy};
pub use rohrpost_mailbox::OverflowPolicy;
pub use saved::{Saved, SavedDocument, SavedValue};
pub use scheduling::{FIFO_MAX, Scheduling};
pub use settings::Document;
pub use sources::resolved_text;
pub use standby::{HOLDERS_FILE, LeaseTimes, MOVING_MODULES_MAX, holder_line, holders};
pub use stream::{RECORD_BYTES_MAX, StreamSpec};
pub use tcp::{TCP_SERVER, Tcp};
pub use team::{RosterMistake, TEAM_PEERS_MAX, Team, TeamHost, TeamPeer, TeamReach, hosts, roster};
pub use time::{ClockSetPolicy, TimeSource};
pub use units::{
    UnitError, duration_decimal, duration_text, parse_duration, parse_rate, parse_size, rate_text, size_text,
};
pub use watchdog::Watchdog;

/// Examples of the book, which lies outside the package: only tests of documentation have it.
#[cfg(doctest)]
#[doc = include_str!("../../docs/src/configuration.md")]
pub mod manual {}
