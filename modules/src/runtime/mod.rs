//! What runs a module: it joins the node, makes the mailboxes, and turns packages into calls of the module's functions.
//!
//! ```text
//!             ┌──────────────── one thread ────────────────┐
//!  commands ─▶│ server: once? hosted: dispatch, reply      │─▶ replies
//!  data     ─▶│ runner: received, tick, on, off            │─▶ data of subscriptions
//!  records  ─▶│ stream: of others, by time or one by one   │─▶ records of own streams
//!  replies  ─▶│ link: proxies' calls, renewals             │─▶ commands
//!             └────────────────────────────────────────────┘
//! ```

mod clock;
mod context;
mod endpoint;
#[doc(hidden)]
pub mod environment;
mod error;
mod exact;
mod exchange;
mod follow;
mod here;
mod host;
mod hosted;
mod incarnation;
mod newest;
pub(crate) mod own_end;
mod parameters;
mod received;
pub(crate) mod refusals;
mod run;
mod runner;
mod running_command;
pub(crate) mod schedule;
pub(crate) mod server;
mod start;
mod stream;
mod subscribed;
mod time_teller;
mod unreadable;
mod wanted;
pub(crate) mod work;

pub use clock::{ModuleClock, clock_was_set};
pub use context::Context;
pub(crate) use error::is_misconfigured;
pub use error::{ContextError, StartError};
pub use follow::{BadRate, Rate, Subscription};
pub use here::{CONFIG_FILE, NotHere, NotedNode, configuration_here, open_here};
pub use host::{ClientError, ToolLink, describe};
pub use received::Received;
pub use run::{exit, run, run_described, run_started, tell_exit};
pub use running_command::{CommandFacts, RunningCommand};
pub use schedule::WakeUp;
pub use server::{read_arguments, write_result};
pub use start::{Start, find_running, find_unusable, kept};
pub use stream::{
    Moment, OpenValue, Record, RecordError, StayingBytes, Stream, StreamReadError, StreamSubscription, SuspendedValue,
};
pub use subscribed::Subscribed;
pub use time_teller::TimeTeller;
pub use unreadable::Unreadable;
