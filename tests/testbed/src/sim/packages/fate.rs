//! What a router makes of each datagram, by its own counters, and whether what really happened to the datagram allows
//! that. What the wire left as it was, and brought to its receiver, is rejected for no cause but those of
//! [`Packages::is_allowed`].

use super::{Packages, STILL_NS, shown};
use crate::sim::promise::Promise;
use crate::sim::station::{Arrived, Io, Origin};
use rohrpost_routers::frame::{FrameHead, FrameKind, NodeIndex};
use rohrpost_routers::link::SILENT_AFTER_NS;
use rohrpost_routers::security::Rejection;

/// How a router counts a datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Fate {
    Taken,
    Duplicate,
    Old,
    Damaged,
    Refused,
    Foreign,
    Rejected(Rejection),
}

const FATES: [Fate; 14] = [
    Fate::Taken,
    Fate::Duplicate,
    Fate::Old,
    Fate::Damaged,
    Fate::Refused,
    Fate::Foreign,
    Fate::Rejected(Rejection::Unsealed),
    Fate::Rejected(Rejection::OtherKey),
    Fate::Rejected(Rejection::NotOurs),
    Fate::Rejected(Rejection::OtherIncarnation),
    Fate::Rejected(Rejection::Replay),
    Fate::Rejected(Rejection::Forged),
    Fate::Rejected(Rejection::Address),
    Fate::Rejected(Rejection::Version),
];

/// Counters of one source, one for each of [`FATES`].
pub(super) type Counted = [u64; FATES.len()];

impl Packages {
    /// What it counts of a source now; none: an address that no node has.
    pub(super) fn counted(&self, source: Option<usize>) -> Counted {
        let source = source.map(|node| node as NodeIndex);
        let received = source.map(|node| &self.stats.peer(node).received);
        FATES.map(|fate| match (fate, received) {
            (Fate::Foreign, _) => self.stats.foreign.get(),
            (Fate::Rejected(why), _) => self.seals.as_ref().map_or(0, |seals| seals.rejected(source, why)),
            (_, None) => 0,
            (Fate::Taken, Some(received)) => received.datagrams.get(),
            (Fate::Duplicate, Some(received)) => received.duplicates.get(),
            (Fate::Old, Some(received)) => received.old.get(),
            (Fate::Damaged, Some(received)) => received.damaged.get(),
            (Fate::Refused, Some(received)) => received.refused.get(),
        })
    }

    /// A datagram was handled: notes what became of it. `clear`: what could be read of it; `before`: what was counted
    /// of its source.
    pub(super) fn handled(&mut self, io: &mut Io<'_>, arrived: &Arrived, clear: &[u8], before: &Counted) {
        let source = arrived.source.filter(|node| *node != io.node);
        let fate = self.fate(io, arrived, before, &self.counted(source));
        io.line(|| format!("from {source:?}: {}, {fate:?}", shown(clear)));
        if let Some(fate) = fate {
            self.check_fate(io, arrived, fate);
        }
        match fate {
            Some(Fate::Taken) => {
                io.oracle.took(io.now, io.life, (clear, self.first_of(clear)), self.settings.digest);
                self.hears(io, source);
            }
            Some(Fate::Duplicate) => io.oracle.saw("dropped as a copy"),
            Some(_) if self.seals.is_some() => io.oracle.saw("rejected"),
            _ => io.oracle.saw("dropped as wrong or old"),
        }
    }

    /// What became of the datagram that was handled between two counts; none: it is an answer, and was counted nowhere.
    fn fate(&self, io: &mut Io<'_>, arrived: &Arrived, before: &Counted, after: &Counted) -> Option<Fate> {
        let counts = before.iter().zip(after).map(|(before, after)| after - before);
        let counted: Vec<_> = FATES.into_iter().zip(counts).filter(|(_, count)| *count > 0).collect();
        let answers = if self.seals.is_some() { FrameKind::Hello } else { FrameKind::Refusal };
        let is_answer = FrameHead::read(&arrived.bytes).is_ok_and(|(head, _)| head.kind == answers);
        match counted[..] {
            [(fate, 1)] => Some(fate),
            [] if is_answer => None,
            _ => {
                io.oracle.broken(io.now, Promise::Accounts, format!("a datagram was counted as {counted:?}"));
                None
            }
        }
    }

    /// Whether a datagram may be counted so.
    ///
    /// One that a router sent to this one, and that nobody altered, may be
    /// - refused only if its sender has another configuration;
    /// - a duplicate or a replay only if it came before, is out of the window, or was sent before its incarnation was
    ///   heard: [`Oracle::came`](crate::sim::oracle::Oracle::came);
    /// - old only if its incarnation is over or not confirmed yet: [`Oracle::may_be_old`], or if it is a refusal;
    /// - of another incarnation only if this router knows its sender by another one, or not at all;
    /// - forged only if it was sealed to another incarnation of this router;
    /// - foreign only if this router sent it to its own address, since somebody had written that on a datagram;
    ///
    /// and nothing else.
    ///
    /// [`Oracle::may_be_old`]: crate::sim::oracle::Oracle::may_be_old
    fn is_allowed(&self, io: &mut Io<'_>, arrived: &Arrived, head: &FrameHead, fate: Fate) -> bool {
        let Origin::Sent { sealed_to } = arrived.origin else { return true };
        let is_hello = head.kind == FrameKind::Hello;
        // Where datagrams are sealed, from this sequence on its incarnation is heard.
        let first = self.receiver.gate().map_or(0, |gate| gate.first(head.from));
        match fate {
            Fate::Taken => true,
            Fate::Refused => head.digest != self.settings.digest,
            Fate::Duplicate => io.oracle.came(io.life, head, first),
            Fate::Rejected(Rejection::Replay) => !is_hello && io.oracle.came(io.life, head, first),
            Fate::Old if head.kind == FrameKind::Refusal => true,
            Fate::Old => {
                let heard_ns = self.heard_ns.get(usize::from(head.from)).copied().unwrap_or_default();
                let since_ns = io.now.monotonic_ns.saturating_sub(heard_ns.max(self.steady_since_ns));
                let is_silent = since_ns > SILENT_AFTER_NS + STILL_NS;
                self.seals.is_none() && io.oracle.may_be_old(io.now, io.life, head, is_silent)
            }
            Fate::Rejected(Rejection::OtherIncarnation) => {
                let known = self.seals.as_ref().and_then(|seals| seals.all.incarnation(head.from));
                !is_hello && known != Some(head.incarnation)
            }
            Fate::Rejected(Rejection::Forged) => !is_hello && sealed_to != Some(self.settings.incarnation),
            Fate::Foreign => arrived.source == Some(io.node),
            Fate::Damaged | Fate::Rejected(_) => false,
        }
    }

    /// A datagram was counted so.
    fn check_fate(&self, io: &mut Io<'_>, arrived: &Arrived, fate: Fate) {
        let is_allowed = match FrameHead::read(&arrived.bytes) {
            Ok((head, _)) => self.is_allowed(io, arrived, &head, fate),
            Err(_) => !matches!(arrived.origin, Origin::Sent { .. }),
        };
        if !is_allowed {
            let said = shown(&arrived.bytes);
            let text = format!("what node {:?} sent to node {} is {fate:?}: {said}", arrived.source, io.node);
            io.oracle.broken(io.now, Promise::Rejection, text);
        }
    }
}
