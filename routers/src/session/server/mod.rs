//! The server: takes what clients send, and gives it to the client that hosts the name.
//!
//! ```text
//!  accept ─▶ handshake ─ hello ─▶ member ─ register ─▶ RoutingTable  received ─▶ intake ─▶ carry ─▶ another's Outgoing
//!               │ too long, wrong       │ silent, stalled, replaced                                     │
//!               └──── refusal ─────▶ leaving ─▶ closed                poll ─▶ Write, Close, Wait ◀──────┘
//! ```

mod carry;
mod connections;
mod intake;
mod look;
mod member;
mod moving;
mod places;
mod principal;
mod registering;
mod replicas;
mod rights;
mod work;

pub use member::MemberState;
pub use moving::MovingHosts;
pub use places::Crowded;
pub(super) use principal::Principals;
pub use rights::{Names, OwnNode, OwnNodes, Rights};

use super::ClientIndex;
use super::counts::SessionCounts;
use super::frame::{Range, RegistrationVerdict, SessionRefusalReason};
use super::table::RoutingTable;
use super::{EndHost, LOOK_EVERY_NS};
use member::{Member, RoundTrip};
use places::Places;
use principal::Principal;
use rohrpost_mailbox::{Name, TimeRecord};
use std::collections::VecDeque;
use work::Registering;

/// What the server knows before the first client.
#[derive(Clone, Debug)]
pub struct ServerSettings {
    /// For people: what refusals call it.
    pub name: String,
    /// Digest of what must be equal everywhere.
    pub common: u64,
    /// Its own system, and the digest of what must be equal inside it. Of other systems the first client says it.
    pub system: Option<(u8, u64)>,
    /// What the file gives the nodes of that. A client that has shown a certificate has [other
    /// rights](Server::certify).
    pub own_nodes: OwnNodes,
    /// Names of its own system that move from node to node. Nobody registers them.
    pub moving: MovingHosts,
    /// Tells this incarnation from others; not 0.
    pub incarnation: u64,
    /// Clients that may take part at a time.
    pub clients_max: u16,
    /// Connections that have not said hello yet; of more the oldest gives way.
    pub handshakes_max: u16,
    /// Bytes of packages that wait for one client.
    pub quota_bytes: usize,
    /// Level of each priority; 0 goes first.
    pub levels: [u8; 256],
}

/// A connection, for people.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MemberSnapshot {
    /// The name of the member; before its hello, where it comes from.
    pub name: String,
    /// Where it comes from; empty if only its socket's owner knows.
    pub peer: String,
    /// First byte of the names that it may host; 0 before its hello.
    pub system: u8,
    /// Whether it takes part.
    pub is_member: bool,
    /// Ranges of names that it hosts.
    pub ranges: u64,
    /// The first of them, each from the first to the last name in it.
    pub hosts: Vec<(Name, Name)>,
    /// Time since its connection was made, ns.
    pub age_ns: u64,
    /// Time since something came from it, ns.
    pub heard_ns: u64,
    /// Packages lost in queues since it, or another connection of its principal, sent more than its share.
    pub lost: u64,
    /// Bytes of memory that it takes up, with what waits for it; what all share is not counted.
    pub bytes: u64,
}

/// Ranges of a client that are told by name.
const HOSTS_MAX: usize = 64;

/// Next step for the code around the core, from [`Server::poll`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ServerStep {
    /// Write what [`Server::ready`] has, then say how much with [`Server::took`].
    Write(ClientIndex),
    /// Close the connection; the index is free.
    Close(ClientIndex),
    /// All that was due has had its turn, and parts of replicas wait for the next one: take what came, then poll again.
    Look,
    /// Nothing before this time, unless something comes.
    Wait {
        /// Ns of the monotonic clock.
        until_ns: u64,
    },
}

/// A change that people are told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ServerEvent<'a> {
    /// A client takes part.
    Joined {
        /// Its name.
        name: &'a str,
    },
    /// It does not any more. None: it closed the connection, or that broke.
    Left {
        /// Its name.
        name: &'a str,
        /// Why.
        why: Option<SessionRefusalReason>,
    },
    /// One was not let in.
    Refused {
        /// Its name, as far as it is known.
        name: &'a str,
        /// Why.
        reason: SessionRefusalReason,
        /// What differs: its, and what it should be.
        digests: (u64, u64),
        /// The end that has it, or what was wrong.
        text: &'a str,
    },
    /// A client may not host what it says.
    Objected {
        /// Its name.
        name: &'a str,
        /// What it was told.
        verdict: &'a RegistrationVerdict<'a>,
    },
}

