//! A node's client at work: one thread, which sleeps on the node's mailbox for what is beyond and on its socket at
//! once.
//!
//! ```text
//!  modules ─▶ tcp.I.3 ─▶ session::Client ─▶ socket ═▶
//!             bell ─┐        │      ▲  ┌─ socket ◀═
//!                   └ sleep ─┘      └──┘  deliver ─▶ mailboxes
//! ```

mod parts;
mod reporter;
mod time;

pub use parts::{ClientError, ClientParts};

use super::bad_line::BadLine;
use super::fault_writer::FaultWriter;
use super::replicas::LineCounts;
use super::seal::ClientSeal;
use super::snapshots::{Class, ClientLink, LatestValue, LinkState, SAY_EVERY_NS};
use super::stream::{Moved, Stream};
use crate::admission::capped;
use crate::replication::MeasuredRoundTrip;
use crate::session::client::{Client, ClientPackage, ClientStep};
use crate::session::frame::{BadSessionFrame, Range};
use crate::session::in_system;
use crate::shell::sender_cache::SenderCache;
use crate::shell::transit;
use reporter::{EventReporter, TeamWay};
use rohrpost_mailbox::{
    ALL_SYSTEMS, Head, Interest, Name, Participant, Receiver, Source, Watch, Watches, monotonic_ns,
};
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use time::Time;

/// Packages taken from the mailbox before the socket has its turn.
const BURST: usize = 64;
/// Read before the mailbox has its turn.
const PIECE_BYTES: usize = 64 * 1024;

/// A client at work; dropped, it ends. What waits in its mailbox stays there.
pub struct ClientShell {
    shared: Arc<ClientShared>,
    /// Of its thread, which its bell wakes.
    participant: Arc<Participant>,
    counts: LineCounts,
    /// Ends after the thread does.
    _bad_line: Option<BadLine>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct ClientShared {
    /// By which the client measures the time of its node.
    round_trip: MeasuredRoundTrip,
    ends: AtomicBool,
    seen: LatestValue<ClientLink>,
}

impl ClientShell {
    /// Makes the mailbox, tells the node what is beyond, and starts the thread.
    ///
    /// # Errors
    /// [`ClientError`]
    pub fn start(parts: ClientParts<'_>) -> Result<Self, ClientError> {
        let ClientParts { node, name, server, settings, hosts, registers, others, .. } = parts;
        let ClientParts { beyond, faults, seal, keeps_time, impair, team, replicas, .. } = parts;
        let participant = Participant::join(node, Name::NONE)?;
        let via = transit::name(name);
        let mailbox = participant.receiver(via, transit::shape())?;
        let watches = Watches::new(&participant).map_err(ClientError::Watches)?;
        node.set_routes_beyond(via, &beyond)?;
        let time = keeps_time.then(|| Time::new(node)).transpose()?;
        let bad_line = impair.map(|impair| BadLine::begin(server, impair)).transpose().map_err(ClientError::BadLine)?;
        let (shared, system) = (Arc::new(ClientShared::default()), settings.system);
        let range = |(first, last)| Range { first, last };
        let mut reporter = EventReporter::new(
            server,
            SenderCache::here(&participant, &hosts),
            FaultWriter::new(faults, format!("beyond the TCP router at {server}")),
        );
        reporter.team = team.map(|team| TeamWay::new(&participant, team, system));
        reporter.line = replicas.map(|parts| parts.start(node, participant.clone(), shared.round_trip.clone()));
        let counts = LineCounts::of(reporter.line.as_ref());
        let work = ClientThread {
            shared: shared.clone(),
            server: bad_line.as_ref().map_or(server, BadLine::near),
            client: Client::new(settings, registers.into_iter().map(range).collect(), monotonic_ns()),
            reporter,
            system,
            others: others.into_iter().map(range).collect(),
            ways_to_others: SenderCache::everywhere(&participant),
            seal,
            time,
            mailbox,
            watches,
            connection: None,
            piece: vec![0; PIECE_BYTES].into(),
        };
        let thread = std::thread::Builder::new().name("tcp-client".into()).spawn(move || work.run());
        let thread = Some(thread.map_err(ClientError::Thread)?);
        Ok(Self { shared, participant, counts, _bad_line: bad_line, thread })
    }

