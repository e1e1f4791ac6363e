//! What a thread that sends as packages come has: a queue, and the sockets.

use super::answers::ErrorReplier;
use super::failure::Failure;
use super::handover::BatchSender;
use super::wire::PeerSockets;
use crate::counts::Cause;
use crate::driver::{Handover, NotSent, Outlet};
use crate::frame::NodeIndex;
use crate::outbound::Outbound;
use crate::report::Report;
use rohrpost_mailbox::{Head, monotonic_ns};
use std::io::IoSlice;

/// Queue and sockets.
pub(super) struct Sending<R = ErrorReplier> {
    pub(super) outbound: Outbound,
    pub(super) answers: R,
    pub(super) wire: PeerSockets,
    /// To the thread that sends what is not real time; none where there is none.
    pub(super) rest: Option<BatchSender>,
}

/// In the place of a replier where no package goes, so none is lost.
pub(super) struct NoPackages;

impl Report for NoPackages {
    fn lost(&mut self, _: Option<NodeIndex>, _: &Head, _: &[u8], _: Cause) {}
}

impl Report for ErrorReplier {
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, body: &[u8], cause: Cause) {
        self.answer(peer, head, body, cause, None);
    }
}

impl<R: Report> Outlet for Sending<R> {
    fn monotonic_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn queue(&mut self) -> (&mut Outbound, impl Report) {
        (&mut self.outbound, &mut self.answers)
    }

    fn seals(&self) -> bool {
        self.wire.seals()
    }

    fn send(&mut self, now_ns: u64, to: NodeIndex, buffer: &mut [u8], bytes: usize) -> Result<(), NotSent> {
        is_sent(self.wire.send_made(now_ns, to, buffer, bytes))
    }

    fn send_parts(&mut self, now_ns: u64, to: NodeIndex, head: &[u8], body: &[u8]) -> Result<(), NotSent> {
        is_sent(self.wire.send(now_ns, to, &[IoSlice::new(head), IoSlice::new(body)]))
    }

    fn retry(&mut self, now_ns: u64) {
        self.wire.retry(now_ns);
    }

    fn blocked(&self) -> (u64, u64) {
        self.wire.full()
    }

    fn deliver(&mut self, now_ns: u64) -> u64 {
        self.wire.deliver(now_ns)
    }

    fn rest(&mut self) -> Option<&mut dyn Handover> {
        self.rest.as_mut().map(|rest| rest as &mut dyn Handover)
    }
}

fn is_sent(sent: Result<(), Failure>) -> Result<(), NotSent> {
    if sent.is_err_and(Failure::is_loss) { Err(NotSent) } else { Ok(()) }
}
