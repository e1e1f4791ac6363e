//! The router at work: its mailbox, its sockets and its two threads.
//!
//! ```text
//!                              ┌──────────────── tx_thread ────────────────┐
//!  modules ─▶ router.I.3 ─────▶│ Outbound: at once, or by levels and pace   │─▶ a socket to each peer ═▶
//!                              └─────────────▲──────────────────────────────┘
//!                     errors, by the mailbox │ Stats: live peers, what was heard (atomics)
//!                              ┌─────────────┴── rx_thread ──────────────────┐
//!  modules ◀─ their mailboxes ◀│ Inbound: loss, duplicates, fragments, order │◀─ one socket for all ◀═
//!                              └────────────────────────────────────────────┘
//! ```
//!
//! With time slots, the thread of [`slots`] replaces tx_thread, and has the clock besides; else the clock has a thread
//! of its own ([`clock`]).
//!
//! Each thread is a participant, since a participant has one bell. Neither waits for the other or takes memory from the
//! heap for a package. System calls are made only for the datagram, for sleep, and to wake the receiver of a package.

mod ages;
mod answers;
pub mod clock;
mod failure;
mod filter;
mod handover;
mod hosted;
mod peer_events;
mod replicas;
mod rest;
mod rx_thread;
pub(crate) mod sender_cache;
mod sending;
pub mod slots;
mod socket;
pub mod team;
mod threads;
pub(crate) mod transit;
pub mod tunnel;
mod tx_thread;
mod wire;

pub use ages::Ages;
pub use answers::{Faults, Undelivered};
pub use failure::{Failure, Failures};
pub use peer_events::difference;
pub use replicas::ReplicaParts;
pub use socket::{SocketError, listen};

use crate::driver::{ANSWERS, Answer, FreeDriver, RxDriver, spin_ns};
use crate::impair;
use crate::outbound::Outbound;
use crate::replication::ReplicaCounts;
use crate::security::{self, Gate, KeyRing, NoRandom, PeerSessions, Port, Rejections, RouterIdentity, Sealing};
use crate::settings::Settings;
use crate::stats::Stats;
use crate::tdma::{SlotScheduler, SlotTable};
use answers::ErrorReplier;
use clock::{ClockError, ClockParts, ClockRuntime, ClockService, ClockState};
use peer_events::News;
use rohrpost_mailbox::{CreateError, Name, Node, NodeError, Participant, monotonic_ns};
use rx_thread::{PackageDelivery, RxSystem, RxThread};
use sender_cache::SenderCache;
use sending::Sending;
use slots::{SlotParts, SlotThread};
use socket::InSocket;
use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;
use threads::Shared;
use tx_thread::{TransitInlet, TxThread};
use wire::PeerSockets;

