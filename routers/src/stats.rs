//! What a router counts: packages by class, losses by cause, peers.
//!
//! Other ports have threads of their own ([`Stats::of_port`]): they count classes of packages in the same places, and
//! datagrams in their own.

use crate::counts::{Count, PeerReceived, PeerSent, Side};
use crate::flows::Flows;
use crate::frame::NodeIndex;
use crate::link::Link;
use crate::port::Port;
use crate::settings::Settings;
use rohrpost_network::LEVELS;
use std::sync::Arc;

/// One peer.
#[derive(Default, Debug)]
pub struct PeerStats {
    /// To it.
    pub sent: PeerSent,
    /// From it.
    pub received: PeerReceived,
    /// Whether it is there.
    pub link: Link,
}

/// What one router counts. Made once, then shared.
#[derive(Debug)]
pub struct Stats {
    /// To other nodes.
    pub out: Arc<Side>,
    /// From other nodes.
    pub inn: Arc<Side>,
    peers: Box<[PeerStats]>,
    /// Packages that wait, by level.
    pub waiting: [Count; LEVELS],
    /// Bytes that they take up in the queue's memory.
    pub waiting_bytes: Count,
    /// Datagrams that came from a node's address and are nothing of ours.
    pub foreign: Count,
    /// Datagrams that the kernel dropped at the socket: from addresses that no node has, or since the socket was full.
    pub dropped: Count,
    /// The declared flows that leave the node.
    pub flows: Arc<Flows>,
    /// Bytes that were sent, all heads counted.
    pub on_wire_bytes: Count,
    /// When the router began, ns of the monotonic clock.
    pub started_ns: u64,
    /// The port of these datagrams.
    pub(crate) port: Port,
    /// At another port than that of packages: the counters that know which peers are there.
    knows: Option<Arc<Self>>,
}

/// After so long the wire holds no duplicate any more of what a router's incarnation before took.
///
/// Whether there was such an incarnation nobody can tell: a launch that ends takes the node's directory along, transit
/// mailbox and all, and the next may begin at once, with no restart counted. So the first incarnation of a router is
/// held to be young as well; what that costs is the wait for a caller's next try.
pub(crate) const YOUNG_NS: u64 = 500_000_000;

impl Stats {
    /// Counters of a router that begins now.
    pub fn new(settings: &Settings, now_ns: u64) -> Arc<Self> {
        Arc::new(Self::of_router(settings, now_ns))
    }

    /// Counters of the same router, for the threads of another port: of what is not real time, or of replicas.
    pub fn of_port(port: Port, settings: &Settings, all: &Arc<Self>) -> Arc<Self> {
        let (out, inn, flows) = (all.out.clone(), all.inn.clone(), all.flows.clone());
        let knows = Some(all.clone());
        Arc::new(Self { out, inn, flows, port, knows, ..Self::of_router(settings, all.started_ns) })
    }

    fn of_router(settings: &Settings, started_ns: u64) -> Self {
        Self {
            out: Arc::new(Side::new()),
            inn: Arc::new(Side::new()),
            peers: settings.nodes.iter().map(|_| PeerStats::default()).collect(),
            waiting: Default::default(),
            waiting_bytes: Count::default(),
            foreign: Count::default(),
            dropped: Count::default(),
            flows: Arc::new(Flows::new(&settings.flows)),
            on_wire_bytes: Count::default(),
            started_ns,
            port: Port::Packages,
            knows: None,
        }
    }

    /// Counters of a node; those of the own one stay empty.
    ///
    /// # Panics
    /// If there is no such node.
    pub fn peer(&self, node: NodeIndex) -> &PeerStats {
        &self.peers[usize::from(node)]
    }

    /// Whether a peer is there.
    pub fn state(&self, peer: NodeIndex, now_ns: u64) -> crate::link::PeerLinkState {
        self.knows.as_deref().unwrap_or(self).peer(peer).link.state(self.started_ns, now_ns)
    }

    /// Whether an incarnation of a peer is another than the one that is heard at the port of what is real time, where
    /// that is found out.
    pub(crate) fn is_other_incarnation(&self, peer: NodeIndex, incarnation: u64) -> bool {
        self.knows.as_ref().is_some_and(|all| {
            let known = all.peer(peer).link.incarnation.get();
            known != 0 && known != incarnation
        })
    }

    /// The incarnation of a peer that is heard at the port of what is real time; 0: none.
    pub(crate) fn incarnation_of(&self, peer: NodeIndex) -> u64 {
        self.knows.as_deref().unwrap_or(self).peer(peer).link.incarnation.get()
    }

    /// Whether it is that incarnation.
    pub(crate) fn is_known_incarnation(&self, peer: NodeIndex, incarnation: u64) -> bool {
        self.knows.as_ref().is_some_and(|all| all.peer(peer).link.incarnation.get() == incarnation)
    }

    /// Whether the router has just begun: what comes may be a copy of what its incarnation before took, so nothing is
    /// said of its fate.
    pub fn is_young(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.started_ns) < YOUNG_NS
    }

    /// Packages that wait, on all levels.
    pub fn waiting_in_all(&self) -> u64 {
        self.waiting.iter().map(Count::get).sum()
    }
}
