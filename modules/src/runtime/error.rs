//! Why a module did not start.

use super::stream::{RecordError, StreamReadError};
use crate::journal::RunError;
use crate::output::errno_of;
use rohrpost_config::{Errors, NameTextError, SettingsError};
use rohrpost_mailbox::{CreateError, NodeError};
use std::error::Error;
use std::path::PathBuf;

/// Why a module did not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The command line.
    #[error("{0}\nusage: --config FILE --name CLASS.INSTANCE [--off]")]
    Usage(String),
    /// The configuration.
    #[error(transparent)]
    Config(#[from] Errors),
    /// The name given.
    #[error(transparent)]
    Name(#[from] NameTextError),
    /// No such module.
    #[error("{0}: no [[module]] is called `{1}`")]
    NoModule(PathBuf, String),
    /// The module's settings.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The node.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// A mailbox, which the text names as the configuration does.
    #[error("{0}")]
    Mailbox(String, #[source] CreateError),
    /// An alias without an interface.
    #[error("`{0}` is an alias of `{1}`, but that program has no interface of class `{2}`")]
    Endpoint(String, String, String),
    /// An interface without a name that it is reached by.
    #[error(
        "the program of `{module}` serves an interface of class `{interface}`, but the module is called {names}: \
         nobody could call it, and its data could not be published; give the module a name or an alias of class \
         `{interface}`, or run another program"
    )]
    Interface {
        /// The module.
        module: String,
        /// Its names.
        names: String,
        /// Class of the interface.
        interface: &'static str,
    },
    /// A stream of the configuration that the program does not have.
    #[error(
        "{place}: `{module}` has a section [module.stream.{stream}], but none of its interfaces has such a stream: \
         {known}; remove the section, or write the name that follows `fn` in the interface"
    )]
    NoStream {
        /// File and line of the section.
        place: String,
        /// The module.
        module: String,
        /// The stream.
        stream: String,
        /// Which there are.
        known: String,
    },
    /// A stream that cannot be made; the text names it as the configuration does.
    #[error("{0}")]
    Stream(String),
    /// A name that the module cannot stand in for.
    #[error(
        "the program of `{module}` stands in for `{name}`, a module of class `{class}`, but {why}; it stands in for \
         names of its own, each of the class that its description says"
    )]
    StandIn {
        /// The module.
        module: String,
        /// For which it stands in.
        name: String,
        /// As the description has it.
        class: String,
        /// What is wrong.
        why: &'static str,
    },
    /// A run that cannot be repeated.
    #[error(transparent)]
    Exact(#[from] RunError),
    /// Launch is gone, or out of sight.
    #[error(
        "launch, process {0}, ended before this module began, or is no ancestor of this process: a program between \
         them must wait for it (no `&`, no daemon, no pid namespace), or best become it (`exec`)"
    )]
    Orphan(u32),
    /// The module said no.
    #[error("{module}: {text}")]
    Module {
        /// The module.
        module: String,
        /// What it said.
        text: String,
        /// The number of the kernel's error, if one is behind it.
        errno: Option<u16>,
        /// The configuration or the program is wrong.
        is_configuration: bool,
    },
    /// The system said no.
    #[error("{0}: {1}")]
    System(&'static str, #[source] std::io::Error),
}

impl StartError {
    /// Exit code of a program that was configured wrongly (EX_CONFIG of sysexits.h): started again, it would end the
    /// same way.
    pub const CONFIGURATION: u8 = 78;

    /// The number of the kernel's error, if one is behind it.
    pub fn errno(&self) -> Option<u16> {
        match self {
            Self::Module { errno, .. } => *errno,
            other => errno_of(other),
        }
    }

    /// The exit code that tells launch whether starting again may help.
    pub fn exit_code(&self) -> u8 {
        match self {
            // As command lines everywhere do.
            Self::Usage(_) => 2,
            Self::Config(_)
            | Self::Name(_)
            | Self::NoModule(..)
            | Self::Settings(_)
            | Self::Endpoint(..)
            | Self::StandIn { .. }
            | Self::NoStream { .. }
            | Self::Interface { .. }
            | Self::Module { is_configuration: true, .. } => Self::CONFIGURATION,
            Self::Node(_)
            | Self::Mailbox(..)
            | Self::Stream(_)
            | Self::Exact(_)
            | Self::Orphan(_)
            | Self::Module { .. }
            | Self::System(..) => 1,
        }
    }
}

