//! The clock at work: a thread with a socket of its own, at the port above that of packages.
//!
//! ```text
//!  kernel ─ stamps of what left ─▶ ┌───────┐ ─ record ─▶ the node's page of time
//!         ─ datagrams, stamps ───▶ │ Clock │ ─ snapshot ▶ ClockState, for tools
//!         ◀── datagrams ────────── └───────┘
//! ```
//!
//! The thread sleeps in one system call until a datagram, a stamp or its time comes. It takes nothing from the heap for a datagram.

mod local;
mod socket;
mod state;
#[cfg(test)]
mod tests;

pub use local::Skew;
pub use state::{ClockState, Snapshot};

use crate::frame::FrameHead;
use crate::impair::{self, Impairment, Output};
use crate::settings::Settings;
use crate::time::{Clock, Exchange, Stamp, Step, TIME_BYTES, TimeSettings};
use local::LocalClock;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use rohrpost_config::{FIFO_MAX, Installation, TimeSource};
use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_mailbox::{Node, NodeError, TimeKeeper, TimeRecord, realtime_ns};
use socket::{Came, TimeSocket};
use std::io::{self, PipeReader, PipeWriter};
use std::net::{IpAddr, SocketAddr};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;
use std::time::Duration;

/// Above all else: a stamp of our own, where the kernel has none, is as good as this thread is quick.
const FIFO: u8 = FIFO_MAX + 11;
/// So many datagrams are taken before what is due is sent.
const BURST: usize = 64;
/// A record that came too late is made anew, so often.
const WRITE_TRIES: usize = 8;

/// Why a clock did not start.
#[derive(Debug, thiserror::Error)]
pub enum ClockError {
    /// Its socket.
    #[error("socket of time at {0}: {1}; port + 1 of [network] must be free, and the address one of this computer")]
    Socket(SocketAddr, io::Error),
    /// The node's page.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// The system has no thread or pipe for it.
    #[error("a thread of the clock: {0}; is the limit of processes or files reached (ulimit -u, -n)?")]
    Thread(io::Error),
}

/// What a clock is made of.
pub struct ClockParts {
    /// Who it is, and who may be master.
    pub settings: TimeSettings,
    /// Where each node takes datagrams of time, in the order of the configuration; its own too.
    pub nodes: Vec<SocketAddr>,
    /// The node whose page it writes; none in tests that look at [`ClockState`] alone.
    pub node: Option<Arc<Node>>,
    /// A bad network before its socket.
    pub impair: Option<impair::Settings>,
    /// Whether the kernel stamps datagrams, if it can; else the clock does, as where it cannot.
    pub kernel_stamps: bool,
    /// For tests: see [`Skew`].
    pub skew: Option<Skew>,
    /// For measurements: each exchange, as long as there is room.
    pub observer: Option<SyncSender<Exchange>>,
}

impl ClockParts {
    /// The clock of a router of this installation; none unless its time comes from a master.
    pub fn new(router: &Settings, installation: &Installation, node: &Arc<Node>) -> Option<Self> {
        let TimeSource::Master { masters, interval } = &installation.time else { return None };
        let port = router.network.time_port();
        let settings = TimeSettings {
            system: router.system,
            own: router.own,
            nodes: router.nodes.len() as u8,
            masters: masters.clone(),
            interval: *interval,
            digest: router.digest,
            incarnation: router.incarnation,
        };
        let nodes = router.nodes.iter().map(|node| SocketAddr::new(node.address, port)).collect();
        let node = Some(node.clone());
        Some(Self { settings, nodes, node, impair: None, kernel_stamps: true, skew: None, observer: None })
    }
}

/// A clock at work; dropped, it ends. The page stays, and its bound grows.
pub struct ClockService {
    state: Arc<ClockState>,
    /// Closed, it wakes the thread for the last time.
    ends: Option<PipeWriter>,
    thread: Option<JoinHandle<()>>,
}

impl ClockService {
    /// Binds the socket and starts the thread. What an earlier life of this router wrote in the node's page goes on.
    ///
    /// # Errors
    /// [`ClockError`]
    pub fn start(parts: ClockParts) -> Result<Self, ClockError> {
        let ClockParts { settings, nodes, node, impair, kernel_stamps, skew, observer } = parts;
        let own = settings.own;
        let at = nodes.get(usize::from(own)).copied().unwrap_or(SocketAddr::new(IpAddr::from([0; 16]), 0));
        let socket = TimeSocket::open(at, &nodes, kernel_stamps).map_err(|error| ClockError::Socket(at, error))?;
        let keeper = node.as_ref().map(TimeKeeper::resume).transpose()?;
        let page = keeper.as_ref().and_then(TimeKeeper::record);
        let local = LocalClock::new(skew);
        let clock = Clock::new(settings, local.now_ns(), realtime_ns(), page);
        let snapshot = Snapshot::of(&clock, local.now_ns());
        let state = Arc::new(ClockState::new(snapshot));
        let (ended, ends) = io::pipe().map_err(ClockError::Thread)?;
        let mut worker = Worker {
            clock,
            local,
            socket,
            written: page,
            keeper,
            impairment: impair.map(|impair| Impairment::new(impair, u64::from(own) | 0x7469_6d65_0000)),
            observer,
            state: state.clone(),
            snapshot,
            ended,
        };
        let thread =
            std::thread::Builder::new().name("clock".into()).spawn(move || worker.run()).map_err(ClockError::Thread)?;
        Ok(Self { state, ends: Some(ends), thread: Some(thread) })
    }

    /// What others may look at.
    pub fn state(&self) -> &Arc<ClockState> {
        &self.state
    }

