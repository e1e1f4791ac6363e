//! Sends parts of replicas, behind all packages: what leaves next, and for how long to wait.

use super::outlet::{Outlet, OutletStep, Transmitter};
use crate::outbound::Outbound;
use crate::replication::{ReplicaSender, ReplicaStep};
use crate::security::PeerSessions;
use crate::settings::Settings;
use crate::stats::Stats;
use rohrpost_mailbox::SystemTime;
use std::sync::Arc;

/// The end of the router, modules that have begun, and peers that have come are looked at this often, ns.
const LOOK_NS: u64 = 100_000_000;
/// Room in a socket is looked at this often at the least, ns.
const LOOK_AGAIN_NS: u64 = 10_000_000;

/// The queue by which parts of replicas leave, and count in `stats`. No package waits in it, so it needs no room for
/// those of modules; the wire it leaves to those of `before`, of which the first is the real-time half.
pub fn part_queue(
    settings: &Settings,
    sender: &ReplicaSender,
    stats: Arc<Stats>,
    before: (&Arc<Stats>, Option<&Arc<Stats>>),
    peer_sessions: Option<&Arc<PeerSessions>>,
) -> Outbound {
    let alone = Settings { senders: Vec::new(), ..settings.clone() };
    let mut queue = Outbound::new(&alone, stats).behind(before.0).only_to(sender.peers());
    if let Some(rest) = before.1 {
        queue = queue.yielding_to(rest);
    }
    match peer_sessions {
        Some(all) => queue.sealed(all.clone()),
        None => queue,
    }
}

/// Sends the parts of all replicas of a node's streams.
pub struct ReplicaDriver {
    transmitter: Transmitter,
}

impl ReplicaDriver {
    /// Makes the driver of a starting router.
    pub fn new(settings: &Settings) -> Self {
        Self { transmitter: Transmitter::new(settings) }
    }

    /// Does what is due, one datagram at most. `system` tells system time at a moment of the outlet's clock.
    pub fn poll(
        &mut self,
        on: &mut impl Outlet,
        system: impl Fn(u64) -> SystemTime,
        sender: &mut ReplicaSender,
    ) -> OutletStep {
        let now_ns = on.monotonic_ns();
        // Keep-alives; packages do not come here.
        let Some(until_ns) = self.transmitter.step(on, now_ns) else { return OutletStep::Again };
        let until_ns = until_ns.min(on.deliver(now_ns));
        let left_ns = |other_ns: u64| until_ns.min(other_ns).saturating_sub(now_ns);
        match self.transmitter.step_replicas(on, now_ns, system, sender) {
            ReplicaStep::Send { .. } => OutletStep::Again,
            ReplicaStep::Wait { until_ns } => OutletStep::Sleep { for_ns: left_ns(until_ns).min(LOOK_AGAIN_NS) },
            ReplicaStep::Idle { until_ns } => OutletStep::Wait { for_ns: left_ns(until_ns).min(LOOK_NS) },
        }
    }
}