/// Whether an error, or one behind it, says that the configuration is wrong.
pub(crate) fn is_misconfigured(error: &(dyn Error + 'static)) -> bool {
    std::iter::successors(Some(error), |error| (*error).source()).any(|error| {
        let of_context = || error.downcast_ref::<ContextError>().is_some_and(ContextError::is_configuration);
        error.is::<NameTextError>() || error.is::<SettingsError>() || of_context()
    })
}

/// Why a module cannot speak to another.
#[derive(Debug, thiserror::Error)]
pub enum ContextError {
    /// The text names no module.
    #[error(transparent)]
    Name(#[from] NameTextError),
    /// A proxy or subscription of another class.
    #[error("`{module}` is of class `{class}`, but this speaks to class `{wanted}`")]
    Class {
        /// What was named.
        module: String,
        /// Its class.
        class: String,
        /// The interface's class.
        wanted: &'static str,
    },
    /// A subscription into a mailbox that this module has not opened.
    #[error("this module has no mailbox {0} for data; make it with `open_mailbox` before it is subscribed into")]
    NoMailbox(u8),
    /// More subscriptions than have ids.
    #[error("this module has 65536 subscriptions, and no id for another")]
    TooMany,
    /// Data that no endpoint of this module publishes.
    #[error(
        "this module has no name of class `{0}`; add one to `aliases` in the configuration, or to its `Interfaces`"
    )]
    NoName(&'static str),
    /// Data of an interface that the program does not serve under the name that has its class.
    #[error(
        "data `{data}` of an interface of class `{class}` cannot be published as `{module}`: its program does not \
         serve that interface there, so nobody could subscribe to it; add it to the module's `Interfaces`"
    )]
    Undeclared {
        /// The data.
        data: &'static str,
        /// Class of its interface.
        class: &'static str,
        /// The module or endpoint.
        module: String,
    },
    /// Data of a module that this one does not stand in for, or that the description does not have.
    #[error("this module does not stand in for {module} with data or a stream of number {number}")]
    NotStoodIn {
        /// As which it was to be published.
        module: String,
        /// Number of the data.
        number: u16,
    },
    /// The value cannot be written as postcard.
    #[error("data `{0}` cannot be written: {1}")]
    Encode(&'static str, postcard::Error),
    /// The node's time is not to be told by a module.
    #[error("the time of this node is not a log's; write `source = \"log\"` into [time], or do not tell the time")]
    OtherTime,
    /// Something of the node cannot be opened.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// It is not data but a stream, which is written as such.
    #[error("`{0}` is a stream: write it with `write` or `begin`, which publish it, too")]
    IsStream(&'static str),
    /// A value that did not become a record of a stream.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A stream that cannot be read.
    #[error(transparent)]
    Read(#[from] StreamReadError),
    /// A stream of another node.
    #[error(
        "stream `{stream}` of {module} is on node `{node}`, and this node has no [[replica]] of it; add one, or \
         subscribe to its values with `subscribe(PORT.data(), …)`"
    )]
    FarStream {
        /// The stream.
        stream: String,
        /// The module.
        module: String,
        /// Its node; `?` beyond the LAN.
        node: String,
    },
}

impl ContextError {
    /// Whether the configuration or the program is wrong, so that asking again does not help.
    pub fn is_configuration(&self) -> bool {
        match self {
            Self::Name(_)
            | Self::Class { .. }
            | Self::NoMailbox(_)
            | Self::NoName(_)
            | Self::Undeclared { .. }
            | Self::NotStoodIn { .. }
            | Self::OtherTime
            | Self::IsStream(_)
            | Self::FarStream { .. } => true,
            Self::TooMany | Self::Encode(..) | Self::Node(_) | Self::Record(_) | Self::Read(_) => false,
        }
    }
}
