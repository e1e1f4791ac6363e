//! What a module is called with.

use super::bytes::Blob;
use super::value::NotedValue;
use serde::{Deserialize, Serialize};

/// A call of the module's code by its runtime.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) enum JournalEvent<'a> {
    /// It is made.
    New,
    On,
    Off,
    Tick,
    /// Data, in a package or a record.
    Received {
        /// The publisher's name.
        from: u32,
        number: u16,
        origin: NotedOrigin,
        stamp_ns: u64,
        sequence: u32,
        missed: u32,
        incarnation: u32,
        #[serde(borrow)]
        value: NotedValue<'a>,
    },
    /// A function of its own, of the interface under its name of this index.
    Function {
        endpoint: u16,
        number: u16,
        arguments: Blob<'a>,
    },
    /// Parameters are to be set; postcard of the wish, and which module asks.
    Parameters {
        wish: Blob<'a>,
        by: &'a str,
    },
    /// A descriptor is ready.
    Ready {
        watch: u32,
        readable: bool,
        writable: bool,
    },
}

/// How data came.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) enum NotedOrigin {
    Package { mailbox: u8, id: u16 },
    Stream { id: u16, epoch: u64, ns: u64 },
}

/// An event, and the system time at which it came.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct EventAt<'a> {
    pub(crate) at_ns: u64,
    #[serde(borrow)]
    pub(crate) event: JournalEvent<'a>,
}

impl JournalEvent<'_> {
    /// In words.
    pub(super) fn words(&self) -> String {
        match self {
            Self::New => "is made".into(),
            Self::On => "is switched on".into(),
            Self::Off => "goes to its safe state".into(),
            Self::Tick => "ticks".into(),
            Self::Received { from, number, .. } => {
                format!("receives data {number} of {}", rohrpost_mailbox::Name::from_raw(*from))
            }
            Self::Function { number, .. } => format!("runs its function {number}"),
            Self::Parameters { by, .. } => format!("is given parameters (by {by})"),
            Self::Ready { watch, .. } => format!("finds descriptor {watch} ready"),
        }
    }
}