/// Why a router did not start.
#[derive(Debug, thiserror::Error)]
pub enum ShellError {
    /// Its address.
    #[error(transparent)]
    Socket(#[from] SocketError),
    /// The node's memory.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// Its mailbox.
    #[error(transparent)]
    Mailbox(#[from] CreateError),
    /// Its clock.
    #[error(transparent)]
    Clock(#[from] ClockError),
    /// Time slots without a master of time.
    #[error("time slots need the time of a master; write `source = \"master\"` in [time]")]
    NoTime,
    /// The configuration demands sealed datagrams and there is no key, or the other way round.
    #[error(
        "configuration says `security = \"keys\"`, and the router was given no keys; or it says `none`, and there are \
         some"
    )]
    Keys,
    /// No unused incarnation number was found.
    #[error(transparent)]
    Random(#[from] NoRandom),
    /// The system has no thread for it.
    #[error("a thread of the router: {0}; is the limit of processes reached (ulimit -u)?")]
    Thread(io::Error),
}

/// Inputs of a router.
pub struct Parts<'a> {
    /// The node that it serves.
    pub node: &'a Arc<Node>,
    /// Its name, `router.I`.
    pub name: Name,
    /// Its node and the other nodes.
    pub settings: Settings,
    /// Writes replies to undeliverable commands.
    pub faults: Arc<dyn Faults>,
    /// Its sockets, if they are kept for it ([`listen`]), in that order; it makes the missing ones.
    pub sockets: Vec<OwnedFd>,
    /// A bad network between it and its sockets.
    pub impair: Option<impair::ImpairmentSettings>,
    /// Its clock; none unless time comes from a master.
    pub clock: Option<ClockParts>,
}

/// A router at work; dropped, it ends. Packages in its mailbox stay there.
pub struct Shell {
    settings: Arc<Settings>,
    stats: Arc<Stats>,
    failures: Arc<Failures>,
    ages: Arc<Ages>,
    shared: Arc<Shared>,
    /// For what is not real time, where that has its own threads.
    rest_stats: Option<Arc<Stats>>,
    /// The socket for packages comes first.
    sockets: Vec<Arc<InSocket>>,
    clock: Option<Arc<ClockState>>,
    slots: Option<Arc<slots::SlotStatus>>,
    /// With time slots: to the thread that sends in them.
    slot_parts: Option<SyncSender<SlotParts>>,
    tunnel: Option<Arc<tunnel::Passed>>,
    replicas: ReplicaCounts,
    /// Datagrams of replicas, where there are any.
    replica_stats: Option<Arc<Stats>>,
    /// Where datagrams are sealed.
    peer_sessions: Option<Arc<PeerSessions>>,
    /// The clock's own thread.
    service: Option<ClockService>,
    threads: Vec<JoinHandle<()>>,
}

impl Shell {
    /// Binds the addresses, makes the mailbox, registers the routes at the node, and starts all threads.
    ///
    /// # Errors
    /// [`ShellError`]
    pub fn start(parts: Parts<'_>) -> Result<Self, ShellError> {
        Self::start_with(parts, None)
    }

    /// Starts a router that seals its datagrams, and takes only sealed ones. It draws a new incarnation instead
    /// of the one in its settings: two runs with one incarnation would have one key.
    ///
    /// # Errors
    /// [`ShellError`]
    pub fn start_sealed(mut parts: Parts<'_>, keys: KeyRing) -> Result<Self, ShellError> {
        let incarnation = u64::from_le_bytes(security::random()?).max(1);
        parts.settings.incarnation = incarnation;
        if let Some(clock) = &mut parts.clock {
            clock.settings.incarnation = incarnation;
        }
        Self::start_with(parts, Some(keys))
    }