/// What the server needs from the code that runs it.
pub trait ServerHost: EndHost {
    /// Something happened.
    fn event(&mut self, event: ServerEvent<'_>);
}

/// The server.
#[derive(Debug)]
pub struct Server {
    settings: ServerSettings,
    members: Vec<Option<Box<Member>>>,
    places: Places,
    table: RoutingTable,
    counts: SessionCounts,
    /// Clients for which something is to be done.
    due: VecDeque<ClientIndex>,
    /// Counts the turns: in one, all that is due is done, and each client gets a part of a replica at most. So what
    /// comes is never read more often than all packages that wait have left, as far as lines take them.
    turn: u64,
    /// The next one begins.
    is_turn_over: bool,
    /// Parts wait for it.
    has_put_off: bool,
    registering: Registering,
    time: Option<TimeRecord>,
    look_ns: u64,
    looked_ns: u64,
}

impl Server {
    /// Without clients.
    pub fn new(settings: ServerSettings) -> Self {
        Self {
            settings,
            members: Vec::new(),
            places: Places::default(),
            table: RoutingTable::default(),
            counts: SessionCounts::default(),
            due: VecDeque::new(),
            turn: 0,
            is_turn_over: true,
            has_put_off: false,
            registering: Registering::default(),
            time: None,
            look_ns: 0,
            looked_ns: 0,
        }
    }

    /// What it counts.
    pub fn counts(&self) -> &SessionCounts {
        &self.counts
    }

    /// Hosts of names.
    pub fn table(&self) -> &RoutingTable {
        &self.table
    }

    /// Registrations that were never looked at, since the same client sent a later one before its turn.
    pub fn superseded(&self) -> u64 {
        self.registering.superseded
    }

    /// How often somebody had more of something than its share.
    pub fn crowded(&self) -> Crowded {
        self.places.crowded
    }

    /// System time, as answers tell it from now on.
    pub fn set_time(&mut self, time: Option<TimeRecord>) {
        self.time = time;
    }

    /// Name and state of each client.
    pub fn clients(&self) -> impl Iterator<Item = (ClientIndex, &str, MemberState)> {
        self.present().map(|(index, member)| (index, member.name.as_str(), member.state))
    }

    /// All connections.
    pub fn snapshots(&self, now_ns: u64) -> impl Iterator<Item = (ClientIndex, MemberSnapshot)> {
        self.present().map(move |(index, member)| {
            let is_here = |range: &Range| self.host_of(range.first) == Some(index);
            let moving: Vec<Range> = self.settings.moving.ranges().filter(is_here).collect();
            let hosts = moving.iter().chain(self.table.ranges_of(index)).take(HOSTS_MAX);
            let snapshot = MemberSnapshot {
                name: member.name.clone(),
                peer: String::new(),
                system: member.system,
                is_member: member.is_member(),
                ranges: (moving.len() + member.registrations.ranges) as u64,
                hosts: hosts.map(|range| (range.first, range.last)).collect(),
                age_ns: now_ns.saturating_sub(member.began_ns),
                heard_ns: now_ns.saturating_sub(member.heard_ns),
                lost: self.places.principals.uses(member.principal_id).map_or(0, |uses| uses.lost),
                bytes: member.bytes() as u64,
            };
            (index, snapshot)
        })
    }

    /// Bytes of memory that a client takes up; what all share is not counted.
    pub fn bytes_of(&self, client: ClientIndex) -> usize {
        self.member(client).map_or(0, |member| member.bytes())
    }

    /// The way to a client and back, ns, as its first word after its welcome showed it.
    pub fn round_trip_ns(&self, client: ClientIndex) -> Option<u64> {
        match self.member(client)?.round_trip {
            RoundTrip::Takes(ns) => Some(ns),
            RoundTrip::Unknown | RoundTrip::Since(_) => None,
        }
    }

    /// Packages that wait for clients.
    pub fn waiting(&self) -> usize {
        self.present().map(|(_, member)| member.outgoing.waiting()).sum()
    }

    /// Records the system and name in a client's certificate, before its hello. The hello must name the same; clients
    /// with the same certificate name are one principal. `rights`: which names of that system it may host.
    pub fn certify(&mut self, client: ClientIndex, system: u8, name: &str, rights: Rights) {
        if let Some(member) = self.member_mut(client) {
            name.clone_into(&mut member.name);
            member.certified = Some(system);
            member.principal = Principal::Certificate(name.to_owned());
            member.rights = rights;
        }
    }

