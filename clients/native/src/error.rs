//! Why something that a module asked for cannot be had.

use rohrpost_modules::call::CallError;
use rohrpost_modules::output::plain::line;
use rohrpost_modules::runtime::{ContextError, StreamReadError};
use std::io;

/// Why something that a module asked for cannot be had. Shown, what others wrote in it stays in its line.
#[derive(Debug, thiserror::Error)]
pub enum NativeError {
    /// The node, its names, or the module's own streams and data.
    #[error(transparent)]
    Context(#[from] ContextError),
    /// Another module does not describe itself.
    #[error(transparent)]
    Call(#[from] CallError),
    /// A stream cannot be read.
    #[error(transparent)]
    Read(#[from] StreamReadError),
    /// Another module has no such data.
    #[error("{} has no data or stream `{}`; it has: {}", line(.module), line(.item), line(.known))]
    NoItem {
        /// The module.
        module: String,
        /// What was asked for.
        item: String,
        /// What there is.
        known: String,
    },
    /// It is data, of which nothing but the newest value is kept.
    #[error("`{}` of {} is no stream; follow it as data", line(.item), line(.module))]
    NoStream {
        /// The module.
        module: String,
        /// What was asked for.
        item: String,
    },
    /// The description says no such number.
    #[error("this module's interface has no data or stream of number {0}")]
    NoNumber(u16),
    /// One record is filled at a time.
    #[error("a record is being filled; finish it or give it up before anything else is published or written")]
    RecordOpen,
    /// There is none to be finished.
    #[error("no record is being filled; begin one first")]
    NoRecordOpen,
    /// A mailbox or timer that following needs.
    #[error("{0}: {1}")]
    System(&'static str, #[source] io::Error),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_wrote_stays_in_its_line() {
        let text = || "a\u{1b}[2J\nb".to_owned();
        let no_item = NativeError::NoItem { module: text(), item: text(), known: text() };
        let no_stream = NativeError::NoStream { module: text(), item: text() };
        for error in [no_item, no_stream] {
            let shown = error.to_string();
            assert!(!shown.contains(char::is_control) && shown.contains("a\\u001b[2J\\nb"), "{shown:?}");
        }
    }
}
