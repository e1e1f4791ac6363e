//! The answers that senders of undeliverable commands get: so they need not wait for their timeout, and learn why.

use super::ways::{Reach, Ways};
use crate::frame::NodeIndex;
use crate::link::State;
use crate::report::Mismatch;
use crate::settings::Settings;
use crate::stats::{Cause, Stats};
use rohrpost_mailbox::{Head, Kind, Name, Options, Participant, Type, monotonic_ns};
use std::sync::Arc;

/// Bytes of a command's body that its answer may need.
pub const CALL_BYTES: usize = 32;
/// Commands whose beginnings are remembered while they wait in the queue. Of one that waits behind so many others the beginning is
/// gone, and so its sender gets no answer.
const CALLS_KEPT: usize = 1024;
/// Longest answer.
const ANSWER_BYTES_MAX: usize = 1024;

/// Why a command goes no further.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Undelivered<'a> {
    /// What happened.
    pub cause: Cause,
    /// The node that it was for.
    pub node: Option<&'a str>,
    /// What differs between that node and this one, if one of them refuses the other.
    pub mismatch: Option<Mismatch>,
    /// Of a command too large: bytes of a body that its mailbox takes.
    pub takes_bytes: Option<usize>,
}

/// Writes the bodies of such answers: what a fault looks like is not the routers' business.
pub trait Faults: Send + Sync {
    /// Appends the answer to a command whose body begins with these bytes; false when it is not one that can be answered.
    fn write(&self, call: &[u8], why: &Undelivered<'_>, answer: &mut Vec<u8>) -> bool;
}

/// The beginning of a command that waits.
#[derive(Clone, Copy, Default)]
struct Call {
    from: Name,
    to: Name,
    id: u16,
    len: u8,
    bytes: [u8; CALL_BYTES],
}

/// Answers in the name of modules that cannot.
pub(super) struct Answers {
    settings: Arc<Settings>,
    stats: Arc<Stats>,
    faults: Arc<dyn Faults>,
    ways: Ways,
    /// By a number made of `from` and `id`.
    calls: Box<[Call]>,
    body: Vec<u8>,
}

impl Answers {
    pub(super) fn new(
        settings: &Arc<Settings>,
        stats: &Arc<Stats>,
        faults: &Arc<dyn Faults>,
        participant: &Arc<Participant>,
    ) -> Self {
        Self {
            settings: settings.clone(),
            stats: stats.clone(),
            faults: faults.clone(),
            ways: Ways::new(participant, Reach::Everywhere),
            calls: vec![Call::default(); CALLS_KEPT].into(),
            body: Vec::with_capacity(ANSWER_BYTES_MAX),
        }
    }

    /// Remembers how a command begins, before its body goes out of sight.
    pub(super) fn note(&mut self, head: &Head, body: &[u8]) {
        if !matches!(head.kind.kind(), Kind::Command(_)) {
            return;
        }
        let len = body.len().min(CALL_BYTES);
        let call = &mut self.calls[place(head)];
        (call.from, call.to, call.id, call.len) = (head.from, head.to, head.id, len as u8);
        call.bytes[..len].copy_from_slice(&body[..len]);
    }

    /// Answers a command whose beginning was noted; all other packages nobody waits for.
    pub(super) fn answer(&mut self, peer: Option<NodeIndex>, head: &Head, cause: Cause, takes_bytes: Option<usize>) {
        let Kind::Command(number) = head.kind.kind() else { return };
        let call = self.calls[place(head)];
        let noted = (call.from, call.to, call.id) == (head.from, head.to, head.id);
        if !noted || !head.from.is_mailbox() {
            return;
        }
        let settings = self.settings.clone();
        let node = peer.and_then(|peer| settings.nodes.get(usize::from(peer)));
        let mismatch = peer.and_then(|peer| match self.stats.state(peer, monotonic_ns()) {
            State::Refused(mismatch) => Some(mismatch),
            _ => None,
        });
        let why = Undelivered { cause, node: node.map(|node| node.name.as_str()), mismatch, takes_bytes };
        self.body.clear();
        if !self.faults.write(&call.bytes[..usize::from(call.len)], &why, &mut self.body) {
            return;
        }
        let answer = Head {
            to: head.from,
            from: head.to,
            len: self.body.len() as u16,
            kind: Type::reply(number),
            options: Options::ERROR,
            ..*head
        };
        // Who has gone, or takes no more answers, waits for its timeout.
        let _ = self.ways.send(&answer, &self.body);
    }
}

/// Where the beginning of a command is kept: those of one sender lie one behind the other.
fn place(head: &Head) -> usize {
    (head.from.raw().wrapping_mul(0x9e37_79b1) as usize >> 16).wrapping_add(head.id.into()) % CALLS_KEPT
}
