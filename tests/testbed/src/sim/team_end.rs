//! The router of one robot in a simulated team: its core, and a node that has one mailbox, for messages of teammates.

use super::chance::Chance;
use super::seals;
use rohrpost_mailbox::{ALL_SYSTEMS, Head, Name, Options, Priority, Type};
use rohrpost_routers::admission::Admission;
use rohrpost_routers::report::NotDelivered;
use rohrpost_routers::session::{Cause, EndHost};
use rohrpost_routers::team::{TeamHost, TeamRouter, TeamSettings, Teammate};
use std::net::{Ipv4Addr, SocketAddr};

/// Class of modules of a team; see `docs/src/wire.md`.
const CLASS: u8 = 120;
/// Mailbox of their messages.
const MESSAGES: u8 = 3;
/// Equal for all.
const COMMON_DIGEST: u64 = 7;

/// Takes what comes.
struct OneMailbox {
    mailbox: Name,
    came: Vec<Vec<u8>>,
}

impl EndHost for OneMailbox {
    fn answer(&mut self, _: &[u8], _: Cause, _: Option<&str>, _: &mut Vec<u8>) -> bool {
        false
    }
}

impl TeamHost for OneMailbox {
    fn deliver(&mut self, _: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        self.came.push(body.to_vec());
        Ok(())
    }

    fn hosts(&self, name: Name) -> bool {
        name == self.mailbox
    }
}

/// One run of a robot's router.
pub struct TeamEnd {
    router: TeamRouter,
    host: OneMailbox,
}

impl TeamEnd {
    /// The router of a system that starts now, ns of its clock. `is_sealed`: with the key that all have.
    pub fn new(system: u8, is_sealed: bool, chance: &mut Chance, now_ns: u64) -> Self {
        let mut seed = [0; 32];
        chance.fill(&mut seed);
        let settings = TeamSettings {
            system,
            node: 0,
            common: COMMON_DIGEST,
            incarnation: chance.bits() | 1,
            seed,
            keys: is_sealed.then(seals::keys),
            reached: None,
            admission: Admission::default(),
        };
        let host = OneMailbox { mailbox: Name::new(system, CLASS, 0, MESSAGES), came: Vec::new() };
        Self { router: TeamRouter::new(settings, false, now_ns), host }
    }

    /// The datagram of a message to all systems.
    ///
    /// # Panics
    /// If it is larger than a message may be.
    pub fn send(&mut self, message: &[u8]) -> Vec<u8> {
        let from = self.host.mailbox.with_local(0);
        let head = Head {
            to: Name::new(ALL_SYSTEMS, CLASS, 0, MESSAGES),
            from,
            len: message.len() as u16,
            kind: Type::data(2),
            id: 0,
            priority: Priority(CLASS),
            options: Options::default(),
        };
        let mut datagram = Vec::new();
        let sent = self.router.send(&head, message, &mut datagram);
        self.router.left(&head, sent);
        assert_eq!(sent, Ok(()), "a message fits in a datagram");
        datagram
    }

    /// The router's own beat, if one is due.
    ///
    /// # Errors
    /// When the next one is, ns of its clock.
    pub fn poll(&mut self, now_ns: u64) -> Result<Vec<u8>, u64> {
        let mut datagram = Vec::new();
        self.router.poll(now_ns, &mut datagram).map(|()| datagram)
    }

    /// A datagram comes; the messages that it brings.
    pub fn handle(&mut self, now_ns: u64, datagram: &[u8]) -> Vec<Vec<u8>> {
        // Where it comes from matters to nobody but people.
        let source = SocketAddr::from((Ipv4Addr::LOCALHOST, 21_121));
        self.router.handle(now_ns, source, &mut datagram.to_vec(), &mut self.host);
        std::mem::take(&mut self.host.came)
    }

    /// Routers that it hears or has heard.
    pub fn teammates(&self) -> Vec<Teammate> {
        self.router.teammates()
    }
}