    fn start_with(parts: Parts<'_>, keys: Option<KeyRing>) -> Result<Self, ShellError> {
        if parts.settings.is_sealed() != keys.is_some() {
            return Err(ShellError::Keys);
        }
        let seed = keys.as_ref().map(|_| security::random()).transpose()?;
        let Parts { node, name, mut settings, faults, sockets, impair, clock } = parts;
        let mut sockets = sockets.into_iter();
        let has_tunnel = settings.tdma.as_ref().is_some_and(|tdma| tdma.tunnel.is_some());
        if has_tunnel && !settings.senders.iter().flatten().any(|sender| sender.module() == name.module()) {
            // Packets of the tunnel come from the router, and must not share the quota of unknown senders.
            settings.senders.push(vec![name]);
        }
        let own = (settings.nodes[usize::from(settings.own)].address, settings.network.port).into();
        let peers = settings.peer_addresses();
        let socket = Arc::new(InSocket::kept(sockets.next(), own, &peers, InSocket::WANTED_BYTES)?);
        if socket.receive_bytes < InSocket::WANTED_BYTES {
            tracing::debug!(
                "{} bytes may wait in the socket; raise net.core.rmem_max to {} for bursts (`sysctl`)",
                socket.receive_bytes,
                InSocket::WANTED_BYTES
            );
        }
        let settings = Arc::new(settings);
        let stats = Stats::new(&settings, monotonic_ns());
        let all = keys.map(|keys| PeerSessions::new(RouterIdentity::of(&settings), keys));
        let mut outbound = Outbound::new(&settings, stats.clone());
        if let Some(all) = &all {
            outbound = outbound.sealed(all.clone());
        }
        let failures = Arc::new(Failures::default());
        let ages = Arc::new(Ages::new(node));
        let [sender, receiver] = [Participant::join(node, Name::NONE)?, Participant::join(node, Name::NONE)?];
        let via = transit::name(name);
        let transit = sender.receiver(via, transit::shape())?;
        node.set_routes(via, &transit::ranges(&settings.routes, &settings.moving))?;
        let shared = Arc::new(Shared::new(&sender));
        let answers = |participant| ErrorReplier::new(&settings, &stats, &faults, participant, via);
        let sealing = all.as_ref().map(|all| Sealing::new(all, Port::Packages));
        let sending = Sending {
            outbound,
            answers: answers(&sender),
            wire: PeerSockets::new(&settings, settings.network.port, sealing, impair, &failures),
            rest: None,
        };
        let mut inlet = TransitInlet { transit, sending };
        let gate = all.as_ref().zip(seed).map(|(all, seed)| Gate::new(all, seed));
        let driver = RxDriver::new(&settings, &stats, gate);
        let mut system = RxSystem {
            shared: shared.clone(),
            socket: socket.clone(),
            delivery: PackageDelivery {
                sender_cache: SenderCache::here(&receiver, &settings.hosts),
                answers: answers(&receiver),
                news: Some(News::new(&settings)),
                ages: ages.clone(),
                takes_bytes: None,
            },
            settings: settings.clone(),
            answers: None,
        };
        // From here on, a failure ends the threads that have begun.
        let mut shell = Self {
            settings,
            stats,
            failures,
            ages,
            shared,
            rest_stats: None,
            sockets: vec![socket],
            clock: None,
            slots: None,
            slot_parts: None,
            tunnel: None,
            replicas: ReplicaCounts::default(),
            replica_stats: None,
            service: None,
            threads: Vec::new(),
            peer_sessions: all,
        };
        if shell.settings.tdma.is_some() {
            system.answers = Some(shell.send_in_slots(name, inlet, clock.ok_or(ShellError::NoTime)?)?);
            shell.open_tunnel(node, name)?;
        } else {
            let runtime = clock
                .map(ClockRuntime::new)
                .transpose()?
                .map(|runtime| runtime.sealed(shell.peer_sessions.as_ref(), false));
            shell.service = runtime.map(ClockService::of).transpose()?;
            shell.clock = shell.service.as_ref().map(|service| service.state().clone());
            inlet.sending.rest = shell.begin_rest((node, name), &faults, (sockets.next(), impair))?;
            let tx_thread = TxThread { shared: shell.shared.clone(), driver: FreeDriver::new(&shell.settings), inlet };
            shell.begin("tx", move || {
                if let Err(error) = threads::schedule(threads::TX_FIFO) {
                    tracing::warn!(
                        "the router's threads run as modules do, and not before them: {error}; allow it with a limit \
                         `rtprio` of {} for this user (limits.conf) or CAP_SYS_NICE",
                        threads::RX_FIFO
                    );
                }
                tx_thread.run();
            })?;
        }
        let rx_thread = RxThread { driver, system, stats: shell.stats.clone() };
        shell.begin("rx", move || {
            // A refusal was reported by the other.
            let _ = threads::schedule(threads::RX_FIFO);
            rx_thread.run();
        })?;
        Ok(shell)
    }

