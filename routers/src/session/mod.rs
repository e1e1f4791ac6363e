//! Sessions over streams of bytes: what neither the local nor the LAN layer can deliver goes through one central server
//! (seed 002, 3.2).
//!
//! ```text
//!  a node, a laptop, a foreign program                the server                            another client
//!  packages ─▶ Outgoing ═ bytes ═▶ Splitter ─▶ RoutingTable: host? ─▶ Outgoing ═ bytes ═▶ Splitter ─▶ mailboxes
//!               └── Client: reconnects, registers, asks the time          └── of each client, bounded, by priority
//! ```
//!
//! Neither end knows a socket, a thread or a clock: time comes as an argument, and what the stream brings as bytes,
//! split anywhere. Under TLS it is the decrypted stream.
//!
//! What holds: a package is handed to a stream once, and never again; what a connection takes along when it breaks is
//! lost. Packages of one sender, receiver and priority stay in their order. No client can make the server wait, and
//! nobody can use more than its share of places, ranges, memory or line by connecting more often: shares go by
//! principal.
//!
//! Replicas go by the same streams: a part is made ready when nothing else is. While packages wait, that is one between
//! two batches of them, if it is more important or they are of another party. So a package waits for one part at most,
//! and no queue holds records: see [`LineReplicas`].

pub mod client;
mod counts;
mod estimate;
pub mod frame;
mod ledger;
mod outgoing;
pub mod server;
mod splitter;
mod table;

pub use counts::{Cause, SessionClassCounts, SessionCounts};
pub use estimate::{Bounded, ServerClockEstimate};
pub use outgoing::BATCH_BYTES;
pub use table::{Conflict, ENTRIES_MAX, RoutingTable};

use crate::replication::LineReplicas;
use rohrpost_mailbox::{Head, Kind, Name, Options, Type};

/// A client by its place at the server; free again when its connection has been closed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct ClientIndex(pub u16);

/// Longest time from the publishing of a package to its leaving by a stream.
pub const WAIT_MAX_NS: u64 = crate::outbound::WAIT_MAX_NS;
/// Longest time from the publishing of a package to its delivery, as far as clocks can tell: a tenth of a second less
/// than "at most once" relies on, for the way into the mailbox.
pub const AGE_MAX_NS: u64 = 1_900_000_000;
/// A client asks for the time this often, which also says that it is there.
pub const ASK_EVERY_NS: u64 = 1_000_000_000;
/// An end of which nothing came for so long is gone.
pub const SILENT_AFTER_NS: u64 = 3_500_000_000;
/// The same where it is known to be slow: in the middle of a frame, or by how little leaves. What is lost on the way
/// takes seconds there.
pub const SLOW_SILENT_AFTER_NS: u64 = 8_000_000_000;
/// An end that has taken nothing of what is ready for so long is gone.
pub const STALLED_AFTER_NS: u64 = 10_000_000_000;
/// Longest time from the beginning of a connection to its welcome; however busily bytes come.
pub const HANDSHAKE_MAX_NS: u64 = 5_000_000_000;
/// Longest time from the first byte of a frame to its last.
pub const FRAME_MAX_NS: u64 = 30_000_000_000;
/// Interval between two looks for what only the passing of time changes.
pub const LOOK_EVERY_NS: u64 = 100_000_000;

/// What both ends of sessions need from the code that runs them.
pub trait EndHost {
    /// Appends the answer to a command that goes no further, with a body that begins with these bytes. The routers do
    /// not know how an error is encoded. `holder`: the client that it was for. False: it gets none.
    fn answer(&mut self, call: &[u8], why: Cause, holder: Option<&str>, answer: &mut Vec<u8>) -> bool;

    /// Replicas of this end; none: it has none, and what comes of such is not counted.
    fn replicas(&mut self) -> Option<&mut LineReplicas> {
        None
    }
}

/// The answer to a command that goes no further, in the name of the module that it was for. None for what nobody waits
/// for, and for what was handed out before: it may have been run.
pub(crate) fn answer_to(
    head: &Head,
    call: &[u8],
    why: Cause,
    holder: Option<&str>,
    answers: &mut impl EndHost,
) -> Option<(Head, Vec<u8>)> {
    let Kind::Command(number) = head.kind.kind() else { return None };
    let is_answered = head.from.is_mailbox() && head.to.is_mailbox() && why.told().is_some();
    if !is_answered || head.options.has(Options::REDELIVERED) {
        return None;
    }
    let mut body = Vec::new();
    if !answers.answer(call, why, holder, &mut body) {
        return None;
    }
    let len = u16::try_from(body.len()).ok()?;
    let kind = Type::reply(number);
    Some((Head { to: head.from, from: head.to, len, kind, options: Options::ERROR, ..*head }, body))
}

/// The same mailbox in another system.
pub(crate) fn in_system(name: Name, system: u8) -> Name {
    Name::new(system, name.class().0, name.instance(), name.local())
}

#[cfg(test)]
mod tests;
