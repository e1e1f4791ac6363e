//! The thread that sends what is not real time: scheduled like the modules that it serves, below all real-time threads.
//!
//! It has a queue, sockets and a port of its own. It shares the wire's rate with real time, which goes first. A second
//! thread receives at that port. So the kernel separates both kinds before any thread runs, and a flood of one takes no
//! room or time from the other.

use super::answers::{ErrorReplier, Faults};
use super::handover::{Giver, Taker, Waited, handover};
use super::rx_thread::{PackageDelivery, RxThread};
use super::sender_cache::SenderCache;
use super::sending::Sending;
use super::socket::{InSocket, REST_BYTES};
use super::threads::{Shared, schedule_below};
use super::wire::PeerSockets;
use super::{Shell, ShellError, transit};
use crate::impair;
use crate::inbound::Inbound;
use crate::outbound::{Outbound, Package};
use crate::security::{Gate, Port, Sealing};
use crate::stats::Stats;
use rohrpost_mailbox::{Name, Node, Participant, monotonic_ns};
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::time::Duration;

/// Packages taken before the wire has its turn.
const BURST: usize = 64;
/// The end of the router is checked this often.
const LOOK: Duration = Duration::from_millis(100);
/// Packages for a peer that does not hear this incarnation yet are checked this often.
const LOOK_AGAIN: Duration = Duration::from_millis(10);

/// State of the thread.
pub(super) struct Rest {
    pub(super) shared: Arc<Shared>,
    pub(super) taker: Taker,
    pub(super) sending: Sending,
}

impl Rest {
    /// Runs until the router ends.
    pub(super) fn run(mut self) {
        while !self.shared.ends() {
            self.take();
            let now_ns = monotonic_ns();
            let Some(until_ns) = self.sending.step(now_ns) else { continue };
            let until_ns = until_ns.min(self.sending.wire.deliver(now_ns));
            let look = if self.sending.outbound.waits() { LOOK_AGAIN } else { LOOK };
            let time = Duration::from_nanos(until_ns.saturating_sub(now_ns)).min(look);
            if self.sending.outbound.has_plenty() {
                // The rate limit holds the wire. More packages wait in the mailbox, where less important ones are
                // displaced.
                std::thread::sleep(time);
            } else if self.taker.wait(time) == Waited::Ended {
                return;
            }
        }
    }

    /// Takes packages from the handover while they are of use.
    fn take(&mut self) {
        for _ in 0..BURST {
            if self.sending.outbound.has_plenty() {
                return;
            }
            let Some((head, published_ns, body, alone)) = self.taker.next() else { return };
            self.sending.accept(&Package { head, published_ns, body }, alone);
        }
    }
}

impl Shell {
    /// Opens the port and starts the two threads for what is not real time, if that is separate. Returns the handover
    /// for the thread that reads the mailbox.
    pub(super) fn begin_rest(
        &mut self,
        (node, name): (&Arc<Node>, Name),
        faults: &Arc<dyn Faults>,
        (socket, impair): (Option<OwnedFd>, Option<impair::ImpairmentSettings>),
    ) -> Result<Option<Giver>, ShellError> {
        let (settings, shared) = (self.settings.clone(), self.shared.clone());
        if !settings.parts_rest() {
            return Ok(None);
        }
        let port = settings.network.rest_port();
        let own = (settings.nodes[usize::from(settings.own)].address, port).into();
        let socket = Arc::new(InSocket::kept(socket, own, &settings.peer_addresses(), REST_BYTES)?);
        let stats = Stats::of_rest(&settings, &self.stats);
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
            stats: stats.clone(),
            answers: answers(&sender),
            wire: PeerSockets::new(&settings, port, sealing, impair, &self.failures),
            datagram: vec![0; settings.network.datagram_bytes_max + settings.network.security.tag_bytes()].into(),
        };
        let rx_thread = RxThread {
            shared: shared.clone(),
            socket: socket.clone(),
            inbound: Inbound::new(&settings, stats.clone()),
            delivery: PackageDelivery {
                sender_cache: SenderCache::here(&receiver, &settings.hosts),
                answers: answers(&receiver),
                news: None,
                ages: self.ages.clone(),
                takes_bytes: None,
            },
            settings: settings.clone(),
            stats: stats.clone(),
            guard: all.map(Gate::of_rest),
            answers: None,
            is_rest: true,
        };
        self.sockets.push(socket);
        self.rest_stats = Some(stats);
        let tx_thread = Rest { shared, taker, sending };
        self.begin("rest-out", move || {
            schedule_below();
            tx_thread.run();
        })?;
        self.begin("rest-in", move || {
            schedule_below();
            rx_thread.run();
        })?;
        Ok(Some(giver))
    }
}