    /// Starts the thread that sends in time slots; returns its queue for refusals and hellos.
    fn send_in_slots(
        &mut self,
        name: Name,
        inlet: TransitInlet,
        clock: ClockParts,
    ) -> Result<SyncSender<Answer>, ShellError> {
        let settings = self.settings.clone();
        let tdma = settings.tdma.as_ref().ok_or(ShellError::NoTime)?;
        let (nodes, heads_bytes) = (settings.nodes.len() as u8, settings.overhead_bytes());
        let table = SlotTable::new(tdma, &clock.settings.masters, settings.own, nodes, heads_bytes);
        let runtime = ClockRuntime::new(clock)?.sealed(self.peer_sessions.as_ref(), true).in_slots(table.for_clock());
        let spin_ns = spin_ns(table.cycle_ns());
        let ((answers, waiting), (slot_parts, parts)) = (sync_channel(ANSWERS), sync_channel(1));
        let scheduler = SlotScheduler::new(table, spin_ns);
        let own = slots::Own {
            router: name,
            settings,
            peer_sessions: self.peer_sessions.clone(),
            answers: (waiting, self.sockets[0].clone()),
            parts,
        };
        let counted = (self.shared.clone(), self.stats.clone());
        let slots = SlotThread::new(own, counted, inlet, runtime, scheduler);
        (self.clock, self.slots, self.slot_parts) = (Some(slots.clock_state()), Some(slots.state()), Some(slot_parts));
        self.begin("slots", move || slots.run())?;
        Ok(answers)
    }

    /// With time slots, ordinary traffic may cross the network through them alone. Without the right to a device that
    /// is reported, and all else continues.
    fn open_tunnel(&mut self, node: &Arc<Node>, name: Name) -> Result<(), ShellError> {
        let settings = self.settings.clone();
        let Some(wanted) = settings.tdma.as_ref().and_then(|tdma| tdma.tunnel) else { return Ok(()) };
        let participants = [Participant::join(node, Name::NONE)?, Participant::join(node, Name::NONE)?];
        match tunnel::ends(&settings, &wanted, name, &self.shared, &participants) {
            Ok((outgoing, incoming, passed)) => {
                self.tunnel = Some(passed);
                self.begin("tunnel-out", move || outgoing.run())?;
                self.begin("tunnel-in", move || incoming.run())
            }
            Err(error) => {
                tracing::warn!("there is no tunnel for ordinary traffic: {error}");
                Ok(())
            }
        }
    }

    fn begin(&mut self, name: &str, run: impl FnOnce() + Send + 'static) -> Result<(), ShellError> {
        let begun = std::thread::Builder::new().name(name.into()).spawn(run);
        self.threads.push(begun.map_err(ShellError::Thread)?);
        Ok(())
    }

    /// State of system time; none unless that comes from a master.
    pub fn clock(&self) -> Option<&Arc<ClockState>> {
        self.clock.as_ref()
    }

    /// State of the time slots, if there are any.
    pub fn slots(&self) -> Option<&Arc<slots::SlotStatus>> {
        self.slots.as_ref()
    }

    /// Counters of the tunnel for ordinary traffic, if there is one.
    pub fn tunnel(&self) -> Option<&Arc<tunnel::Passed>> {
        self.tunnel.as_ref()
    }

    /// Its node and the other nodes.
    pub fn settings(&self) -> &Arc<Settings> {
        &self.settings
    }

    /// Datagrams rejected at a port because of their seal; none where nothing is sealed.
    pub fn rejections(&self, port: Port) -> Option<&Arc<Rejections>> {
        self.peer_sessions.as_ref().map(|all| all.rejections(port))
    }

    /// Its counters.
    pub fn stats(&self) -> &Arc<Stats> {
        &self.stats
    }

    /// The same for what is not real time, where that has threads and a port of its own: packages by class are counted
    /// in either, datagrams and waiting packages in both.
    pub fn rest_stats(&self) -> Option<&Arc<Stats>> {
        self.rest_stats.as_ref()
    }

    /// How often datagrams could not be sent.
    pub fn failures(&self) -> &Arc<Failures> {
        &self.failures
    }

    /// Age of data from other nodes.
    pub fn ages(&self) -> &Arc<Ages> {
        &self.ages
    }

    /// Whether all threads still run: if one has panicked, the process should end and be started again.
    pub fn is_well(&self) -> bool {
        self.service.as_ref().is_none_or(ClockService::is_well)
            && self.threads.iter().all(|thread| !thread.is_finished())
    }
}

impl Drop for Shell {
    fn drop(&mut self) {
        self.shared.end();
        self.sockets.iter().for_each(|socket| socket.close());
        for thread in self.threads.drain(..) {
            // A thread that panicked has said so.
            let _ = thread.join();
        }
    }
}
