//! The clock at work: a thread with a socket of its own, at the port above that of packages.
//!
//! ```text
//!  kernel ─ stamps of what left ─▶ ┌───────┐ ─ record ─▶ the node's page of time
//!         ─ datagrams, stamps ───▶ │ Clock │ ─ snapshot ▶ ClockState, for tools
//!         ◀── datagrams ────────── └───────┘
//! ```
//!
//! The thread sleeps in one system call until a datagram, a stamp or its time comes. It takes nothing from the heap for
//! a datagram. What strangers send is dropped in the kernel; for datagrams with the address of a node it works for a
//! share of the time at most. The [driver](crate::driver) decides what it does, and when.

mod local;
mod runtime;
mod socket;
mod state;
#[cfg(test)]
mod tests;

pub use local::Skew;
pub(crate) use local::looked;
pub(super) use runtime::ClockRuntime;
pub use state::{ClockSnapshot, ClockState};

use crate::driver::ClockStep;
use crate::frame::NodeIndex;
use crate::impair;
use crate::settings::Settings;
use crate::time::TimeSettings;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use rohrpost_config::{FIFO_MAX, Installation, TimeSource};
use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_mailbox::{Node, NodeError};
use std::io::{self, PipeReader, PipeWriter};
use std::net::SocketAddr;
use std::os::fd::AsFd;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

/// Above all else: a stamp of our own, where the kernel has none, is as good as this thread is quick. Also of the
/// thread that sends in time slots, if it gets no reservation.
pub(super) const FIFO: u8 = FIFO_MAX + 11;

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
    /// Which node it is, and which nodes may be master.
    pub settings: TimeSettings,
    /// Where each node takes datagrams of time, in the order of the configuration; its own too.
    pub nodes: Vec<SocketAddr>,
    /// It writes the page of this node; none in tests that look at [`ClockState`] alone.
    pub node: Option<Arc<Node>>,
    /// A bad network before its socket.
    pub impair: Option<impair::ImpairmentSettings>,
    /// Whether the kernel stamps datagrams, if it can; else the clock does, as where it cannot.
    pub kernel_stamps: bool,
    /// For tests: see [`Skew`].
    pub skew: Option<Skew>,
}

impl ClockParts {
    /// The clock of a router of this installation; none unless its time comes from a master.
    pub fn new(router: &Settings, installation: &Installation, node: &Arc<Node>) -> Option<Self> {
        let TimeSource::Master { masters, interval } = &installation.time else { return None };
        let node = Some(node.clone());
        Some(Self { node, ..Self::of_router(router, masters, *interval) })
    }

    /// The clock of a router, without a page.
    pub fn of_router(router: &Settings, masters: &[NodeIndex], interval: Duration) -> Self {
        let port = router.network.time_port();
        let nodes = router.nodes.iter().map(|node| SocketAddr::new(node.address, port)).collect();
        Self::at(nodes, TimeSettings::of(router, masters, interval))
    }

    /// A clock with stamps of the kernel, without a page. `nodes`: where each takes datagrams of time, in order.
    pub fn at(nodes: Vec<SocketAddr>, settings: TimeSettings) -> Self {
        Self { settings, nodes, node: None, impair: None, kernel_stamps: true, skew: None }
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
    /// Binds the socket and starts the thread. What an earlier incarnation of this router wrote in the node's page goes
    /// on.
    ///
    /// # Errors
    /// [`ClockError`]
    pub fn start(parts: ClockParts) -> Result<Self, ClockError> {
        Self::of(ClockRuntime::new(parts)?)
    }

    /// A service of parts that were made already.
    pub(super) fn of(runtime: ClockRuntime) -> Result<Self, ClockError> {
        let state = runtime.state().clone();
        let (ended, ends) = io::pipe().map_err(ClockError::Thread)?;
        let mut worker = Worker { runtime, ended };
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

/// The thread.
struct Worker {
    runtime: ClockRuntime,
    ended: PipeReader,
}

impl Worker {
    fn run(&mut self) {
        // The router's other threads tell when it is refused.
        let _ = schedule(Scheduling::Fifo(FIFO));
        loop {
            let ClockStep { for_ns, reads } = self.runtime.poll();
            if self.sleep(Duration::from_nanos(for_ns), reads) {
                return;
            }
        }
    }

    /// Sleeps for so long; if it `reads`, only until there is something to take. True when the clock is to end.
    fn sleep(&mut self, time: Duration, reads: bool) -> bool {
        let mut fds =
            [PollFd::new(self.ended.as_fd(), PollFlags::POLLIN), PollFd::new(self.runtime.as_fd(), PollFlags::POLLIN)];
        let watched = if reads { &mut fds[..] } else { &mut fds[..1] };
        // Interrupted or not: the next round looks for itself.
        let _ = ppoll(watched, Some(TimeSpec::from_duration(time)), None);
        fds[0].revents().is_some_and(|events| !events.is_empty())
    }
}
