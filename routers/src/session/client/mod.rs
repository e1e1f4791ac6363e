//! A client: keeps up a connection to the server, registers what it hosts, and carries packages both ways.
//!
//! ```text
//!  away ─ wait is over ─▶ connecting ─ connected ─▶ handshake ─ welcome ─▶ member ─ register ─▶ up
//!   ▲                         └───── too long ─────────┴─ refusal ──┴─ silence, damage, end of the stream ┘
//!   └──────────────────────────── waits longer each time ◀──────────────────────────────────────┘
//! ```

mod asking;
mod backoff;
mod host;
mod incoming;
mod sending;

pub use backoff::BACKOFF_MAX_NS;
pub use host::{ClientEvent, ClientHost};

use super::counts::{Cause, SessionCounts};
use super::estimate::ServerClockEstimate;
use super::frame::{Range, SessionHello, SessionMessage, SessionRefusalReason};
use super::outgoing::Outgoing;
use super::splitter::Splitter;
use super::{HANDSHAKE_MAX_NS, LOOK_EVERY_NS, STALLED_AFTER_NS};
use crate::admission::Admission;
use asking::Asking;
use backoff::Backoff;
use rohrpost_mailbox::Head;

/// A connection is made within so long, or not at all.
const CONNECT_MAX_NS: u64 = 5_000_000_000;
/// A connection that holds for so long is no failure.
const LASTING_NS: u64 = 5_000_000_000;
/// Interval after which a refused range is registered again: the client that had it may have gone.
const REGISTER_AGAIN_NS: u64 = 500_000_000;
/// A look that comes so late says that this client stood still itself.
const STOOD_STILL_NS: u64 = 4 * LOOK_EVERY_NS;

/// What a client knows before its first connection.
#[derive(Clone, Debug)]
pub struct ClientSettings {
    /// For people.
    pub name: String,
    /// First byte of the names that it hosts.
    pub system: u8,
    /// What is sent to all systems reaches its own without the server.
    pub reaches_own: bool,
    /// Digest of what must be equal everywhere.
    pub common: u64,
    /// Digest of what must be equal inside a system.
    pub system_digest: u64,
    /// Tells this incarnation from others; not 0. Also what its waits are drawn from.
    pub incarnation: u64,
    /// Bytes of packages that wait.
    pub quota_bytes: usize,
    /// Level of each priority; 0 goes first.
    pub levels: [u8; 256],
    /// What is admitted of what the server brings.
    pub admission: Admission,
}

/// A package that is to go to the server.
#[derive(Clone, Copy, Debug)]
pub struct ClientPackage<'a> {
    /// Its head.
    pub head: Head,
    /// Its body; as long as the head says.
    pub body: &'a [u8],
    /// When its sender published it, ns of the monotonic clock.
    pub published_ns: u64,
    /// How often it was forwarded before: 0, except for a package that came from a server.
    pub hops: u8,
}

