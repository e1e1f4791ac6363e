//! What a client does for its session: it delivers, answers, and says what happens.

use crate::replication::LineReplicas;
use crate::report::NotDelivered;
use crate::session::client::{ClientEvent, ClientHost};
use crate::session::frame::Carried;
use crate::session::{Cause, EndHost};
use crate::shell::sender_cache::SenderCache;
use crate::shell::transit;
use crate::tcp::fault_writer::FaultWriter;
use crate::tcp::snapshots::Outage;
use rohrpost_mailbox::{Name, Participant, SendError, monotonic_ns};
use std::net::SocketAddr;
use std::sync::Arc;

/// Delivers, answers, and says what happens.
pub(super) struct EventReporter {
    server: SocketAddr,
    pub(super) sender_cache: SenderCache,
    fault_writer: FaultWriter,
    /// Why it takes no part, as it was last told; empty if it does.
    pub(super) why: String,
    /// The server has said that, or what it said is why.
    by_server: bool,
    pub(super) outage: Outage,
    pub(super) line: Option<LineReplicas>,
    pub(super) team: Option<TeamWay>,
}

/// The way to the router of the team, which takes what comes from other systems, so that it is delivered once.
pub(super) struct TeamWay {
    mailbox: Name,
    /// That of both.
    system: u8,
    /// Of that mailbox alone: other systems must not reach it by its name.
    sender_cache: SenderCache,
}

impl TeamWay {
    pub(super) fn new(participant: &Arc<Participant>, router: Name, system: u8) -> Self {
        let mailbox = transit::name(router);
        Self { mailbox, system, sender_cache: SenderCache::here(participant, &[(mailbox, mailbox)]) }
    }
}

impl EventReporter {
    pub(super) fn new(server: SocketAddr, sender_cache: SenderCache, fault_writer: FaultWriter) -> Self {
        let (why, outage) = Default::default();
        Self { server, sender_cache, fault_writer, why, by_server: false, outage, line: None, team: None }
    }

    /// Says once why the server is not there. `was_made`: the connection was.
    pub(super) fn unreached(&mut self, why: &str, was_made: bool) {
        let server = self.server;
        let why = if was_made {
            format!("takes no part at the TCP router at {server}: {why}")
        } else {
            format!("the TCP router at {server} is not reached: {why}; does it run, and is it reached from here?")
        };
        // What it said itself is better than that its connection then ended.
        if !(self.by_server && was_made) && self.why != why {
            self.says(why, false);
        }
    }

    fn says(&mut self, why: String, by_server: bool) {
        tracing::warn!("{why}");
        (self.why, self.by_server) = (why, by_server);
    }
}

impl EndHost for EventReporter {
    fn answer(&mut self, call: &[u8], why: Cause, holder: Option<&str>, answer: &mut Vec<u8>) -> bool {
        self.fault_writer.answer(call, why, holder, answer)
    }

    fn replicas(&mut self) -> Option<&mut LineReplicas> {
        self.line.as_mut()
    }
}

impl ClientHost for EventReporter {
    fn deliver(&mut self, carried: &Carried<'_>) -> Result<(), NotDelivered> {
        let system = carried.head.from.system();
        if let Some(team) = self.team.as_mut().filter(|team| team.system != system) {
            let handed = team.sender_cache.send_by(team.mailbox, &carried.head, carried.body);
            let handed = handed.map_err(NotDelivered::from);
            // Before that router's first start nothing comes by its way, either.
            if handed != Err(NotDelivered::NoMailbox) {
                return handed;
            }
        }
        self.sender_cache.send(&carried.head, carried.body).map_err(|error| {
            if let SendError::TooLarge { max, .. } = error {
                self.fault_writer.takes_bytes = Some(max);
            }
            error.into()
        })
    }

    fn not_allowed(&mut self, line: Option<usize>) {
        self.fault_writer.rule = line;
    }

    fn event(&mut self, event: ClientEvent<'_>) {
        let server = self.server;
        match event {
            ClientEvent::Up => {
                self.why.clear();
                self.outage.ends(monotonic_ns());
                tracing::info!("takes part at the TCP router at {server}");
            }
            ClientEvent::Down => {
                self.outage.begins(monotonic_ns());
                self.says(format!("takes part at the TCP router at {server} no more; it tries again"), false)
            }
            ClientEvent::Refused(refusal) => {
                self.says(format!("may not take part at the TCP router at {server}: {refusal}"), true);
            }
            ClientEvent::Objected(verdict) => {
                self.says(format!("may not host its names at the TCP router at {server}: {verdict}"), true);
            }
            ClientEvent::Damaged(bad) => {
                self.says(format!("cannot read what came from the TCP router at {server}: {bad}"), true);
            }
        }
    }
}
