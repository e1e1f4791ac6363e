//! The ways of packages through a router of the team: to the socket and the TCP router, and to mailboxes of this node.

use super::parts::TeamLinks;
use super::socket::{TeamSocket, TeamSocketReach};
use crate::admission::capped;
use crate::report::NotDelivered;
use crate::session::frame::Range;
use crate::session::{Cause, EndHost, answer_to, in_system};
use crate::shell::sender_cache::SenderCache;
use crate::shell::{Faults, transit};
use crate::tcp::fault_writer::FaultWriter;
use crate::team::{TEAM_BODY_BYTES_MAX, TEAM_DATAGRAM_BYTES_MAX, TeamHost, TeamRouter};
use nix::errno::Errno;
use rohrpost_mailbox::{ALL_SYSTEMS, Head, Name, Participant, SendError, monotonic_ns};
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;

/// See the top.
pub(super) struct Ways {
    system: u8,
    router: TeamRouter,
    host: Host,
    reach: TeamSocketReach,
    socket: Option<TeamSocket>,
    /// Why there is none, as it was last told; empty if there is one.
    why: String,
    /// TeamNames of other nodes of this system, and the way to them and to the client of the TCP router.
    others: Box<[Range]>,
    everywhere: SenderCache,
    /// Mailbox of the client of the TCP router, if there is one.
    tcp: Option<Name>,
    /// The datagram that leaves.
    datagram: Vec<u8>,
    /// Where it goes yet, if the socket had no room.
    held: Vec<SocketAddr>,
    room: Box<[u8]>,
}

/// Delivers and answers.
struct Host {
    hosts: Box<[Range]>,
    here: SenderCache,
    faults: FaultWriter,
}

impl EndHost for Host {
    fn answer(&mut self, call: &[u8], why: Cause, holder: Option<&str>, answer: &mut Vec<u8>) -> bool {
        self.faults.answer(call, why, holder, answer)
    }
}

impl TeamHost for Host {
    fn deliver(&mut self, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        self.here.send(head, body).map_err(|error| {
            if let SendError::TooLarge { max, .. } = error {
                self.faults.takes_bytes = Some(max);
            }
            error.into()
        })
    }

    fn hosts(&self, name: Name) -> bool {
        self.hosts.iter().any(|range| range.has(name))
    }

    fn not_allowed(&mut self, line: Option<usize>) {
        self.faults.rule = line;
    }
}

/// What a router knows of names.
pub(super) struct TeamNames {
    pub(super) hosts: Vec<(Name, Name)>,
    pub(super) others: Vec<(Name, Name)>,
    pub(super) tcp: Option<Name>,
}

impl Ways {
    pub(super) fn new(
        participant: &Arc<Participant>,
        router: TeamRouter,
        reach: TeamSocketReach,
        names: TeamNames,
        faults: Arc<dyn Faults>,
    ) -> Self {
        let ranges = |names: &[(Name, Name)]| names.iter().map(|&(first, last)| Range { first, last }).collect();
        let host = Host {
            hosts: ranges(&names.hosts),
            here: SenderCache::here(participant, &names.hosts),
            faults: FaultWriter::new(faults, "of another system".into()),
        };
        let held = Vec::with_capacity(1 + reach.peers.len());
        Self {
            system: router.system(),
            router,
            host,
            reach,
            socket: None,
            why: String::new(),
            others: ranges(&names.others),
            everywhere: SenderCache::everywhere(participant),
            tcp: names.tcp.map(transit::name),
            datagram: Vec::with_capacity(TEAM_DATAGRAM_BYTES_MAX),
            held,
            // One byte more: what is longer is no datagram of a team.
            room: vec![0; TEAM_DATAGRAM_BYTES_MAX + 1].into(),
        }
    }

    pub(super) fn links(&self) -> TeamLinks {
        TeamLinks { why: self.why.clone(), teammates: self.router.teammates() }
    }

    pub(super) fn socket(&self) -> Option<&TeamSocket> {
        self.socket.as_ref()
    }

    /// Opens the socket.
    pub(super) fn open(&mut self) {
        match TeamSocket::open(&self.reach) {
            Ok(socket) => {
                if !std::mem::take(&mut self.why).is_empty() {
                    tracing::info!("the network of the team is there: {}", self.reach.own);
                }
                self.socket = Some(socket);
            }
            Err(error) => self.failed(&error),
        }
    }

    /// The network is not there: it is tried again, and what is to leave meanwhile is lost.
    pub(super) fn failed(&mut self, error: &io::Error) {
        (self.socket, self.held) = (None, Vec::with_capacity(self.held.capacity()));
        let why = format!(
            "the network of the team is not reached from {}: {error}; is this an address of this computer, and its \
             interface up (`ip addr`)?",
            self.reach.own
        );
        if self.why != why {
            tracing::warn!("{why}");
            self.why = why;
        }
    }