    /// Whether the thread still runs: if it has panicked, the process should end and be started again.
    pub fn is_well(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl Drop for ClockService {
    fn drop(&mut self) {
        drop(self.ends.take());
        if let Some(thread) = self.thread.take() {
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

/// What the impairment keeps besides the bytes.
#[derive(Clone, Copy)]
struct Held {
    source: IpAddr,
    stamp: Stamp,
    since_ns: u64,
}

/// The thread.
struct Worker {
    clock: Clock,
    local: LocalClock,
    socket: TimeSocket,
    keeper: Option<TimeKeeper>,
    written: Option<TimeRecord>,
    impairment: Option<Impairment<Held>>,
    observer: Option<SyncSender<Exchange>>,
    state: Arc<ClockState>,
    snapshot: Snapshot,
    ended: PipeReader,
}

impl Worker {
    fn run(&mut self) {
        // The router's other threads tell when it is refused.
        self.snapshot.real_time = schedule(Scheduling::Fifo(FIFO)).is_ok();
        let mut datagram = [0; TIME_BYTES];
        loop {
            // When each left is known before an answer to it is read.
            self.take_stamps();
            let held_ns = self.take_datagrams();
            let until_ns = loop {
                let now_ns = self.local.now_ns();
                match self.clock.poll(now_ns, &mut datagram) {
                    Step::Send { to, .. } => {
                        self.socket.send(to, &datagram);
                    }
                    Step::Wait { until_ns } => break until_ns,
                }
            };
            self.write_page();
            self.show();
            if self.sleep(until_ns.min(held_ns)) {
                return;
            }
        }
    }

    fn take_stamps(&mut self) {
        while let Some((id, realtime_ns)) = self.socket.sent() {
            if let Some(stamp) = self.local.stamp(realtime_ns) {
                self.clock.sent(id, stamp);
            }
        }
    }

    /// Takes what came; when the impairment has more.
    fn take_datagrams(&mut self) -> u64 {
        let mut datagram = [0; TIME_BYTES];
        for _ in 0..BURST {
            let Some(Came { bytes, source, realtime_ns }) = self.socket.receive(&mut datagram) else { break };
            let now_ns = self.local.now_ns();
            let stamp = realtime_ns.and_then(|ns| self.local.stamp(ns)).unwrap_or(Stamp::by_us(now_ns));
            match &mut self.impairment {
                Some(impairment) => {
                    impairment.push(now_ns, Held { source, stamp, since_ns: now_ns }, &datagram[..bytes])
                }
                None => self.take(now_ns, source, stamp, &datagram[..bytes]),
            }
        }
        self.take_held(&mut datagram)
    }

    /// What the impairment has kept for long enough came so much later.
    fn take_held(&mut self, datagram: &mut [u8; TIME_BYTES]) -> u64 {
        loop {
            let now_ns = self.local.now_ns();
            let Some(impairment) = &mut self.impairment else { return u64::MAX };
            let (Held { source, stamp, since_ns }, held) = match impairment.poll(now_ns) {
                Output::Send { to, datagram } => (to, datagram),
                Output::Wait { until_ns } => return until_ns,
            };
            let bytes = held.len().min(TIME_BYTES);
            datagram[..bytes].copy_from_slice(&held[..bytes]);
            let stamp = Stamp { ns: stamp.ns + (now_ns - since_ns), ..stamp };
            self.take(now_ns, source, stamp, &datagram[..bytes]);
        }
    }

    fn take(&mut self, now_ns: u64, source: IpAddr, stamp: Stamp, datagram: &[u8]) {
        let taken = match FrameHead::parse(datagram) {
            Ok((head, rest)) if self.socket.is_from(head.from, source) => {
                self.clock.handle(now_ns, stamp, &head, rest).is_ok()
            }
            _ => false,
        };
        self.snapshot.ignored += u64::from(!taken);
        if let Some(exchange) = self.clock.take_exchange() {
            (self.snapshot.exchanges, self.snapshot.by_kernel) = (self.snapshot.exchanges + 1, exchange.by_kernel);
            if let Some(observer) = &self.observer {
                // Who does not keep up misses some.
                let _ = observer.try_send(exchange);
            }
        }
    }

    fn write_page(&mut self) {
        let Some(keeper) = &mut self.keeper else { return };
        for _ in 0..WRITE_TRIES {
            let record = *self.clock.record();
            if self.written == Some(record) {
                return;
            }
            if keeper.write(&record) {
                self.written = Some(record);
            } else if let Some(page) = keeper.record() {
                self.clock.page_says(self.local.now_ns(), &page);
            }
        }
    }

    fn show(&mut self) {
        let Snapshot { exchanges, by_kernel, ignored, real_time, .. } = self.snapshot;
        let seen = Snapshot::of(&self.clock, self.local.now_ns());
        self.snapshot = Snapshot { exchanges, by_kernel, ignored, real_time, ..seen };
        self.state.show(&self.snapshot);
    }

    /// Sleeps until then, or until there is something to take; true when the clock is to end.
    fn sleep(&mut self, until_ns: u64) -> bool {
        let wait = Duration::from_nanos(until_ns.saturating_sub(self.local.now_ns()));
        let mut fds =
            [PollFd::new(self.socket.as_fd(), PollFlags::POLLIN), PollFd::new(self.ended.as_fd(), PollFlags::POLLIN)];
        // Interrupted or not: the next round looks for itself.
        let _ = ppoll(&mut fds, Some(TimeSpec::from_duration(wait)), None);
        fds[1].revents().is_some_and(|events| !events.is_empty())
    }
}
