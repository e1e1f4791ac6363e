//! What a thread that sends as packages come has of the system behind its queue, and what it does with that.

use super::platform::NotSent;
use crate::frame::NodeIndex;
use crate::outbound::{Accepted, DIRECT_HEAD_BYTES, Outbound, OutboundStep, Package};
use crate::replication::{ReplicaSender, ReplicaStep};
use crate::report::Report;
use crate::settings::Settings;
use rohrpost_mailbox::{Head, SystemTime};

/// The way to the thread that sends what is not real time.
pub trait Handover {
    /// Whether it takes a package.
    fn takes(&mut self) -> bool;
    /// Hands a package over; only if it takes one.
    fn give(&mut self, head: &Head, published_ns: u64, body: &[u8]);
    /// No more packages for the moment.
    fn finish(&mut self);
    /// Whether it might take.
    fn has_room(&self) -> bool;
    /// From now on this thread is woken when it may take again.
    fn wants_room(&self);
}

/// Clock, queue and sockets of such a thread.
pub trait Outlet {
    /// The clock by which packages are published, ns.
    fn monotonic_ns(&self) -> u64;
    /// The queue, and what takes its reports of losses.
    fn queue(&mut self) -> (&mut Outbound, impl Report);
    /// Whether datagrams are sealed: [`Self::send`] does it.
    fn seals(&self) -> bool;
    /// Hands over the datagram in the first `bytes` of a buffer, which has room for a seal behind them.
    ///
    /// # Errors
    /// [`NotSent`]; the datagram is as it was.
    fn send(&mut self, now_ns: u64, to: NodeIndex, buffer: &mut [u8], bytes: usize) -> Result<(), NotSent>;
    /// Hands over a datagram in two parts, where nothing is sealed.
    ///
    /// # Errors
    /// [`NotSent`]
    fn send_parts(&mut self, now_ns: u64, to: NodeIndex, head: &[u8], body: &[u8]) -> Result<(), NotSent>;
    /// Has the sockets without room tried again, if it is due.
    fn retry(&mut self, now_ns: u64);
    /// The peers without room in their sockets, one bit each, and when they are due, ns.
    fn blocked(&self) -> (u64, u64);
    /// Sends what an impairment delayed for long enough; when it has more, ns.
    fn deliver(&mut self, now_ns: u64) -> u64;
    /// The way to the thread that sends what is not real time; none where there is none.
    fn rest(&mut self) -> Option<&mut dyn Handover> {
        None
    }
}

/// What a thread below real time does until its driver is polled again.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum OutletStep {
    /// Poll it at once.
    Again,
    /// The rate limit holds the wire: sleep.
    Sleep {
        /// For so long, ns.
        for_ns: u64,
    },
    /// Wait for packages or records.
    Wait {
        /// For so long, ns.
        for_ns: u64,
    },
}

/// Takes packages, and sends what the queue lets go.
pub(crate) struct Transmitter {
    /// Room for the largest datagram, and its seal.
    datagram: Box<[u8]>,
}

impl Transmitter {
    pub(crate) fn new(settings: &Settings) -> Self {
        let bytes = settings.network.datagram_bytes_max + settings.network.security.tag_bytes();
        Self { datagram: vec![0; bytes].into() }
    }

    /// Takes a package: sends or queues it. `alone`: see [`Outbound::accept`].
    pub(crate) fn accept(&mut self, on: &mut impl Outlet, package: &Package<'_>, alone: bool) {
        let (now_ns, body) = (on.monotonic_ns(), package.body);
        let (outbound, mut report) = on.queue();
        let Accepted::Send { to, head } = outbound.accept(now_ns, package, alone, &mut report) else { return };
        drop(report);
        let sent = if on.seals() {
            // The one copy that sealing needs: the body must stay unchanged.
            self.datagram[..head.len()].copy_from_slice(&head);
            self.datagram[head.len()..head.len() + body.len()].copy_from_slice(body);
            on.send(now_ns, to, &mut self.datagram, head.len() + body.len())
        } else {
            on.send_parts(now_ns, to, &head, body)
        };
        settle(on, sent, &head, body);
        pass_over_blocked(on);
    }

    /// Sends the next datagram; else returns when there is one, unless a package comes.
    pub(crate) fn step(&mut self, on: &mut impl Outlet, now_ns: u64) -> Option<u64> {
        on.retry(now_ns);
        pass_over_blocked(on);
        let (outbound, mut report) = on.queue();
        let output = outbound.poll(now_ns, &mut self.datagram, &mut report);
        drop(report);
        match output {
            OutboundStep::Send { to, bytes } => {
                self.hand_over(on, to, bytes);
                None
            }
            OutboundStep::Wait { until_ns } => Some(until_ns.min(on.blocked().1)),
        }
    }

    /// Sends the next part of a replica, if there is one to send.
    pub(super) fn step_replicas(
        &mut self,
        on: &mut impl Outlet,
        now_ns: u64,
        system: impl Fn(u64) -> SystemTime,
        sender: &mut ReplicaSender,
    ) -> ReplicaStep {
        pass_over_blocked(on);
        let step = sender.poll(now_ns, system, on.queue().0, &mut self.datagram);
        if let ReplicaStep::Send { to, bytes } = step {
            self.hand_over(on, to, bytes);
        }
        step
    }

    fn hand_over(&mut self, on: &mut impl Outlet, to: NodeIndex, bytes: usize) {
        let sent = on.send(on.monotonic_ns(), to, &mut self.datagram, bytes);
        settle(on, sent, &self.datagram[..bytes], &[]);
    }
}

fn pass_over_blocked(on: &mut impl Outlet) {
    let (blocked, _) = on.blocked();
    on.queue().0.pass_over(blocked);
}

/// Reports the result for the last datagram, and for its body if it left without a copy.
fn settle(on: &mut impl Outlet, sent: Result<(), NotSent>, datagram: &[u8], body: &[u8]) {
    if let Err(NotSent) = sent {
        let (outbound, mut report) = on.queue();
        outbound.unsent(datagram, body, &mut report);
    } else if on.queue().0.is_measured() {
        let sent_ns = on.monotonic_ns();
        on.queue().0.sent(sent_ns);
    }
}

const _: () = assert!(DIRECT_HEAD_BYTES < 128);
