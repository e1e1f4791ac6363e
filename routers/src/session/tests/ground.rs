//! A server and clients that are joined to it without delay, and what each of them was told.

use super::plan::{address, client_settings, module, ranges, server_settings};
use super::world::S;
use super::world::rings::Rings;
use crate::replication::LineReplicas;
use crate::report::NotDelivered;
use crate::session::client::{self, Client, ClientPackage};
use crate::session::frame::{Carried, Range};
use crate::session::server::{self, Server};
use crate::session::{Cause, ClientIndex, ErrorReplies, ReplicaEnd};
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

impl ErrorReplies for Notes {
    fn answer(&mut self, _: &[u8], why: Cause, _: Option<&str>, answer: &mut Vec<u8>) -> bool {
        self.lost.push(why);
        answer.extend(why.word().bytes());
        true
    }
}

impl ReplicaEnd for Notes {
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

    pub(super) fn with_room(
        (clients_max, greetings_max): (u16, u16),
        clients: impl IntoIterator<Item = (client::ClientSettings, Vec<Range>)>,
    ) -> Self {
        Self::with(server::ServerSettings { clients_max, handshakes_max: greetings_max, ..server_settings(5) }, clients)
    }

    pub(super) fn with(
        settings: server::ServerSettings,
        clients: impl IntoIterator<Item = (client::ClientSettings, Vec<Range>)>,
    ) -> Self {
        Self::with_said(settings, clients, Notes::default())
    }

    /// A server that tells these.
    pub(super) fn with_said(
        settings: server::ServerSettings,
        clients: impl IntoIterator<Item = (client::ClientSettings, Vec<Range>)>,
        said: Notes,
    ) -> Self {
        let now_ns = 100 * S;
        let server = Server::new(settings);
        let end = |(settings, ranges)| (Client::new(settings, ranges, now_ns), None, Notes::default());
        let mut ground = Self { now_ns, server, said, ends: clients.into_iter().map(end).collect() };
        ground.settle();
        ground
    }

    pub(super) fn clients(count: usize) -> Self {
        Self::new((0..count).map(|client| (client_settings(client, 100 + client as u64), ranges(client))))
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

    pub(super) fn send(&mut self, from: usize, to: Name, hops: u8) {
        let head = Head {
            to,
            from: module(from).with_local(1),
            len: 8,
            kind: Type::command(16),
            priority: Priority(60),
            ..Head::default()
        };
        let package = ClientPackage { head, body: &[0; 8], published_ns: self.now_ns, hops };
        let (client, _, notes) = &mut self.ends[from];
        client.send(self.now_ns, &package, notes);
        self.settle();
    }

    pub(super) fn delivered(&self, client: usize) -> Vec<Name> {
        self.ends[client].2.delivered.iter().filter(|(head, _)| head.kind.0 > 0).map(|(head, _)| head.to).collect()
    }
}
