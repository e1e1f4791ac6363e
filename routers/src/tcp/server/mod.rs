//! The TCP router at work: one thread, which sleeps on all sockets at once.
//!
//! No client can make it wait: each socket is read a bounded piece at a time, and what it does not take waits in the
//! client's own queue.

mod accept;
mod parts;
mod reporter;

pub use parts::{ServerError, ServerParts};

use super::fault_writer::FaultWriter;
use super::replicas::LineCounts;
use super::seal::{Holder, ServerSeal};
use super::snapshots::{Class, LatestValue, MEMBERS_MAX, Members, SAY_EVERY_NS};
use super::stream::{Moved, Stream};
use crate::replication::MeasuredRoundTrip;
use crate::session::server::{MemberSnapshot, Names, Rights, Server, ServerStep};
use crate::session::{Cause, ClientIndex};
use accept::{listen, raise_descriptors};
use nix::sys::epoll::{Epoll, EpollCreateFlags, EpollEvent, EpollFlags, EpollTimeout};
use nix::sys::eventfd::{EfdFlags, EventFd};
use reporter::ServerReporter;
use rohrpost_mailbox::{Interest, Name, Participant, SystemClock, Watches, monotonic_ns};
use std::collections::BTreeMap;
use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Read from one client before the others have their turn.
const PIECE_BYTES: usize = 64 * 1024;
const EVENTS: usize = 256;
/// File descriptors of a process besides its connections, at most.
const DESCRIPTORS_BESIDE: u64 = 256;
/// Token of the listening socket; no client has this index.
const LISTENER: u64 = u64::MAX;
const BELL: u64 = u64::MAX - 1;

/// The TCP router at work; dropped, it tells its clients and ends.
pub struct ServerShell {
    shared: Arc<ServerShared>,
    counts: LineCounts,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct ServerShared {
    ends: AtomicBool,
    bell: EventFd,
    seen: LatestValue<Members>,
}

impl ServerShell {
    /// Listens, and starts the thread.
    ///
    /// # Errors
    /// [`ServerError`]
    pub fn start(parts: ServerParts<'_>) -> Result<Self, ServerError> {
        let ServerParts { address, settings, faults, seal, names, node, replicas } = parts;
        let own = settings.system.map(|(system, _)| system);
        let io = |doing| move |error: io::Error| ServerError::Io(address, doing, error);
        raise_descriptors(u64::from(settings.clients_max) + u64::from(settings.handshakes_max) + DESCRIPTORS_BESIDE);
        let listener = listen(address)?;
        let epoll = Epoll::new(EpollCreateFlags::EPOLL_CLOEXEC).map_err(|errno| io("epoll")(errno.into()))?;
        let bell = EventFd::from_flags(EfdFlags::EFD_CLOEXEC | EfdFlags::EFD_NONBLOCK)
            .map_err(|errno| io("an eventfd")(errno.into()))?;
        let watch = |epoll: &Epoll| {
            epoll.add(&listener, EpollEvent::new(EpollFlags::EPOLLIN, LISTENER))?;
            epoll.add(&bell, EpollEvent::new(EpollFlags::EPOLLIN, BELL))
        };
        watch(&epoll).map_err(|errno| io("epoll")(errno.into()))?;
        let shared = Arc::new(ServerShared { ends: AtomicBool::new(false), bell, seen: LatestValue::default() });
        let fault_writer = FaultWriter::new(faults, format!("beyond the TCP router at {address}"));
        let mut host = ServerReporter::new(fault_writer);
        let mut watches = None;
        if let Some(parts) = replicas {
            let participant = Participant::join(node, Name::NONE)?;
            let mut all = Watches::new(&participant).map_err(io("what wakes it"))?;
            all.add(&epoll.0, Interest::Read).map_err(io("what wakes it"))?;
            watches = Some(all);
            // What its own router measures, that one alone knows.
            host.line = Some(parts.start(node, participant, MeasuredRoundTrip::default()));
        }
        let counts = LineCounts::of(host.line.as_ref());
        let work = ServerThread {
            shared: shared.clone(),
            server: Server::new(settings),
            host,
            seal,
            own,
            names,
            parting: Vec::new(),
            listener,
            accept_ns: None,
            epoll,
            watches,
            connections: Vec::new(),
            clock: SystemClock::open(node),
            piece: vec![0; PIECE_BYTES].into(),
        };
        let thread = std::thread::Builder::new().name("tcp-router".into()).spawn(move || work.run());
        Ok(Self { shared, counts, thread: Some(thread.map_err(ServerError::Thread)?) })
    }

