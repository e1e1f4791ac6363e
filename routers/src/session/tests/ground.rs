//! A server and clients that are joined to it without delay, and what each of them was told.

use super::plan::{address, client_settings, module, ranges, server_settings};
use super::world::S;
use super::world::rings::{Rings, SERVER};
use crate::replication::LineReplicas;
use crate::report::NotDelivered;
use crate::session::client::{self, Client, ClientPackage};
use crate::session::frame::{Carried, LENGTH_MAX, Range, Ranges, SessionFrameHead, SessionMessage};
use crate::session::server::{self, Server};
use crate::session::{Cause, ClientIndex, EndHost};
use rohrpost_mailbox::{Head, Name, Priority, Type};

/// Notes all that is told.
#[derive(Default)]
pub(super) struct Notes {
    pub(super) events: Vec<String>,
    pub(super) delivered: Vec<(Head, u8)>,
    pub(super) lost: Vec<Cause>,
    /// Lines of the rules by which commands are not allowed.
    pub(super) rules: Vec<Option<usize>>,
    /// Its replicas, if it has some.
    pub(super) rings: Option<Rings>,
}

impl EndHost for Notes {
    fn answer(&mut self, _: &[u8], why: Cause, _: Option<&str>, answer: &mut Vec<u8>) -> bool {
        self.lost.push(why);
        answer.extend(why.word().bytes());
        true
    }

    fn replicas(&mut self) -> Option<&mut LineReplicas> {
        self.rings.as_mut().map(|rings| &mut rings.line)
    }
}

impl client::ClientHost for Notes {
    fn deliver(&mut self, carried: &Carried<'_>) -> Result<(), NotDelivered> {
        self.delivered.push((carried.head, carried.hops));
        Ok(())
    }

    fn not_allowed(&mut self, line: Option<usize>) {
        self.rules.push(line);
    }

    fn event(&mut self, event: client::ClientEvent<'_>) {
        self.events.push(match event {
            client::ClientEvent::Refused(refusal) => refusal.to_string(),
            client::ClientEvent::Objected(verdict) => verdict.to_string(),
            other => format!("{other:?}"),
        });
    }
}

impl server::ServerHost for Notes {
    fn event(&mut self, event: server::ServerEvent<'_>) {
        self.events.push(format!("{event:?}"));
    }
}

/// A server, and clients that are joined to it without delay.
pub(super) struct Ground {
    pub(super) now_ns: u64,
    pub(super) server: Server,
    pub(super) said: Notes,
    pub(super) ends: Vec<(Client, Option<ClientIndex>, Notes)>,
}

impl Ground {
    pub(super) fn new(clients: impl IntoIterator<Item = (client::ClientSettings, Vec<Range>)>) -> Self {
        Self::with_room((16, 4), clients)
    }

    /// With places for so many clients, and for so many that have not said hello.
    pub(super) fn with_room(
        (clients_max, handshakes_max): (u16, u16),
        clients: impl IntoIterator<Item = (client::ClientSettings, Vec<Range>)>,
    ) -> Self {
        Self::with(server::ServerSettings { clients_max, handshakes_max, ..server_settings(5) }, clients)
    }

    pub(super) fn with(
        settings: server::ServerSettings,
        clients: impl IntoIterator<Item = (client::ClientSettings, Vec<Range>)>,
    ) -> Self {
        let mut ground = Self::before(settings, clients);
        ground.settle();
        ground
    }

    /// Before anything is said.
    fn before(
        settings: server::ServerSettings,
        clients: impl IntoIterator<Item = (client::ClientSettings, Vec<Range>)>,
    ) -> Self {
        let now_ns = 100 * S;
        let end = |(settings, ranges)| (Client::new(settings, ranges, now_ns), None, Notes::default());
        let ends = clients.into_iter().map(end).collect();
        Self { now_ns, server: Server::new(settings), said: Notes::default(), ends }
    }

    pub(super) fn clients(count: usize) -> Self {
        Self::new(of_clients(count))
    }

    /// With streams of the server's node and of the first client's, which all have.
    pub(super) fn replicated(count: usize) -> Self {
        let mut ground = Self::before(server_settings(5), of_clients(count));
        ground.said.rings = Some(Rings::new(SERVER, count));
        ground.settle();
        ground
    }

