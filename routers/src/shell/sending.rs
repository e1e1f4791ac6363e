//! State of a thread that sends as packages come: a queue, and the sockets.

use super::answers::ErrorReplier;
use super::failure::Failure;
use super::wire::PeerSockets;
use crate::counts::Cause;
use crate::frame::NodeIndex;
use crate::outbound::{Accepted, DIRECT_HEAD_BYTES, Outbound, OutboundStep, Package};
use crate::report::Report;
use crate::stats::Stats;
use rohrpost_mailbox::{Head, monotonic_ns};
use std::io::IoSlice;
use std::sync::Arc;

/// Queue and sockets.
pub(super) struct Sending {
    pub(super) outbound: Outbound,
    pub(super) stats: Arc<Stats>,
    pub(super) answers: ErrorReplier,
    pub(super) wire: PeerSockets,
    /// Room for the largest datagram.
    pub(super) datagram: Box<[u8]>,
}

impl Report for ErrorReplier {
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, body: &[u8], cause: Cause) {
        self.answer(peer, head, body, cause, None);
    }
}

impl Sending {
    /// Takes a package: sends or queues it. `alone`: see [`Outbound::accept`].
    pub(super) fn accept(&mut self, package: &Package<'_>, alone: bool) {
        let Self { outbound, answers, wire, datagram, .. } = self;
        let (now_ns, body) = (monotonic_ns(), package.body);
        let Accepted::Send { to, head } = outbound.accept(now_ns, package, alone, answers) else { return };
        let sent = match wire.seals() {
            false => wire.send(now_ns, to, &[IoSlice::new(&head), IoSlice::new(body)]),
            true => {
                // The one copy that sealing needs: the body must stay unchanged.
                datagram[..head.len()].copy_from_slice(&head);
                datagram[head.len()..head.len() + body.len()].copy_from_slice(body);
                wire.send_made(now_ns, to, datagram, head.len() + body.len())
            }
        };
        settle(sent, outbound, (&head, body), answers);
        outbound.pass_over(wire.full().0);
    }

    /// Loses a package: see [`Outbound::displace`].
    pub(super) fn displace(&mut self, package: &Package<'_>) {
        self.outbound.displace(package, &mut self.answers);
    }

    /// Sends the next datagram; else returns when there is one, unless a package comes.
    pub(super) fn step(&mut self, now_ns: u64) -> Option<u64> {
        self.wire.retry(now_ns);
        self.outbound.pass_over(self.wire.full().0);
        match self.outbound.poll(now_ns, &mut self.datagram, &mut self.answers) {
            OutboundStep::Send { to, bytes } => {
                let sent = self.wire.send_made(monotonic_ns(), to, &mut self.datagram, bytes);
                settle(sent, &mut self.outbound, (&self.datagram[..bytes], &[]), &mut self.answers);
                None
            }
            OutboundStep::Wait { until_ns } => Some(until_ns.min(self.wire.full().1)),
        }
    }

    /// Whether something waits for its time, so that an exact timer is worthwhile.
    pub(super) fn waits(&self) -> bool {
        self.stats.waiting_bytes.get() > 0 || self.wire.full().0 != 0
    }
}

/// Reports the result for the last datagram, and for its body if it left without a copy.
fn settle(
    sent: Result<(), Failure>,
    outbound: &mut Outbound,
    (datagram, body): (&[u8], &[u8]),
    answers: &mut ErrorReplier,
) {
    if sent.is_err_and(Failure::is_loss) {
        outbound.unsent(datagram, body, answers);
    } else if outbound.is_measured() {
        outbound.sent(monotonic_ns());
    }
}

const _: () = assert!(DIRECT_HEAD_BYTES < 128);
