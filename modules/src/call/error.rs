//! What may go wrong with a call, and who says so.

use postcard_schema::Schema;
use rohrpost_mailbox::{Name, SendError};
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use std::time::Duration;

/// Why the server did not run a command; the body of a reply with the option `error`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum Fault {
    /// The module is switched off.
    #[error("the module is off; switch it on first")]
    ModuleOff,
    /// The module has stopped working; it takes no commands until it is switched off and on.
    #[error("the module is in error: {0}")]
    ModuleError(String),
    /// It may have been run, or not: the server was restarted in between.
    #[error("interrupted, outcome unknown: the server was restarted while it had this command")]
    Interrupted,
    /// The caller was compiled with another interface; the server's hash.
    #[error(
        "interface differs: the module has {server:#010x}; build caller and module from the same version of the interface \
         and of Rohrpost (`rohrpost version`)"
    )]
    InterfaceDiffers {
        /// Hash of the server's interface.
        server: u32,
    },
    /// No such function or data.
    #[error("the module has no function or data with number {0}; `describe` lists what it has")]
    Unknown(u16),
    /// The arguments are not what the function takes.
    #[error("the arguments cannot be read: {0}")]
    Arguments(String),
    /// The command was too old when its turn came. It was not run.
    #[error("the command was older than its validity when its turn came")]
    Expired,
    /// Too many callers are being remembered, or there are too many subscriptions. It was not run.
    #[error("the server has no room for more callers or subscriptions; try again later, or end some")]
    Busy,
    /// The module has no such data yet.
    #[error("no such data has been made yet")]
    NothingYet,
    /// The result does not fit in the caller's reply mailbox, or in a package.
    #[error("the result of {0} bytes does not fit in a package")]
    TooLarge(u32),
}

/// Why a call has no result. `E` is the function's own error.
#[derive(Debug, thiserror::Error)]
pub enum CallError<E = Infallible> {
    /// No answer in time. The command may have been run, or not; it is no longer valid.
    #[error("no answer from {0} within {1:?}; does it run, and is it not too busy?")]
    Timeout(Name, Duration),
    /// The command could not be sent, and was not run.
    #[error(transparent)]
    NotSent(#[from] SendError),
    /// Too many calls to this module, or in all, are under way. The command was not sent.
    #[error("too many calls to {0} are under way; wait for earlier ones, or give them up")]
    TooMany(Name),
    /// The server did not run it.
    #[error("{0}: {1}")]
    Fault(Name, Fault),
    /// The answer is not what the interface promises.
    #[error("the answer of {0} cannot be read: {1}")]
    BadReply(Name, String),
    /// The arguments do not fit in a package.
    #[error("the arguments cannot be written: {0}")]
    BadArguments(String),
    /// The function was run and returned its own error.
    #[error("{1}")]
    Module(Name, E),
}

impl CallError {
    /// The same, for a function that has an error of its own.
    pub fn widen<E>(self) -> CallError<E> {
        match self {
            Self::Timeout(name, time) => CallError::Timeout(name, time),
            Self::NotSent(error) => CallError::NotSent(error),
            Self::TooMany(name) => CallError::TooMany(name),
            Self::Fault(name, fault) => CallError::Fault(name, fault),
            Self::BadReply(name, text) => CallError::BadReply(name, text),
            Self::BadArguments(text) => CallError::BadArguments(text),
            Self::Module(_, never) => match never {},
        }
    }
}
