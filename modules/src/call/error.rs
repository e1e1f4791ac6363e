//! Errors of calls: of the caller, the server and the routers.

use super::envelope::TRANSIT_MAX;
use super::noted::{NotedSendError, name};
use super::{CallEnvelope, ReplyEnvelope};
use crate::call::append;
use crate::common::HASH;
use crate::output::plain::line;
use rohrpost_mailbox::{Name, SendError};
use rohrpost_schema::Schema;
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use std::time::Duration;

/// Why the server did not run a command; the body of a reply with the option `error`. Shown, what others wrote in it
/// stays in its line.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum Fault {
    /// The module is switched off.
    #[error("the module is off; switch it on first")]
    ModuleOff,
    /// The module has stopped working; it takes no commands until it is switched on again.
    #[error("the module is in error: {}", line(.0))]
    ModuleError(String),
    /// It may have been run, or not: the server was restarted in between.
    #[error("interrupted, outcome unknown: the server was restarted while it had this command")]
    Interrupted,
    /// The caller was compiled with another interface; the server's hash.
    #[error("{}", differs(*server))]
    InterfaceDiffers {
        /// Hash of the server's interface.
        server: u32,
    },
    /// No such function or data.
    #[error("the module has no function or data with number {0}; `describe` lists what it has")]
    Unknown(u16),
    /// The arguments are not what the function takes.
    #[error("the arguments cannot be read: {}", line(.0))]
    Arguments(String),
    /// The command was too old when its turn came. It was not run.
    #[error(
        "the command was older than its validity, or than the minute for which a server runs it, when its turn came"
    )]
    Expired,
    /// There is no place for another caller or subscription of its sender. It was not run.
    #[error(
        "the server has no place for another caller or subscription from there: its share is used up, or all are \
         taken; end some, try again \
         later, or name the server in the caller's `calls`, which keeps places for it"
    )]
    Busy,
    /// The module has no such data yet.
    #[error("no such data has been made yet")]
    NothingYet,
    /// The result does not fit in the caller's reply mailbox, or in a package.
    #[error("the result of {0} bytes does not fit in a package")]
    TooLarge(u32),
    /// A router: the module's node has no such mailbox. This try was not run; nor were those below.
    #[error("its node has no such mailbox: does it run there? (`rohrpost start`, on that node, starts it)")]
    NoMailbox,
    /// A router: the module's mailbox had no room.
    #[error("its mailbox was full; it is slow or stopped, or has too few slots")]
    MailboxFull,
    /// A router: the module's mailbox takes no such body; the largest that it takes, bytes.
    #[error("its mailbox takes bodies of at most {0} bytes; raise its `size` in the configuration")]
    CommandTooLarge(u32),
    /// A router: the name is on no node that it knows.
    #[error(
        "no router knows a way there; are all nodes launched with the same configuration, one that has this module?"
    )]
    NoRoute,
    /// A router: nothing has come from the module's node for a while.
    #[error(
        "node {} is silent; is it on, does its router run, and is it reached at its address? (`rohrpost net`, on both)",
        line(.node)
    )]
    NodeSilent {
        /// The node.
        node: String,
    },
    /// A router: the module's node is heard, but says that it does not hear this one.
    #[error(
        "node {} is heard, but does not hear this one; is a firewall in between, or a cable half broken? (`rohrpost \
         net`, on both)",
        line(.node)
    )]
    NodeDeaf {
        /// The node.
        node: String,
    },
    /// A router: the module's node takes nothing from the caller's.
    #[error("node {} takes nothing from this one: {}", line(.node), line(.why))]
    NodeRefuses {
        /// The node.
        node: String,
        /// What differs, and what would be right.
        why: String,
    },
    /// A router: too much waits already to leave the caller's node.
    #[error(
        "the router had no room for it: this module sends more than `quota` of [network] lets wait, or the network is \
         slower than what is sent (`rohrpost net`)"
    )]
    RouterFull,
    /// A router: the package has been under way for too long, and was dropped.
    #[error("it waited too long for the network; more important packages used up its rate (`rohrpost net`)")]
    Delayed,
    /// A router or the module itself: the caller's class may not command this one.
    #[error(
        "node {} refuses it: {}, [access], lists the classes that may command this one, and the caller's is not among \
         them",
        line(.node), line(.rule)
    )]
    NotAllowed {
        /// The module's node.
        node: String,
        /// File and line of the rule.
        rule: String,
    },
    /// A later incarnation of the caller has called this server, so this command is of one that is over, or seems so.
    /// This try was not run.
    #[error(
        "a later incarnation of this caller has called it already: two programs have this name, or the computer's \
         clock was set back \
         before the node was launched; this passes {} s after the later one's last call was over",
        TRANSIT_MAX.as_secs()
    )]
    EarlierIncarnation,
}

