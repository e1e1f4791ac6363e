//! What a module asks its runtime: stands in front of the answer, so that a build that asks otherwise is found.

use rohrpost_mailbox::{Name, StreamId};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What is asked, as far as the kind of the entry does not say it.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) enum Question<'a> {
    /// The kind of the entry says it.
    Plain,
    /// Of a stream.
    Of(AskedStream),
    /// Of a stream, and the module waits so long.
    Within(AskedStream, u64),
    /// Of a stream, by sequence.
    Sequence(AskedStream, u64),
    /// Of a stream, by epoch and time.
    Time(AskedStream, u64, u64),
    /// A stream of the interface with this hash.
    Interface(AskedStream, u32),
    /// A record of its own stream: which of its names, number, and stamp.
    Own { endpoint: u16, number: u16, stamp_ns: u64 },
    /// The call with this number, to this module.
    Call { to: u32, sequence: u32 },
    /// A file, as the settings name it.
    File(&'a str),
    /// Data of a module, each or once in a period, to a mailbox.
    Data { from: u32, number: u16, interface: u32, mailbox: u8, period_ns: Option<u64> },
    /// A period.
    Period(u64),
    /// Bytes that there is room for.
    Room(u64),
    /// What a descriptor is watched for.
    Watch(AskedInterest),
    /// A watched descriptor.
    Watched(u32),
    /// Each record of a stream of the interface with this hash.
    Followed(AskedStream, u32),
    /// The followed stream with this number.
    Rewound(u16),
    /// A mailbox of its own: slots, bytes of the largest body, and whether it takes data from all.
    Mailbox { local: u8, slots: u16, bytes: u16, is_to_all: bool },
    /// The followed stream with this number, and the sequence of a record.
    RewoundTo(u16, u64),
}

/// What a descriptor is watched for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(crate) enum AskedInterest {
    Read,
    Write,
    Both,
}

/// A stream.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(crate) struct AskedStream {
    name: u32,
    number: u16,
}

/// A time as entries have it.
pub(crate) fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}

impl From<StreamId> for AskedStream {
    fn from(StreamId { name, number }: StreamId) -> Self {
        Self { name: name.raw(), number }
    }
}

impl std::fmt::Display for AskedStream {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "stream {} of {}", self.number, Name::from_raw(self.name))
    }
}

impl Question<'_> {
    /// In words; none if there is nothing to say.
    pub(super) fn words(&self) -> Option<String> {
        Some(match *self {
            Self::Plain => return None,
            Self::Of(stream) => stream.to_string(),
            Self::Within(stream, ns) => format!("{stream}, within {ns} ns"),
            Self::Sequence(stream, sequence) => format!("{stream}, sequence {sequence}"),
            Self::Time(stream, epoch, ns) => format!("{stream}, {ns} ns of epoch {epoch}"),
            Self::Interface(stream, hash) => format!("{stream}, interface {hash:08x}"),
            Self::Own { endpoint, number, stamp_ns } => {
                format!("stream {number} under its name {endpoint}, of {stamp_ns} ns")
            }
            Self::Call { to, sequence } => format!("call {sequence}, of {}", Name::from_raw(to)),
            Self::File(path) => format!("{path:?}"),
            Self::Data { from, number, interface, mailbox, period_ns } => {
                let rate = period_ns.map_or_else(|| "each".into(), |ns| format!("once in {ns} ns"));
                let from = Name::from_raw(from);
                format!("data {number} of {from}, interface {interface:08x}, to mailbox {mailbox}, {rate}")
            }
            Self::Period(ns) => format!("once in {ns} ns"),
            Self::Room(bytes) => format!("at most {bytes} bytes"),
            Self::Watch(AskedInterest::Read) => "to read".into(),
            Self::Watch(AskedInterest::Write) => "to write".into(),
            Self::Watch(AskedInterest::Both) => "to read or write".into(),
            Self::Watched(number) => format!("descriptor {number}"),
            Self::Followed(stream, hash) => format!("each record of {stream}, interface {hash:08x}"),
            Self::Rewound(number) => format!("followed stream {number}"),
            Self::RewoundTo(number, sequence) => format!("followed stream {number}, to sequence {sequence}"),
            Self::Mailbox { local, slots, bytes, is_to_all } => {
                let of = if is_to_all { " of all" } else { "" };
                format!("mailbox {local}, {slots} slots of {bytes} bytes, for data{of}")
            }
        })
    }
}