    /// The certificate that a client shows before its hello does not admit it; it is told.
    pub fn names_nobody(&mut self, now_ns: u64, client: ClientIndex, host: &mut impl ServerHost) {
        self.refuse(now_ns, client, SessionRefusalReason::Certificate, (0, 0), "it names no node", host);
    }

    /// Bytes to be written to a client.
    pub fn ready(&self, client: ClientIndex) -> &[u8] {
        self.member(client).map_or(&[], |member| member.outgoing.ready())
    }

    /// Whether more waits than is ready.
    pub fn has_waiting(&self, client: ClientIndex) -> bool {
        self.member(client).is_some_and(|member| member.outgoing.has_waiting() || member.has_parts)
    }

    /// The stream has taken so many of them. If those were not all, nothing more is written until [`Server::writable`].
    pub fn took(&mut self, now_ns: u64, client: ClientIndex, bytes: usize) {
        let Some(member) = self.member_mut(client) else { return };
        member.outgoing.took(bytes);
        if bytes > 0 {
            member.moved_ns = now_ns;
        }
        member.is_blocked = !member.outgoing.ready().is_empty();
        if !member.is_blocked && member.has_more() {
            self.is_due(client);
        }
    }

    /// Makes this many bytes ready for a client at a time from now on.
    pub fn set_batch(&mut self, client: ClientIndex, bytes: usize) {
        if let Some(member) = self.member_mut(client) {
            member.outgoing.set_batch(bytes);
        }
    }

    /// The stream takes bytes again.
    pub fn writable(&mut self, client: ClientIndex) {
        if let Some(member) = self.member_mut(client) {
            member.is_blocked = false;
            self.is_due(client);
        }
    }

    /// The connection is closed, or broken. The index is free.
    pub fn closed(&mut self, now_ns: u64, client: ClientIndex, host: &mut impl ServerHost) {
        self.leave(now_ns, client, None, host);
        self.free(client);
    }

    /// All clients are told that the server ends.
    pub fn end(&mut self, now_ns: u64, host: &mut impl ServerHost) {
        let all: Vec<_> = self.present().map(|(index, _)| index).collect();
        for client in all {
            self.refuse(now_ns, client, SessionRefusalReason::Ending, (0, 0), "", host);
        }
    }

    /// What to do next.
    pub fn poll(&mut self, now_ns: u64, host: &mut impl ServerHost) -> ServerStep {
        if now_ns >= self.look_ns {
            self.look_ns = now_ns + LOOK_EVERY_NS;
            self.look(now_ns, host);
        }
        if std::mem::take(&mut self.is_turn_over) {
            self.turn += 1;
            self.look_for_parts(now_ns, host);
        }
        while let Some(client) = self.due.pop_front() {
            let Some(member) = self.member_mut(client) else { continue };
            member.is_due = false;
            let is_over = member.is_over(now_ns);
            if member.is_blocked && !is_over {
                continue;
            }
            self.refill(now_ns, client, host);
            self.add_part(now_ns, client, host);
            match self.member(client) {
                Some(member) if !member.outgoing.ready().is_empty() && !is_over => return ServerStep::Write(client),
                Some(member) if matches!(member.state, MemberState::Leaving { .. }) => {
                    self.free(client);
                    return ServerStep::Close(client);
                }
                _ => {}
            }
        }
        self.is_turn_over = true;
        if std::mem::take(&mut self.has_put_off) {
            return ServerStep::Look;
        }
        ServerStep::Wait { until_ns: self.look_ns }
    }

    /// The client that hosts a name: a name that moves is hosted by its present node alone.
    fn host_of(&self, name: Name) -> Option<ClientIndex> {
        match self.settings.moving.client_of(name) {
            Some(client) => self.table.client_of(client?),
            None => self.table.client_of(name),
        }
    }

    fn present(&self) -> impl Iterator<Item = (ClientIndex, &Member)> {
        let all = self.members.iter().enumerate();
        all.filter_map(|(index, member)| member.as_deref().map(|member| (ClientIndex(index as u16), member)))
    }

    fn member(&self, client: ClientIndex) -> Option<&Member> {
        self.members.get(usize::from(client.0))?.as_deref()
    }

    fn member_mut(&mut self, client: ClientIndex) -> Option<&mut Member> {
        self.members.get_mut(usize::from(client.0))?.as_deref_mut()
    }

    fn is_due(&mut self, client: ClientIndex) {
        if let Some(member) = self.member_mut(client).filter(|member| !member.is_due) {
            member.is_due = true;
            self.due.push_back(client);
        }
    }
}