impl Fault {
    /// Appends the body of a reply that says this to a command, of which `command` is the body or at least its
    /// envelope; false when it is none that can be answered.
    pub fn answer(&self, command: &[u8], reply: &mut Vec<u8>) -> bool {
        let Ok((call, _)) = CallEnvelope::split(command) else { return false };
        let before = reply.len();
        reply.extend_from_slice(&ReplyEnvelope { incarnation: call.incarnation, sequence: call.sequence }.to_bytes());
        let written = append(reply, self).is_ok();
        if !written {
            reply.truncate(before);
        }
        written
    }

    /// Whether it speaks of one try of a command alone: another try of the same may be run, or have been.
    pub const fn is_of_this_try(&self) -> bool {
        match self {
            Self::Busy
            | Self::NoMailbox
            | Self::MailboxFull
            | Self::CommandTooLarge(_)
            | Self::NoRoute
            | Self::NodeSilent { .. }
            | Self::NodeDeaf { .. }
            | Self::NodeRefuses { .. }
            | Self::RouterFull
            | Self::Delayed
            | Self::NotAllowed { .. }
            | Self::EarlierIncarnation => true,
            Self::ModuleOff
            | Self::ModuleError(_)
            | Self::Interrupted
            | Self::InterfaceDiffers { .. }
            | Self::Unknown(_)
            | Self::Arguments(_)
            | Self::Expired
            | Self::NothingYet
            | Self::TooLarge(_) => false,
        }
    }
}

/// A version of the common functions is a small number; a hash of an interface is one once in 65 536 times.
fn differs(server: u32) -> String {
    if server <= u16::MAX.into() {
        return format!(
            "the module has common functions of version {server}, this program has {HASH}: run programs of the same \
             version of Rohrpost (`rohrpost version`)"
        );
    }
    format!(
        "interface differs: the module has {server:#010x}; build caller and module from the same version of the \
         interface and of Rohrpost (`rohrpost version`)"
    )
}

/// Why a call has no result. `E` is the function's own error.
///
/// ```
/// use rohrpost_modules::call::{CallError, Fault};
///
/// fn may_have_run(error: &CallError) -> bool {
///     matches!(error, CallError::Timeout(..) | CallError::Fault(_, Fault::Interrupted))
/// }
/// ```
#[derive(Debug, Serialize, Deserialize, thiserror::Error)]
#[serde(bound = "")]
pub enum CallError<E = Infallible> {
    /// No answer in time. The command may have been run, or not; it is no longer valid.
    #[error("no answer from {0} within {1:?}; does it run, and is it not too busy?")]
    Timeout(#[serde(with = "name")] Name, Duration),
    /// The command could not be sent, and was not run.
    #[error(transparent)]
    NotSent(
        #[from]
        #[serde(with = "NotedSendError")]
        SendError,
    ),
    /// Too many calls to this module, or in all, are under way. The command was not sent.
    #[error("too many calls to {0} are under way; wait for earlier ones, or give them up")]
    TooMany(#[serde(with = "name")] Name),
    /// The server did not run it.
    #[error("{0}: {1}")]
    Fault(#[serde(with = "name")] Name, Fault),
    /// The answer is not what the interface promises.
    #[error("the answer of {0} cannot be read: {1}")]
    BadReply(#[serde(with = "name")] Name, String),
    /// The arguments do not fit in a package.
    #[error("the arguments cannot be written: {0}")]
    BadArguments(String),
    /// The function was run and returned its own error. No journal has it as an error.
    #[serde(skip)]
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