    /// How it was a moment ago.
    pub fn members(&self) -> Members {
        self.shared.seen.get()
    }

    /// Counters of its replicas.
    pub fn replicas(&self) -> &LineCounts {
        &self.counts
    }

    /// Whether its thread still runs.
    pub fn is_well(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl Drop for ServerShell {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Release);
        // A bell that is full has been rung.
        let _ = self.shared.bell.write(1);
        if let Some(thread) = self.thread.take() {
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

struct ServerConnection {
    stream: Stream,
    peer: String,
    /// It has shown a certificate, if it must.
    is_known: bool,
    /// It is looked whether it takes bytes again.
    awaits_room: bool,
}

/// State of the thread.
struct ServerThread {
    shared: Arc<ServerShared>,
    server: Server,
    host: ServerReporter,
    seal: Option<ServerSeal>,
    own: Option<u8>,
    names: BTreeMap<String, Names>,
    /// Connections without a seal that holds, until the other end has read why, or this time has come, ns.
    parting: Vec<(u64, Stream)>,
    listener: TcpListener,
    /// There is no descriptor left: nothing is accepted before, ns.
    accept_ns: Option<u64>,
    epoll: Epoll,
    /// Where it has replicas: wakes it for records as well, and watches `epoll`.
    watches: Option<Watches>,
    /// By client.
    connections: Vec<Option<ServerConnection>>,
    clock: SystemClock,
    piece: Box<[u8]>,
}

impl ServerThread {
    /// Runs until the router ends.
    fn run(mut self) {
        let mut events = [EpollEvent::empty(); EVENTS];
        let (mut ending, mut say_ns) = (false, 0);
        loop {
            let now_ns = monotonic_ns();
            if now_ns >= say_ns {
                say_ns = now_ns + SAY_EVERY_NS;
                self.parting.retain(|(until_ns, _)| now_ns < *until_ns);
                self.server.set_time(self.clock.record());
                self.host.says_held(now_ns);
                self.say(now_ns);
            }
            if self.accept_ns.take_if(|at_ns| now_ns >= *at_ns).is_some() {
                self.listen_for(EpollFlags::EPOLLIN);
            }
            if !ending && self.shared.ends.load(Ordering::Acquire) {
                ending = true;
                // A client that is told of the end would come back.
                let _ = self.epoll.delete(&self.listener);
                self.accept_ns = None;
                self.server.end(now_ns, &mut self.host);
            }
            match self.server.poll(now_ns, &mut self.host) {
                ServerStep::Write(client) => self.write(client),
                ServerStep::Look => self.look(&mut events, EpollTimeout::ZERO),
                ServerStep::Close(client) => self.close(client),
                ServerStep::Wait { .. } if ending && self.connections.iter().all(Option::is_none) => return,
                ServerStep::Wait { until_ns } => self.sleep(&mut events, until_ns.min(say_ns)),
            }
        }
    }

    fn sleep(&mut self, events: &mut [EpollEvent], until_ns: u64) {
        let wait_ns = until_ns.saturating_sub(monotonic_ns());
        let Some((watches, line)) = self.watches.as_mut().zip(self.host.line.as_mut()) else {
            let timeout = EpollTimeout::try_from(wait_ns.div_ceil(1_000_000)).unwrap_or(EpollTimeout::ZERO);
            return self.look(events, timeout);
        };
        let mut readers: Vec<_> = line.readers().collect();
        watches.wait_any(&mut readers, Duration::from_nanos(wait_ns), || false);
        while watches.next_ready().is_some() {}
        self.look(events, EpollTimeout::ZERO);
    }

    /// Handles what happened to its sockets, or happens within a time.
    fn look(&mut self, events: &mut [EpollEvent], timeout: EpollTimeout) {
        // Interrupted by a signal, it looks again.
        let count = self.epoll.wait(events, timeout).unwrap_or(0);
        for event in &events[..count] {
            match event.data() {
                LISTENER => self.accept(),
                BELL => drop(self.shared.bell.read()),
                index => self.happened(ClientIndex(index as u16), event.events()),
            }
        }
    }

    /// Something happened to a client's socket; if the place has another client by now, there is nothing to read.
    fn happened(&mut self, client: ClientIndex, flags: EpollFlags) {
        if flags.contains(EpollFlags::EPOLLOUT) && self.flush(client) {
            self.await_room(client, false);
            self.server.writable(client);
        }
        if flags.intersects(EpollFlags::EPOLLIN | EpollFlags::EPOLLHUP | EpollFlags::EPOLLERR) {
            self.read(client);
        }
    }

    fn read(&mut self, client: ClientIndex) {
        let Some(connection) = connection(&mut self.connections, client) else { return };
        let moved = connection.stream.read(&mut self.piece);
        let is_new = !connection.is_known;
        match moved {
            Moved::Over(Some(error)) if is_new && error.kind() == io::ErrorKind::Other => self.unsealed(client, &error),
            Moved::Over(_) => self.broke(client),
            Moved::Nothing => drop(self.flush(client)),
            Moved::Bytes(_) if is_new && !self.is_known(client) => {
                self.server.names_nobody(monotonic_ns(), client, &mut self.host);
            }
            Moved::Bytes(bytes) => {
                self.server.received(monotonic_ns(), client, &self.piece[..bytes], &mut self.host);
            }
        }
    }

    /// Learns a client's identity from its certificate; false: that does not name one.
    fn is_known(&mut self, client: ClientIndex) -> bool {
        let Some(connection) = connection(&mut self.connections, client) else { return false };
        if connection.stream.is_sealed() {
            let Some(Holder::Node { node, system }) = connection.stream.holder() else { return false };
            let given = || Rights::only(self.names.get(&node).cloned().unwrap_or_default());
            let rights = if self.own == Some(system) { given() } else { Rights::any() };
            self.server.certify(client, system, &format!("node {node} of system {system}"), rights);
        }
        connection.is_known = true;
        true
    }

    /// Hands on what a connection took; whether all of it has left.
    fn flush(&mut self, client: ClientIndex) -> bool {
        let Some(connection) = connection(&mut self.connections, client) else { return false };
        match connection.stream.flush() {
            Ok(()) if connection.stream.has_unsent() => self.await_room(client, true),
            Ok(()) => return true,
            Err(_) => self.broke(client),
        }
        false
    }

    fn write(&mut self, client: ClientIndex) {
        let Some(connection) = connection(&mut self.connections, client) else { return };
        let (ready, waits) = (self.server.ready(client), self.server.has_waiting(client));
        let moved = connection.stream.write(ready, waits);
        let all = matches!(moved, Moved::Bytes(bytes) if bytes == ready.len()) && !connection.stream.has_unsent();
        match moved {
            Moved::Bytes(bytes) => self.server.took(monotonic_ns(), client, bytes),
            Moved::Nothing => self.server.took(monotonic_ns(), client, 0),
            Moved::Over(_) => return self.broke(client),
        }
        if !all || waits {
            connection.stream.set_round_trip(self.server.round_trip_ns(client));
            self.server.set_batch(client, connection.stream.batch_bytes());
        }
        if !all {
            self.await_room(client, true);
        }
    }

    /// Whether epoll tells when a socket takes bytes again.
    fn await_room(&mut self, client: ClientIndex, awaits: bool) {
        let Some(connection) = connection(&mut self.connections, client) else { return };
        if connection.awaits_room != awaits {
            connection.awaits_room = awaits;
            let flags = if awaits { EpollFlags::EPOLLIN | EpollFlags::EPOLLOUT } else { EpollFlags::EPOLLIN };
            let mut event = EpollEvent::new(flags, client.0.into());
            if self.epoll.modify(&connection.stream, &mut event).is_err() {
                self.broke(client);
            }
        }
    }

    fn broke(&mut self, client: ClientIndex) {
        self.close(client);
        self.server.closed(monotonic_ns(), client, &mut self.host);
    }

    /// Closed, a socket is in no epoll any more.
    fn close(&mut self, client: ClientIndex) {
        if let Some(place) = self.connections.get_mut(usize::from(client.0)) {
            *place = None;
        }
    }

    fn say(&self, now_ns: u64) {
        let member = |(client, member): (ClientIndex, MemberSnapshot)| {
            let connection = self.connections.get(usize::from(client.0)).and_then(Option::as_ref);
            MemberSnapshot { peer: connection.map_or_else(String::new, |it| it.peer.clone()), ..member }
        };
        let members: Vec<_> = self.server.snapshots(now_ns).take(MEMBERS_MAX).map(member).collect();
        let more = (self.server.clients().count() - members.len()) as u64;
        self.shared.seen.say(Members {
            members,
            more,
            left: self.host.left,
            refused: self.host.refused,
            refusal: self.host.refusal.clone(),
            crowded: self.server.crowded(),
            crowded_packages: self.server.counts().lost_for(Cause::Share),
            superseded: self.server.superseded(),
            held: self.host.throttle.held,
            classes: Class::all(self.server.counts()),
        });
    }
}

fn connection(connections: &mut [Option<ServerConnection>], client: ClientIndex) -> Option<&mut ServerConnection> {
    connections.get_mut(usize::from(client.0))?.as_mut()
}
