//! The clock at work: a thread with a socket of its own, at the port above that of packages.
//!
//! ```text
//!  kernel ─ stamps of what left ─▶ ┌───────┐ ─ record ─▶ the node's page of time
//!         ─ datagrams, stamps ───▶ │ Clock │ ─ snapshot ▶ ClockState, for tools
//!         ◀── datagrams ────────── └───────┘
//! ```
//!
//! The thread sleeps in one system call until a datagram, a stamp or its time comes. It takes nothing from the heap for
//! a datagram. What strangers send is dropped in the kernel; whatever comes with a node's address, it works for a
//! share of the time at most.

mod cpu_budget;
mod local;
mod socket;
mod state;
#[cfg(test)]
mod tests;
mod works;

pub use local::Skew;
pub(crate) use local::looked;
pub use state::{ClockSnapshot, ClockState};
pub(super) use works::Works;

use crate::impair;
use crate::settings::Settings;
use crate::time::{Exchange, Step, TIME_BYTES, TimeSettings};
use cpu_budget::CpuBudget;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use rohrpost_config::{FIFO_MAX, Installation, TimeSource};
use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_mailbox::{Node, NodeError, monotonic_ns};
use std::io::{self, PipeReader, PipeWriter};
use std::net::SocketAddr;
use std::os::fd::AsFd;
use std::sync::Arc;
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;
use std::time::Duration;

/// Above all else: a stamp of our own, where the kernel has none, is as good as this thread is quick. Also of the
/// thread that sends in time slots, if it gets no reservation.
pub(super) const FIFO: u8 = FIFO_MAX + 11;

/// However long nothing comes: so often it looks whether the computer has slept, or its clock is slewed.
const LOOKS_EVERY: Duration = Duration::from_millis(100);

/// Datagrams that are taken before what is due is sent.
const BURST: usize = 64;

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
    /// Binds the socket and starts the thread. What an earlier incarnation of this router wrote in the node's page goes
    /// on.
    ///
    /// # Errors
    /// [`ClockError`]
    pub fn start(parts: ClockParts) -> Result<Self, ClockError> {
        Self::of(Works::new(parts)?)
    }

    /// A service of parts that were made already.
    pub(super) fn of(works: Works) -> Result<Self, ClockError> {
        let state = works.state().clone();
        let (ended, ends) = io::pipe().map_err(ClockError::Thread)?;
        let mut worker = Worker { works, ended };
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
    works: Works,
    ended: PipeReader,
}

impl Worker {
    fn run(&mut self) {
        // The router's other threads tell when it is refused.
        self.works.runs_in_real_time(schedule(Scheduling::Fifo(FIFO)).is_ok());
        let mut datagram = [0; TIME_BYTES];
        let mut share = CpuBudget::new(monotonic_ns());
        loop {
            let began_ns = monotonic_ns();
            // Used up, what comes waits; what is due is sent all the same.
            let rests_ns = share.rests_until_ns(began_ns);
            let held_ns = if rests_ns.is_none() { self.works.take(BURST, |_, _| {}) } else { u64::MAX };
            let until_ns = loop {
                let now_ns = self.works.now_ns();
                match self.works.clock.poll(now_ns, &mut datagram) {
                    Step::Send { to, .. } => {
                        self.works.send(to, &datagram);
                    }
                    Step::Wait { until_ns } => break until_ns,
                }
            };
            self.works.publish();
            share.uses(began_ns, monotonic_ns());
            let rest = rests_ns.map(|rests_ns| Duration::from_nanos(rests_ns.saturating_sub(monotonic_ns())));
            if self.sleep(until_ns.min(held_ns), rest) {
                return;
            }
        }
    }

    /// Sleeps until then, or until there is something to take; only until it has rested, and whatever comes, if it has
    /// to. True when the clock is to end.
    fn sleep(&mut self, until_ns: u64, rest: Option<Duration>) -> bool {
        let wait = Duration::from_nanos(until_ns.saturating_sub(self.works.now_ns())).min(LOOKS_EVERY);
        let mut fds =
            [PollFd::new(self.ended.as_fd(), PollFlags::POLLIN), PollFd::new(self.works.as_fd(), PollFlags::POLLIN)];
        let (watched, wait) = match rest {
            Some(rest) => (&mut fds[..1], wait.min(rest)),
            None => (&mut fds[..], wait),
        };
        // Interrupted or not: the next round looks for itself.
        let _ = ppoll(watched, Some(TimeSpec::from_duration(wait)), None);
        fds[0].revents().is_some_and(|events| !events.is_empty())
    }
}