    /// Whether a datagram waits until the socket has room.
    pub(super) fn awaits_room(&self) -> bool {
        !self.held.is_empty()
    }

    /// The socket has room again.
    pub(super) fn has_room(&mut self) {
        // An error is told where it is found.
        let _ = self.transmit();
    }

    /// Takes a package out of the mailbox: of this node for others, or of another system, by the TCP router, for this
    /// node.
    pub(super) fn carry(&mut self, now_ns: u64, head: &Head, body: &[u8]) {
        if head.from.system() != self.system {
            self.router.by_tcp(now_ns, head, body, &mut self.host);
            return self.reply();
        }
        let head = capped(head);
        // With a TCP router its client brings it to this system.
        if head.to.system() == ALL_SYSTEMS && self.tcp.is_none() {
            self.reach_itself(&head, body);
        }
        let by_team = self.leave(&head, body);
        let by_tcp = self.tcp.map(|via| self.everywhere.send_by(via, &head, body));
        let outcome = if matches!(by_tcp, Some(Ok(()))) { Ok(()) } else { by_team };
        self.router.left(&head, outcome);
        if let Err(cause) = outcome {
            self.host.faults.takes_bytes = Some(TEAM_BODY_BYTES_MAX);
            if let Some((head, body)) = answer_to(&head, body, cause, None, &mut self.host) {
                // The caller may be gone.
                let _ = self.host.here.send(&head, &body);
            }
        }
    }

    fn leave(&mut self, head: &Head, body: &[u8]) -> Result<(), Cause> {
        // A reply of this router, while the socket has no room.
        if self.awaits_room() {
            return Err(Cause::Full);
        }
        self.router.send(head, body, &mut self.datagram)?;
        if self.socket.is_none() {
            return Err(Cause::Offline);
        }
        self.held.extend(self.reach.addresses(head.to.system()));
        self.transmit()
    }

    /// Sends the datagram to where it has not gone yet. One peer that is not reached keeps the others from nothing.
    fn transmit(&mut self) -> Result<(), Cause> {
        let mut outcome = Ok(());
        while let Some(to) = self.held.last() {
            let Some(socket) = &self.socket else { return Err(Cause::Offline) };
            match socket.send(&self.datagram, *to).map_err(Errno::try_from) {
                Ok(()) => self.router.counts().sent.add(1),
                Err(Ok(Errno::EAGAIN)) => return Ok(()),
                Err(Ok(Errno::EMSGSIZE)) => outcome = Err(Cause::TooLarge),
                Err(Ok(Errno::ENOBUFS)) => outcome = Err(Cause::Full),
                Err(error) if self.reach.group.is_some() => {
                    self.failed(&error.map_or_else(|error| error, io::Error::from));
                    return Err(Cause::Offline);
                }
                Err(_) => outcome = Err(Cause::Offline),
            }
            self.held.pop();
        }
        outcome
    }

    /// A package for all systems is for this one, too.
    fn reach_itself(&mut self, head: &Head, body: &[u8]) {
        let head = Head { to: in_system(head.to, self.system), ..*head };
        let is_others = self.others.iter().any(|range| range.has(head.to));
        let ways = if is_others { &mut self.everywhere } else { &mut self.host.here };
        // Nobody here may have such a mailbox.
        let _ = ways.send(&head, body);
    }

    /// Takes datagrams that have come; whether there may be more.
    pub(super) fn receive(&mut self, most: usize) -> bool {
        for _ in 0..most {
            let Some(socket) = &self.socket else { return false };
            match socket.receive(&mut self.room) {
                Ok((bytes, source)) => {
                    self.router.handle(monotonic_ns(), source, &mut self.room[..bytes], &mut self.host);
                    self.reply();
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return false,
                Err(error) => {
                    self.failed(&error);
                    return false;
                }
            }
        }
        true
    }

    /// Sends a beat if one is due; when the next one is.
    pub(super) fn beat(&mut self, now_ns: u64) -> u64 {
        if self.awaits_room() {
            return u64::MAX;
        }
        if let Err(next_ns) = self.router.poll(now_ns, &mut self.datagram) {
            return next_ns;
        }
        if self.socket.is_some() {
            self.held.extend(self.reach.addresses(ALL_SYSTEMS));
            let _ = self.transmit();
        }
        now_ns
    }

    fn reply(&mut self) {
        while let Some((head, body)) = self.router.next_reply() {
            self.carry(monotonic_ns(), &head, &body);
        }
    }
}