    /// Until nobody has anything to do.
    pub(super) fn settle(&mut self) {
        for _ in 0..20 {
            for (index, (client, place, notes)) in self.ends.iter_mut().enumerate() {
                loop {
                    match client.poll(self.now_ns, notes) {
                        client::ClientStep::Connect => {
                            *place =
                                self.server.accept(self.now_ns, address(index, client.connections()), &mut self.said);
                            client.connected(self.now_ns);
                        }
                        client::ClientStep::Write => {
                            let bytes = client.ready().to_vec();
                            client.took(self.now_ns, bytes.len());
                            if let Some(place) = *place {
                                self.server.received(self.now_ns, place, &bytes, &mut self.said);
                            }
                        }
                        client::ClientStep::Close => *place = None,
                        client::ClientStep::Wait { .. } => break,
                    }
                }
            }
            self.serve();
        }
    }

    fn serve(&mut self) {
        loop {
            match self.server.poll(self.now_ns, &mut self.said) {
                server::ServerStep::Write(index) => {
                    let bytes = self.server.ready(index).to_vec();
                    self.server.took(self.now_ns, index, bytes.len());
                    let end = self.ends.iter_mut().find(|(_, place, _)| *place == Some(index));
                    if let Some((client, _, notes)) = end {
                        client.received(self.now_ns, &bytes, notes);
                    }
                }
                server::ServerStep::Close(index) => {
                    let end = self.ends.iter_mut().find(|(_, place, _)| *place == Some(index));
                    if let Some((client, place, notes)) = end {
                        *place = None;
                        client.closed(self.now_ns, notes);
                    }
                }
                server::ServerStep::Look => {}
                server::ServerStep::Wait { .. } => return,
            }
        }
    }

    /// What a client says comes to the server, besides what it has to say.
    pub(super) fn receives(&mut self, from: usize, message: &SessionMessage<'_>) {
        let place = self.ends[from].1.unwrap();
        self.server.received(self.now_ns, place, &message.to_bytes(), &mut self.said);
    }

    /// A registration of a client comes to the server.
    pub(super) fn register(&mut self, client: usize, number: u32, ranges: &[Range]) {
        self.receives(client, &SessionMessage::Register(Ranges::new(number, ranges, &mut Vec::new())));
    }

    /// A client is to send a package that has just been published.
    pub(super) fn sends(&mut self, from: usize, head: Head, hops: u8) {
        let body = vec![0; head.len.into()];
        let (client, _, notes) = &mut self.ends[from];
        client.send(self.now_ns, &ClientPackage { head, body: &body, published_ns: self.now_ns, hops }, notes);
    }

    pub(super) fn send(&mut self, from: usize, to: Name, hops: u8) {
        let (from_name, kind, priority) = (module(from).with_local(1), Type::command(16), Priority(60));
        self.sends(from, Head { to, from: from_name, len: 8, kind, priority, ..Head::default() }, hops);
        self.settle();
    }

    /// Time passes, and all that is due then happens.
    pub(super) fn pass(&mut self, for_ns: u64) {
        self.now_ns += for_ns;
        self.settle();
    }

    pub(super) fn delivered(&self, client: usize) -> Vec<Name> {
        self.ends[client].2.delivered.iter().filter(|(head, _)| head.kind.0 > 0).map(|(head, _)| head.to).collect()
    }
}

fn of_clients(count: usize) -> impl Iterator<Item = (client::ClientSettings, Vec<Range>)> {
    (0..count).map(|client| (client_settings(client, 100 + client as u64), ranges(client)))
}

/// A package as a client sends it that does not know when it was published.
pub(super) const fn package(head: Head, body: &[u8]) -> SessionMessage<'_> {
    SessionMessage::Package(Carried { hops: 0, published_ns: 0, head, body })
}

/// The whole frames that bytes begin with.
pub(super) fn frames(mut bytes: &[u8]) -> impl Iterator<Item = (SessionFrameHead, SessionMessage<'_>)> {
    std::iter::from_fn(move || {
        let (head, rest) = bytes.split_first_chunk()?;
        let head = SessionFrameHead::parse(head, LENGTH_MAX).unwrap();
        let (frame, behind) = rest.split_at_checked(head.length)?;
        bytes = behind;
        Some((head, SessionMessage::parse(head, frame).unwrap()))
    })
}
