//! The thread that sends what is not real time: scheduled like the modules that it serves, below all real-time threads.
//!
//! This thread has a queue, sockets and a port of its own. The wire's rate is shared with real time, which goes first.
//! A second thread receives at that port. So the kernel separates both kinds before any thread runs, and a flood of one
//! takes no room or time from the other.

use super::answers::{ErrorReplier, Faults};
use super::handover::{BatchReceiver, BatchSender, Waited, handover};
use super::rx_thread::{PackageDelivery, RxSystem, RxThread};
use super::sender_cache::SenderCache;
use super::sending::Sending;
use super::socket::{InSocket, REST_BYTES};
use super::threads::{Shared, schedule_below};
use super::wire::PeerSockets;
use super::{Shell, ShellError, transit};
use crate::driver::{Outlet, OutletStep, RxDriver, Transmitter};
use crate::impair;
use crate::outbound::{Outbound, Package};
use crate::security::{Gate, Port, Sealing};
use crate::stats::Stats;
use rohrpost_mailbox::{Name, Node, Participant};
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::time::Duration;

/// Packages taken before the wire has its turn.
const BURST: usize = 64;
/// The end of the router is checked this often, ns.
const LOOK_NS: u64 = 100_000_000;
/// Packages for a peer that does not hear this incarnation yet are checked this often, ns.
const LOOK_AGAIN_NS: u64 = 10_000_000;

/// State of the thread.
struct Rest {
    shared: Arc<Shared>,
    transmitter: Transmitter,
    taker: BatchReceiver,
    sending: Sending,
}

impl Rest {
    /// Runs until the router ends.
    fn run(mut self) {
        while !self.shared.ends() {
            match self.poll() {
                OutletStep::Again => {}
                OutletStep::Sleep { for_ns } => std::thread::sleep(Duration::from_nanos(for_ns)),
                OutletStep::Wait { for_ns } => {
                    if self.taker.wait(Duration::from_nanos(for_ns)) == Waited::Ended {
                        return;
                    }
                }
            }
        }
    }

    /// Does what is due, one datagram at most beside those that leave at once.
    fn poll(&mut self) -> OutletStep {
        self.take();
        let Self { transmitter, sending, .. } = self;
        let now_ns = sending.monotonic_ns();
        let Some(until_ns) = transmitter.step(sending, now_ns) else { return OutletStep::Again };
        let until_ns = until_ns.min(sending.deliver(now_ns));
        let outbound = &sending.outbound;
        let look_ns = if outbound.waits() { LOOK_AGAIN_NS } else { LOOK_NS };
        let for_ns = until_ns.saturating_sub(now_ns).min(look_ns);
        // More packages wait in the mailbox, where less important ones are displaced.
        if outbound.has_plenty() { OutletStep::Sleep { for_ns } } else { OutletStep::Wait { for_ns } }
    }

    /// Takes packages while they are of use.
    fn take(&mut self) {
        let Self { transmitter, taker, sending, .. } = self;
        for _ in 0..BURST {
            if sending.outbound.has_plenty() {
                return;
            }
            let Some((head, published_ns, body, is_last)) = taker.next() else { return };
            transmitter.accept(sending, &Package { head, published_ns, body }, is_last);
        }
    }
}

impl Shell {
    /// Starts a thread that is scheduled below all that are in real time.
    pub(super) fn begin_below(&mut self, name: &str, run: impl FnOnce() + Send + 'static) -> Result<(), ShellError> {
        self.begin(name, move || {
            schedule_below();
            run();
        })
    }

    /// Opens the port and starts the two threads for what is not real time, if that is separate. Returns the handover
    /// for the thread that reads the mailbox.
    pub(super) fn begin_rest(
        &mut self,
        (node, name): (&Arc<Node>, Name),
        faults: &Arc<dyn Faults>,
        (socket, impair): (Option<OwnedFd>, Option<impair::ImpairmentSettings>),
    ) -> Result<Option<BatchSender>, ShellError> {
        let (settings, shared) = (self.settings.clone(), self.shared.clone());
        if !settings.parts_rest() {
            return Ok(None);
        }
        let port = settings.network.rest_port();
        let own = (settings.nodes[usize::from(settings.own)].address, port).into();
        let socket = Arc::new(InSocket::kept(socket, own, &settings.peer_addresses(), REST_BYTES)?);
        let stats = Stats::of_port(Port::Rest, &settings, &self.stats);
        let all = self.peer_sessions.as_ref();
        let mut outbound = Outbound::new(&settings, stats.clone()).behind(&self.stats);
        if let Some(all) = all {
            outbound = outbound.sealed(all.clone());
        }
        let [sender, receiver] = [Participant::join(node, Name::NONE)?, Participant::join(node, Name::NONE)?];
        // The real-time half knows whether a peer is there.
        let via = transit::name(name);
        let answers = |participant| ErrorReplier::new(&settings, &self.stats, faults, participant, via);
        let (giver, taker) = handover(&shared);
        let sealing = all.map(|all| Sealing::new(all, Port::Rest));
        let sending = Sending {
            outbound,
            answers: answers(&sender),
            wire: PeerSockets::new(&settings, port, sealing, impair, &self.failures),
            rest: None,
        };
        let system = RxSystem {
            shared: shared.clone(),
            socket: socket.clone(),
            delivery: PackageDelivery {
                sender_cache: SenderCache::here(&receiver, &settings.hosts),
                answers: answers(&receiver),
                news: None,
                ages: self.ages.clone(),
                takes_bytes: None,
            },
            settings: settings.clone(),
            answers: None,
        };
        let driver = RxDriver::new(&settings, &stats, all.map(|all| Gate::without_hellos(all, Port::Rest))).of_rest();
        let rx_thread = RxThread { driver, system, stats: stats.clone() };
        self.sockets.push(socket);
        self.rest_stats = Some(stats);
        let tx_thread = Rest { shared, transmitter: Transmitter::new(&settings), taker, sending };
        self.begin_below("rest-out", move || tx_thread.run())?;
        self.begin_below("rest-in", move || rx_thread.run())?;
        Ok(Some(giver))
    }
}
