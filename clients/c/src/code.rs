//! How calls end.

use rohrpost_config::{Errors, NameTextError};
use rohrpost_mailbox::{CreateError, NodeError, SendError, StreamError, WriteError};
use rohrpost_modules::parameter::Refusal;
use rohrpost_modules::runtime::{ContextError, RecordError, StreamReadError};
use rohrpost_native::{CallError, NativeError};
use std::ffi::CStr;
use std::fmt::Display;

/// How a call ended: 0 when it is done, above 0 when there is nothing to hand out, below 0 when it failed.
#[repr(i32)]
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Code {
    /// Done.
    Ok = 0,
    /// Nothing is there (yet), or the time has passed.
    Nothing = 1,
    /// A reader of a stream has lost records; it goes on with the oldest that is still there.
    Lost = 2,
    /// A pointer that must not be null is.
    NullPointer = -1,
    /// An argument that cannot be: a reserved name, an impossible shape, a text that is not UTF-8.
    Value = -2,
    /// A buffer is too small.
    SmallBuffer = -3,
    /// No handle of this kind.
    Handle = -4,
    /// The handle was closed.
    Closed = -5,
    /// The handle belongs to another thread.
    Thread = -6,
    /// The handle was opened before this process was forked.
    Forked = -7,
    /// Something of this handle is in hand (a loan, a package, a record), or another call of this thread goes on.
    Busy = -8,
    /// A mistake in Rohrpost.
    Bug = -9,
    /// The system refused something.
    System = -10,
    /// There is no such node.
    NoNode = -11,
    /// Permission denied.
    Denied = -12,
    /// Made by another version of Rohrpost.
    OtherVersion = -13,
    /// A file in shared memory is damaged, or not Rohrpost's.
    Damaged = -14,
    /// All places are taken.
    Crowded = -15,
    /// The configuration cannot be used, or does not have what is asked for.
    Configuration = -16,
    /// There is no such mailbox on this node, and no router leads to it.
    NoMailbox = -17,
    /// The router that leads there does not run.
    NoRouter = -18,
    /// The mailbox is full.
    Full = -19,
    /// More bytes than fit.
    TooLarge = -20,
    /// Another process owns it.
    Owned = -21,
    /// No memory.
    Memory = -22,
    /// No file descriptor left.
    Descriptors = -23,
    /// A stamp is too far behind, or of an epoch that has ended.
    Late = -24,
    /// Bytes that are not of the type that is read.
    Malformed = -25,
    /// What a module itself calls a failure.
    Failed = -26,
    /// Only a function of a module that runs may call this, in its thread.
    Outside = -27,
    /// No answer in time: it may have been run, or not.
    Timeout = -28,
    /// The other module did not run it.
    Fault = -29,
    /// There is no such function, data, stream or parameter.
    NoItem = -30,
    /// The ring of a stream cannot be used, now or at all: its seats are taken, its file is missing or damaged. The
    /// last error says which.
    Ring = -31,
}

/// Words for each code.
const TEXTS: [(Code, &CStr); 34] = [
    (Code::Ok, c"done"),
    (Code::Nothing, c"nothing is there"),
    (Code::Lost, c"records were lost"),
    (Code::NullPointer, c"a pointer is null"),
    (Code::Value, c"an argument cannot be"),
    (Code::SmallBuffer, c"the buffer is too small"),
    (Code::Handle, c"no handle of this kind"),
    (Code::Closed, c"the handle was closed"),
    (Code::Thread, c"the handle belongs to another thread"),
    (Code::Forked, c"the handle was opened before this process was forked"),
    (Code::Busy, c"something of this handle is in hand"),
    (Code::Bug, c"a mistake in Rohrpost"),
    (Code::System, c"the system refused something"),
    (Code::NoNode, c"no such node"),
    (Code::Denied, c"permission denied"),
    (Code::OtherVersion, c"made by another version of Rohrpost"),
    (Code::Damaged, c"shared memory is damaged"),
    (Code::Crowded, c"all places are taken"),
    (Code::Configuration, c"the configuration does not have it"),
    (Code::NoMailbox, c"no such mailbox"),
    (Code::NoRouter, c"the router does not run"),
    (Code::Full, c"the mailbox is full"),
    (Code::TooLarge, c"more bytes than fit"),
    (Code::Owned, c"another process owns it"),
    (Code::Memory, c"no memory"),
    (Code::Descriptors, c"no file descriptor left"),
    (Code::Late, c"the stamp is too far behind"),
    (Code::Malformed, c"bytes that are not of this type"),
    (Code::Failed, c"the module failed"),
    (Code::Outside, c"only a function of a module may call this"),
    (Code::Timeout, c"no answer in time"),
    (Code::Fault, c"the other module did not run it"),
    (Code::NoItem, c"no such function, data, stream or parameter"),
    (Code::Ring, c"the stream's ring cannot be used"),
];

/// Words for a number, which may be no code.
pub(crate) fn text_of(number: i32) -> &'static CStr {
    let found = TEXTS.iter().find(|(code, _)| *code as i32 == number);
    found.map_or(c"not a code of Rohrpost", |(_, text)| text)
}

