//! A router of the team at work: one thread, which sleeps on its mailbox and its socket at once.
//!
//! ```text
//!  modules ─▶ team-router.I.3 ─▶ Ways::carry ─┬─▶ socket ═▶
//!                   ▲                         └─▶ tcp.I.3, if there is one
//!  tcp.I ───────────┘ ─▶ TeamRouter::by_tcp ──┬─▶ mailboxes
//!                        socket ═▶ handle ────┘
//! ```

mod parts;
mod socket;
mod ways;

pub use parts::{TeamError, TeamLinks, TeamParts};

use crate::shell::transit;
use crate::tcp::snapshots::{LatestValue, SAY_EVERY_NS};
use crate::team::{TeamCounts, TeamRouter};
use rohrpost_mailbox::{Interest, Name, Participant, Receiver, Watch, Watches, monotonic_ns};
use socket::TeamSocketReach;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use ways::{TeamNames, Ways};

/// Packages or datagrams taken before the other side has its turn.
const BURST: usize = 64;
/// Pause after a socket could not be opened, or failed.
const AGAIN_NS: u64 = 1_000_000_000;

/// A router of the team at work; dropped, it ends. What waits in its mailbox stays there.
pub struct TeamShell {
    shared: Arc<TeamShared>,
    counts: Arc<TeamCounts>,
    /// Of its thread, which its bell wakes.
    participant: Arc<Participant>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct TeamShared {
    ends: AtomicBool,
    seen: LatestValue<TeamLinks>,
}

impl TeamShell {
    /// Makes the mailbox, tells the node the way to other systems, and starts the thread. A network that is not there
    /// yet is waited for.
    ///
    /// # Errors
    /// [`TeamError`]
    pub fn start(parts: TeamParts<'_>) -> Result<Self, TeamError> {
        let participant = Participant::join(parts.node, Name::NONE)?;
        let via = transit::name(parts.name);
        let mailbox = participant.receiver(via, transit::shape())?;
        let watches = Watches::new(&participant).map_err(TeamError::Watches)?;
        parts.node.set_routes_of_team(via, &parts.names)?;
        let router = TeamRouter::new(parts.settings, parts.tcp.is_some(), monotonic_ns());
        let (shared, counts) = (Arc::new(TeamShared::default()), router.counts().clone());
        let names = TeamNames { hosts: parts.hosts, others: parts.others, tcp: parts.tcp };
        let reach = TeamSocketReach::new(parts.team, parts.address);
        let ways = Ways::new(&participant, router, reach, names, parts.faults);
        let work = TeamThread { shared: shared.clone(), mailbox, watches, ways, watched: None, open_ns: 0 };
        let thread = std::thread::Builder::new().name("team".into()).spawn(move || work.run());
        let thread = Some(thread.map_err(TeamError::Thread)?);
        Ok(Self { shared, counts, participant, thread })
    }

    /// How it was a moment ago.
    pub fn links(&self) -> TeamLinks {
        self.shared.seen.get()
    }

    /// What it counts.
    pub fn counts(&self) -> &TeamCounts {
        &self.counts
    }

    /// Whether its thread still runs.
    pub fn is_well(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl Drop for TeamShell {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Release);
        self.participant.ring();
        if let Some(thread) = self.thread.take() {
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

/// State of the thread.
struct TeamThread {
    shared: Arc<TeamShared>,
    mailbox: Receiver,
    watches: Watches,
    ways: Ways,
    /// How the open socket is watched.
    watched: Option<(Watch, Interest)>,
    /// When a socket may be opened next, monotonic ns.
    open_ns: u64,
}

impl TeamThread {
    /// Runs until the router ends.
    fn run(mut self) {
        let mut say_ns = 0;
        while !self.shared.ends.load(Ordering::Acquire) {
            let now_ns = monotonic_ns();
            self.keep_open(now_ns);
            let mut more = self.take();
            more |= self.ways.receive(BURST);
            let due_ns = self.ways.beat(monotonic_ns());
            if now_ns >= say_ns {
                say_ns = now_ns + SAY_EVERY_NS;
                self.shared.seen.say(self.ways.links());
            }
            if more {
                continue;
            }
            // Only now is it known whether a datagram waits for room.
            self.watch();
            let until_ns = due_ns.min(say_ns).min(if self.watched.is_none() { self.open_ns } else { u64::MAX });
            self.sleep(until_ns);
        }
    }

    /// Opens the socket if there is none.
    fn keep_open(&mut self, now_ns: u64) {
        if self.ways.socket().is_some() {
            return;
        }
        if let Some((watch, _)) = self.watched.take() {
            self.watches.remove(watch);
        }
        if now_ns >= self.open_ns {
            self.open_ns = now_ns + AGAIN_NS;
            self.ways.open();
        }
    }

    /// Watches the open socket for what it is needed for.
    fn watch(&mut self) {
        let interest = if self.ways.awaits_room() { Interest::Both } else { Interest::Read };
        let Some(socket) = self.ways.socket() else { return };
        if self.watched.is_some_and(|(_, watched)| watched == interest) {
            return;
        }
        if let Some((watch, _)) = self.watched.take() {
            self.watches.remove(watch);
        }
        match self.watches.add(socket, interest) {
            Ok(watch) => self.watched = Some((watch, interest)),
            Err(error) => self.ways.failed(&error),
        }
    }

    /// Takes what waits in the mailbox, most important first; whether there may be more.
    fn take(&mut self) -> bool {
        for _ in 0..BURST {
            if self.ways.awaits_room() {
                return false;
            }
            let Some(waiting) = self.mailbox.try_receive() else { return false };
            self.ways.carry(monotonic_ns(), waiting.head(), waiting.body());
        }
        true
    }

    fn sleep(&mut self, until_ns: u64) {
        let deadline = Instant::now() + Duration::from_nanos(until_ns.saturating_sub(monotonic_ns()));
        let shared = &self.shared;
        let ends = || shared.ends.load(Ordering::Acquire);
        // What waits in the mailbox waits for the socket, if that has no room.
        if self.ways.awaits_room() {
            self.watches.wait_any::<Receiver>(&mut [], Some(deadline), ends);
        } else {
            self.watches.wait_any(&mut [&mut self.mailbox], Some(deadline), ends);
        }
        while let Some(ready) = self.watches.next_ready() {
            if ready.writable {
                self.ways.has_room();
            }
        }
    }
}