    /// How it was a moment ago.
    pub fn link(&self) -> ClientLink {
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

impl Drop for ClientShell {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Release);
        self.participant.ring();
        if let Some(thread) = self.thread.take() {
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

struct ClientConnection {
    stream: Stream,
    watch: Watch,
    /// It is not made yet.
    is_begun: bool,
    awaits_room: bool,
}

/// State of the thread.
struct ClientThread {
    shared: Arc<ClientShared>,
    /// Where it connects to.
    server: SocketAddr,
    client: Client,
    reporter: EventReporter,
    /// First byte of the names of its node.
    system: u8,
    others: Box<[Range]>,
    ways_to_others: SenderCache,
    seal: Option<ClientSeal>,
    /// Of the node, if the server tells it.
    time: Option<Time>,
    mailbox: Receiver,
    watches: Watches,
    connection: Option<ClientConnection>,
    piece: Box<[u8]>,
}

impl ClientThread {
    /// Runs until the node ends.
    fn run(mut self) {
        let mut say_ns = 0;
        // Whether it has written since it last looked at the socket.
        let mut has_written = false;
        while !self.shared.ends.load(Ordering::Acquire) {
            let more = self.take();
            let now_ns = monotonic_ns();
            if now_ns >= say_ns {
                say_ns = now_ns + SAY_EVERY_NS;
                self.say(now_ns);
            }
            match self.client.poll(now_ns, &mut self.reporter) {
                ClientStep::Connect => self.connect(now_ns),
                ClientStep::Write => {
                    self.write();
                    // However much there is to send, what comes has its turn; a client with one package looks when it
                    // sleeps.
                    if has_written {
                        self.watches.look();
                    }
                    has_written = !has_written;
                }
                ClientStep::Close => self.forget(),
                ClientStep::Wait { .. } if more => self.watches.look(),
                ClientStep::Wait { until_ns } => {
                    self.sleep(until_ns.min(say_ns));
                    has_written = false;
                }
            }
            while let Some(ready) = self.watches.next_ready() {
                if ready.writable {
                    self.writable();
                }
                if ready.readable {
                    self.read();
                }
            }
        }
    }

    /// Takes what waits in the mailbox, most important first; whether there may be more.
    fn take(&mut self) -> bool {
        for _ in 0..BURST {
            let Some(waiting) = self.mailbox.try_receive() else { return false };
            let (head, published_ns, body) = (capped(waiting.head()), waiting.published_ns(), waiting.body());
            if head.to.system() == ALL_SYSTEMS {
                // Its own system is one of them: there it goes as any package does, by the LAN, or if need be by the
                // server. A node that only the server reaches knows of no others: the server brings it to them.
                let to = in_system(head.to, self.system);
                let is_others = self.others.iter().any(|range| range.has(to));
                let sender_cache = if is_others { &mut self.ways_to_others } else { &mut self.reporter.sender_cache };
                let own = sender_cache.send(&Head { to, ..head }, body);
                self.client.reached_itself(to, head.priority, own.map_err(Into::into));
            }
            self.client.send(monotonic_ns(), &ClientPackage { head, body, published_ns, hops: 0 }, &mut self.reporter);
        }
        true
    }

    fn sleep(&mut self, until_ns: u64) {
        let deadline = Instant::now() + Duration::from_nanos(until_ns.saturating_sub(monotonic_ns()));
        let shared = &self.shared;
        let ends = || shared.ends.load(Ordering::Acquire);
        let Some(line) = &mut self.reporter.line else {
            self.watches.wait_any(&mut [&mut self.mailbox], Some(deadline), ends);
            return;
        };
        let mut sources: Vec<&mut dyn Source> = vec![&mut self.mailbox];
        sources.extend(line.readers().map(|reader| reader as &mut dyn Source));
        self.watches.wait_any(&mut sources, Some(deadline), ends);
    }

    fn connect(&mut self, now_ns: u64) {
        let sealed = self.seal.as_ref().map(ClientSeal::begin).transpose();
        let begun = sealed.and_then(|sealed| Stream::connect(self.server, sealed));
        let begun = begun.and_then(|stream| Ok((self.watches.add(&stream, Interest::Write)?, stream)));
        match begun {
            Ok((watch, stream)) => {
                self.connection = Some(ClientConnection { stream, watch, is_begun: true, awaits_room: true });
            }
            Err(error) => {
                self.reporter.unreached(&error.to_string(), false);
                self.client.closed(now_ns, &mut self.reporter);
            }
        }
    }

    fn writable(&mut self) {
        let Some(connection) = &mut self.connection else { return };
        if !connection.is_begun {
            if self.flush() {
                self.await_room(false);
                self.client.writable();
            }
            return;
        }
        match connection.stream.connected() {
            Ok(()) => {
                connection.is_begun = false;
                self.client.connected(monotonic_ns());
                self.await_room(false);
            }
            Err(error) => self.broke(Some(&error)),
        }
    }

    fn read(&mut self) {
        let Some(connection) = self.connection.as_mut().filter(|connection| !connection.is_begun) else { return };
        match connection.stream.read(&mut self.piece) {
            Moved::Bytes(bytes) => self.client.received(monotonic_ns(), &self.piece[..bytes], &mut self.reporter),
            Moved::Nothing => drop(self.flush()),
            Moved::Over(error) => self.broke(error.as_ref()),
        }
    }

    /// Hands on what the connection took; whether all of it has left.
    fn flush(&mut self) -> bool {
        let Some(connection) = &mut self.connection else { return false };
        match connection.stream.flush() {
            Ok(()) if connection.stream.has_unsent() => self.await_room(true),
            Ok(()) => return true,
            Err(error) => self.broke(Some(&error)),
        }
        false
    }

    fn write(&mut self) {
        let Some(connection) = &mut self.connection else { return };
        let (ready, waits) = (self.client.ready(), self.client.has_waiting());
        let moved = connection.stream.write(ready, waits);
        let all = matches!(moved, Moved::Bytes(bytes) if bytes == ready.len()) && !connection.stream.has_unsent();
        match moved {
            Moved::Bytes(bytes) => self.client.took(monotonic_ns(), bytes),
            Moved::Nothing => self.client.took(monotonic_ns(), 0),
            Moved::Over(error) => return self.broke(error.as_ref()),
        }
        if !all || waits {
            self.client.set_pace(connection.stream.is_slow(), connection.stream.batch_bytes());
            connection.stream.set_round_trip(self.client.clock().round_trip_ns());
        }
        if !all {
            self.await_room(true);
        }
    }

    /// Whether it wakes up when the socket takes bytes again.
    fn await_room(&mut self, awaits: bool) {
        let Some(connection) = &mut self.connection else { return };
        if connection.awaits_room == awaits {
            return;
        }
        connection.awaits_room = awaits;
        self.watches.remove(connection.watch);
        let interest = if awaits { Interest::Both } else { Interest::Read };
        match self.watches.add(&connection.stream, interest) {
            Ok(watch) => connection.watch = watch,
            Err(error) => self.broke(Some(&error)),
        }
    }

    fn broke(&mut self, error: Option<&io::Error>) {
        self.forget();
        let (was_up, was_made) = (self.client.is_up(), self.client.is_connected());
        self.client.closed(monotonic_ns(), &mut self.reporter);
        if !was_up {
            let closed = || {
                if self.client.hears_tls() {
                    BadSessionFrame::Tls.to_string()
                } else {
                    "it closed the connection".into()
                }
            };
            self.reporter.unreached(&error.map_or_else(closed, ToString::to_string), was_made);
        }
    }

    fn forget(&mut self) {
        if let Some(connection) = self.connection.take() {
            self.watches.remove(connection.watch);
        }
    }

    fn say(&mut self, now_ns: u64) {
        if let Some(time) = &mut self.time {
            if !time.is_steady() {
                self.client.forget_time();
            }
            let clock = self.client.clock();
            time.told(now_ns, clock.system(now_ns), clock.answers());
            self.shared.round_trip.set(self.client.clock().round_trip_ns());
        }
        let client = &self.client;
        let state = match (client.is_up(), client.is_connected()) {
            (true, _) => LinkState::Up,
            (false, true) => LinkState::Joining,
            (false, false) => LinkState::Away,
        };
        let told = client.clock().system(now_ns).map(|record| record.at(now_ns).error);
        self.shared.seen.say(ClientLink {
            state,
            why: self.reporter.why.clone(),
            connections: client.connections(),
            round_trip_ns: client.clock().round_trip_ns(),
            time_error_ns: told.map(|error| u64::try_from(error.as_nanos()).unwrap_or(u64::MAX)),
            outage: self.reporter.outage,
            time: self.time.as_ref().map(|time| *time.record()),
            waiting_bytes: client.bytes() as u64,
            out: Class::all(client.out()),
            inn: Class::all(client.inn()),
        });
    }
}