/// An error with a code.
pub(crate) trait Coded: Display {
    fn code(&self) -> Code;
}

impl Coded for NodeError {
    fn code(&self) -> Code {
        match self {
            Self::Io(..) | Self::Busy(_) => Code::System,
            Self::Foreign(..) | Self::Denied(_) => Code::Denied,
            Self::Version(..) => Code::OtherVersion,
            Self::Memory { .. } => Code::Memory,
            Self::Descriptors(_) => Code::Descriptors,
            Self::Damaged(_) => Code::Damaged,
            Self::Missing(_) => Code::NoNode,
            Self::Crowded(_) => Code::Crowded,
            Self::Launched(..) => Code::Owned,
        }
    }
}

impl Coded for SendError {
    fn code(&self) -> Code {
        match self {
            Self::NoMailbox(_) => Code::NoMailbox,
            Self::NoRouter { .. } => Code::NoRouter,
            Self::Full(_) => Code::Full,
            Self::TooLarge { .. } => Code::TooLarge,
            Self::InUse(_) => Code::Crowded,
            Self::Reclaimed(_) => Code::NoNode,
            Self::Bad(..) => Code::Damaged,
        }
    }
}

impl Coded for CreateError {
    fn code(&self) -> Code {
        match self {
            Self::Reserved(_) | Self::Shape(..) => Code::Value,
            Self::Owned(..) => Code::Owned,
            Self::Node(error) => error.code(),
            Self::Memory { .. } => Code::Memory,
            Self::Descriptors(_) => Code::Descriptors,
            Self::File(..) => Code::System,
        }
    }
}

impl Coded for StreamError {
    fn code(&self) -> Code {
        match self {
            Self::Reserved(_) | Self::Shape(..) => Code::Value,
            Self::Owned { .. } => Code::Owned,
            Self::Crowded { .. } => Code::Crowded,
            Self::Memory { .. } => Code::Memory,
            Self::Descriptors(_) => Code::Descriptors,
            Self::File(..) => Code::System,
            Self::Bad(..) => Code::Damaged,
            Self::Node(error) => error.code(),
        }
    }
}

impl Coded for WriteError {
    fn code(&self) -> Code {
        match self {
            Self::TooLarge { .. } => Code::TooLarge,
            Self::Unstamped(_) => Code::Value,
            Self::Late { .. } | Self::OldEpoch { .. } => Code::Late,
            Self::Damaged(_) => Code::Damaged,
        }
    }
}

impl Coded for Errors {
    fn code(&self) -> Code {
        Code::Configuration
    }
}

impl Coded for NameTextError {
    fn code(&self) -> Code {
        Code::Configuration
    }
}

impl Coded for NativeError {
    fn code(&self) -> Code {
        match self {
            Self::Context(error) => error.code(),
            Self::Call(error) => error.code(),
            Self::Read(error) => error.code(),
            Self::NoItem { .. } | Self::NoStream { .. } | Self::NoNumber(_) => Code::NoItem,
            Self::RecordOpen => Code::Busy,
            Self::NoRecordOpen => Code::Value,
            Self::System(_, error) => error.code(),
        }
    }
}

impl Coded for ContextError {
    fn code(&self) -> Code {
        match self {
            Self::Node(error) => error.code(),
            Self::Record(RecordError::TooLarge { .. }) => Code::TooLarge,
            Self::Record(RecordError::Late { .. } | RecordError::OldEpoch { .. }) => Code::Late,
            Self::Record(_) | Self::Encode(..) => Code::Value,
            Self::Read(error) => error.code(),
            Self::TooMany => Code::Crowded,
            Self::NotStoodIn { .. } => Code::NoItem,
            _ => Code::Configuration,
        }
    }
}

impl Coded for StreamReadError {
    fn code(&self) -> Code {
        match self {
            Self::Ring(_) => Code::Ring,
            Self::InterfaceDiffers { .. } => Code::OtherVersion,
            Self::Unreadable(_) => Code::Malformed,
        }
    }
}

impl Coded for CallError {
    fn code(&self) -> Code {
        match self {
            Self::Timeout(..) => Code::Timeout,
            Self::NotSent(error) => error.code(),
            Self::TooMany(_) => Code::Crowded,
            Self::Fault(..) => Code::Fault,
            Self::BadReply(..) => Code::Malformed,
            Self::BadArguments(_) => Code::TooLarge,
            Self::Module(_, never) => match *never {},
        }
    }
}

impl Coded for Refusal {
    fn code(&self) -> Code {
        match self {
            Self::NoParameters | Self::Unknown { .. } => Code::NoItem,
            _ => Code::Value,
        }
    }
}

impl Coded for std::io::Error {
    fn code(&self) -> Code {
        match self.raw_os_error() {
            Some(libc::EMFILE | libc::ENFILE) => Code::Descriptors,
            _ if self.kind() == std::io::ErrorKind::QuotaExceeded => Code::Crowded,
            _ => Code::System,
        }
    }
}