/// Next step for the code around the core, from [`Client::poll`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ClientStep {
    /// Connect; then [`Client::connected`] or [`Client::closed`].
    Connect,
    /// Write what [`Client::ready`] has, then say how much with [`Client::took`].
    Write,
    /// Close the connection, or give up connecting. It counts as closed.
    Close,
    /// Nothing before this time, unless something comes.
    Wait {
        /// Ns of the monotonic clock.
        until_ns: u64,
    },
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum ClientState {
    Away { until_ns: u64 },
    Connecting { until_ns: u64 },
    Handshake { until_ns: u64 },
    Member,
    Closing,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Registration {
    /// It is to be said, at this time.
    Due(u64),
    /// It was said.
    Asked,
    Holds,
}

/// A client.
#[derive(Debug)]
pub struct Client {
    settings: ClientSettings,
    ranges: Vec<Range>,
    state: ClientState,
    registration: Registration,
    number: u32,
    attempt: u64,
    backoff: Backoff,
    splitter: Splitter,
    outgoing: Outgoing,
    is_blocked: bool,
    is_slow: bool,
    /// Parts of replicas may leave and come.
    has_line: bool,
    /// Some wait.
    has_parts: bool,
    estimate: ServerClockEstimate,
    /// The end with these clocks.
    server_incarnation: u64,
    out: SessionCounts,
    inn: SessionCounts,
    /// What people know: the last refusal, or that it is up.
    told: Option<Reported>,
    /// When it was welcomed, if it was, ns.
    joined_ns: Option<u64>,
    /// Since when packages cannot leave, ns.
    down_ns: u64,
    heard_ns: u64,
    moved_ns: u64,
    asking: Asking,
    look_ns: u64,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Reported {
    Up,
    Refused(SessionRefusalReason),
    Objected,
    Damaged,
}

impl Client {
    /// Connects at once. `ranges` are the names that it hosts.
    pub fn new(settings: ClientSettings, ranges: Vec<Range>, now_ns: u64) -> Self {
        Self {
            ranges,
            state: ClientState::Away { until_ns: now_ns },
            registration: Registration::Due(0),
            number: 0,
            attempt: 0,
            backoff: Backoff::new(settings.incarnation),
            splitter: Splitter::default(),
            outgoing: Outgoing::new(settings.quota_bytes),
            is_blocked: false,
            is_slow: false,
            has_line: false,
            has_parts: false,
            estimate: ServerClockEstimate::default(),
            server_incarnation: 0,
            out: SessionCounts::default(),
            inn: SessionCounts::default(),
            told: None,
            joined_ns: None,
            down_ns: now_ns,
            heard_ns: now_ns,
            moved_ns: now_ns,
            asking: Asking::default(),
            look_ns: 0,
            settings,
        }
    }

    /// It hosts other names from now on.
    pub fn host(&mut self, now_ns: u64, ranges: Vec<Range>) {
        self.ranges = ranges;
        if self.is_up() {
            // What comes from now on waits for the answer.
            self.down_ns = now_ns;
        }
        self.registration = Registration::Due(now_ns);
    }

    /// Whether packages may leave.
    pub fn is_up(&self) -> bool {
        self.state == ClientState::Member && self.registration == Registration::Holds
    }

    /// What went to the server, and what did not; and of packages for all systems, what went to their own.
    pub fn out(&self) -> &SessionCounts {
        &self.out
    }

    /// What came from it.
    pub fn inn(&self) -> &SessionCounts {
        &self.inn
    }

    /// Connections that were made so far.
    pub fn connections(&self) -> u64 {
        self.attempt
    }

    /// Whether there is a connection.
    pub fn is_connected(&self) -> bool {
        matches!(self.state, ClientState::Handshake { .. } | ClientState::Member)
    }

    /// What it knows of the server's clocks, with what the way adds to their bounds.
    pub fn clock(&self) -> &ServerClockEstimate {
        &self.estimate
    }

    /// What was heard of the server's clocks does not count any more: this computer slept, or its clock is slewed.
    pub fn forget_time(&mut self) {
        self.estimate.forget();
    }

    /// Bytes of memory that what waits takes up.
    pub fn bytes(&self) -> usize {
        self.outgoing.bytes() + self.splitter.bytes()
    }

    /// Whether what the server said last is TLS.
    pub fn hears_tls(&self) -> bool {
        self.splitter.hears_tls()
    }

    /// The connection is made.
    pub fn connected(&mut self, now_ns: u64) {
        self.attempt += 1;
        self.state = ClientState::Handshake { until_ns: now_ns + HANDSHAKE_MAX_NS };
        self.splitter = Splitter::default();
        self.outgoing.cut();
        (self.heard_ns, self.moved_ns) = (now_ns, now_ns);
        let ClientSettings { name, system, reaches_own, common, system_digest, incarnation, .. } = &self.settings;
        self.outgoing.say(&SessionMessage::Hello(SessionHello {
            system: *system,
            reaches_own: *reaches_own,
            common: *common,
            system_digest: *system_digest,
            incarnation: *incarnation,
            attempt: self.attempt,
            asked_ns: now_ns,
            name,
        }));
    }

    /// The connection is closed or broken, or could not be made.
    pub fn closed(&mut self, now_ns: u64, host: &mut impl ClientHost) {
        if self.is_up() {
            self.down_ns = now_ns;
            self.told = None;
            host.event(ClientEvent::Down);
        }
        self.set_line(now_ns, false, host);
        if matches!(self.state, ClientState::Connecting { .. }) {
            // What the server said was before it went away.
            self.told = None;
        }
        if self.joined_ns.take().is_some_and(|joined_ns| now_ns.saturating_sub(joined_ns) > LASTING_NS) {
            self.backoff.lasted();
        }
        self.state = ClientState::Away { until_ns: now_ns + self.backoff.next_ns() };
        self.registration = Registration::Due(now_ns);
        (self.is_blocked, self.is_slow) = (false, false);
        self.outgoing.cut();
    }

    /// Bytes to be written.
    pub fn ready(&self) -> &[u8] {
        self.outgoing.ready()
    }

    /// Whether more waits than is ready.
    pub fn has_waiting(&self) -> bool {
        self.outgoing.has_waiting() || self.has_parts
    }

    /// The stream has taken so many of them. If those were not all, nothing more is written until [`Client::writable`].
    pub fn took(&mut self, now_ns: u64, bytes: usize) {
        self.outgoing.took(bytes);
        self.is_blocked = !self.outgoing.ready().is_empty();
        if bytes > 0 {
            self.moved_ns = now_ns;
        }
        self.asking.sent(now_ns, self.outgoing.sent());
    }

    /// The stream takes bytes again.
    pub fn writable(&mut self) {
        self.is_blocked = false;
    }

    /// What is known of how fast the stream takes bytes: whether so slowly that an answer may be long on its way, and
    /// how many are made ready for it at a time.
    pub fn set_pace(&mut self, is_slow: bool, batch_bytes: usize) {
        self.is_slow = is_slow;
        self.outgoing.set_batch(batch_bytes);
    }

    /// What to do next.
    pub fn poll(&mut self, now_ns: u64, host: &mut impl ClientHost) -> ClientStep {
        if now_ns >= self.look_ns {
            self.look(now_ns, host);
        }
        match self.state {
            ClientState::Away { until_ns } if now_ns >= until_ns => {
                self.state = ClientState::Connecting { until_ns: now_ns + CONNECT_MAX_NS };
                return ClientStep::Connect;
            }
            ClientState::Away { until_ns } | ClientState::Connecting { until_ns } if now_ns < until_ns => {
                return ClientStep::Wait { until_ns: until_ns.min(self.look_ns) };
            }
            ClientState::Member | ClientState::Handshake { .. } if !self.is_gone(now_ns) => {}
            _ => {
                self.closed(now_ns, host);
                return ClientStep::Close;
            }
        }
        self.ask(now_ns);
        host.replicas().into_iter().for_each(|replicas| replicas.refresh(now_ns));
        if self.is_blocked {
            return ClientStep::Wait { until_ns: self.look_ns };
        }
        self.add_part(now_ns, host);
        self.refill(now_ns, host);
        self.add_part(now_ns, host);
        match self.outgoing.ready() {
            [] => ClientStep::Wait { until_ns: self.next_ns() },
            _ => ClientStep::Write,
        }
    }

    fn is_gone(&self, now_ns: u64) -> bool {
        let is_slow = self.is_slow || self.splitter.waits_since().is_some();
        let is_silent = self.asking.is_silent(now_ns, self.heard_ns, self.moved_ns, is_slow);
        let is_stalled = now_ns.saturating_sub(self.moved_ns) > STALLED_AFTER_NS;
        match self.state {
            ClientState::Handshake { until_ns } => now_ns >= until_ns,
            _ => is_silent || is_stalled,
        }
    }

    fn look(&mut self, now_ns: u64, host: &mut impl ClientHost) {
        if self.look_ns > 0 && now_ns > self.look_ns + STOOD_STILL_NS {
            self.heard_ns = now_ns;
        }
        self.look_ns = now_ns + LOOK_EVERY_NS;
        if self.outgoing.ready().is_empty() {
            self.moved_ns = now_ns;
        }
        let cause = if self.is_up() { Cause::Stale } else { Cause::Offline };
        self.with_ledger(now_ns, host, |outgoing, ledger| outgoing.look(now_ns, cause, ledger));
    }

    fn next_ns(&self) -> u64 {
        let registers_ns = match self.registration {
            Registration::Due(at_ns) => at_ns,
            Registration::Asked | Registration::Holds => u64::MAX,
        };
        match self.state {
            ClientState::Member => self.look_ns.min(self.asking.next_ns).min(registers_ns),
            _ => self.look_ns,
        }
    }
}
