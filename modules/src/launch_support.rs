//! What launch shares with the modules that it starts: their environment, the signals that end them, their lines of
//! output, and how commands are taken. Public only because launch is another crate; not for users.

pub use crate::output::relay::{OutputProxy, Relay, WeakOutputProxy};
pub use crate::output::trace::LINES_MAX as TRACE_LINES_MAX;
pub use crate::output::{SENT, TRACED};
pub use crate::runtime::environment;
pub use crate::runtime::own_end::stop_signals;
pub use crate::runtime::refusals::{Cause, Refusals};
pub use crate::runtime::server::{Command, CommandHandler, CommandServer, admit};
pub use crate::runtime::work::in_words;
