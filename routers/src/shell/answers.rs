//! The answers that senders of undeliverable commands get: so they need not wait for their timeout, and learn why.

use super::ways::{Reach, Ways};
use crate::frame::NodeIndex;
use crate::link::State;
use crate::report::Mismatch;
use crate::settings::Settings;
use crate::stats::{Cause, Stats};
use rohrpost_mailbox::{Head, Kind, Options, Participant, Type, monotonic_ns};
use std::sync::Arc;

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
    /// Appends the answer to a command whose body begins with these bytes, [`BEGINNING_BYTES`] of it at least; false when it is not
    /// one that can be answered.
    ///
    /// [`BEGINNING_BYTES`]: crate::report::BEGINNING_BYTES
    fn write(&self, call: &[u8], why: &Undelivered<'_>, answer: &mut Vec<u8>) -> bool;
}

/// Answers in the name of modules that cannot.
pub(super) struct Answers {
    settings: Arc<Settings>,
    stats: Arc<Stats>,
    faults: Arc<dyn Faults>,
    ways: Ways,
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
            body: Vec::with_capacity(ANSWER_BYTES_MAX),
        }
    }

    /// Answers a command, of whose body this is the beginning; for all other packages nobody waits.
    pub(super) fn answer(
        &mut self,
        peer: Option<NodeIndex>,
        head: &Head,
        body: &[u8],
        cause: Cause,
        takes_bytes: Option<usize>,
    ) {
        let Kind::Command(number) = head.kind.kind() else { return };
        if !head.from.is_mailbox() {
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
        if !self.faults.write(body, &why, &mut self.body) {
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
