//! Routers of a team that exchange datagrams by hand.

mod believed;
mod delivered;
mod hostile;

use super::*;
use crate::frame as lan;
use crate::security::{InstallationKey, KeyId};
use crate::session::Cause;
use rohrpost_mailbox::{ALL_SYSTEMS, Priority, Type, local};
use std::num::NonZeroU8;

const MS: u64 = 1_000_000;
const SECOND: u64 = 1000 * MS;

/// What a node did with what came.
#[derive(Default)]
struct Node {
    delivered: Vec<(Head, Vec<u8>)>,
    /// Mailboxes refuse everything for this reason.
    refuses: Option<NotDelivered>,
    /// Names that it does not host.
    lacks: Vec<Name>,
}

impl EndHost for Node {
    fn answer(&mut self, _: &[u8], why: Cause, _: Option<&str>, answer: &mut Vec<u8>) -> bool {
        answer.extend(why.word().as_bytes());
        true
    }
}

impl TeamHost for Node {
    fn deliver(&mut self, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        self.refuses.map_or(Ok(()), Err)?;
        self.delivered.push((*head, body.to_vec()));
        Ok(())
    }

    fn hosts(&self, name: Name) -> bool {
        !self.lacks.contains(&name)
    }
}

/// A router with its node.
struct End {
    router: TeamRouter,
    node: Node,
}

fn key_ring(key: u8) -> KeyRing {
    KeyRing::new(InstallationKey::new(KeyId(NonZeroU8::MIN), &[key; 32]), None)
}

fn settings(system: u8, incarnation: u64, key: Option<u8>) -> TeamSettings {
    TeamSettings {
        system,
        node: 0,
        common: 7,
        incarnation,
        seed: [system ^ incarnation as u8; 32],
        keys: key.map(key_ring),
        reached: None,
        admission: Admission::default(),
    }
}

impl End {
    fn new(system: u8, incarnation: u64, key: Option<u8>) -> Self {
        Self::of(settings(system, incarnation, key))
    }

    fn of(settings: TeamSettings) -> Self {
        Self { router: TeamRouter::new(settings, true, 0), node: Node::default() }
    }

    /// The beat, if one is due.
    fn beat(&mut self, now_ns: u64) -> Option<Vec<u8>> {
        let mut datagram = Vec::new();
        self.router.poll(now_ns, &mut datagram).ok().map(|()| datagram)
    }

    /// The datagram of data to a system.
    fn data(&mut self, to: u8, body: &[u8]) -> Vec<u8> {
        let mut datagram = Vec::new();
        self.router.send(&head(self.router.system(), to, Type::data(1)), body, &mut datagram).unwrap();
        datagram
    }

    fn take(&mut self, now_ns: u64, datagram: &[u8]) {
        self.router.handle(now_ns, source(), &mut datagram.to_vec(), &mut self.node);
    }

    fn bodies(&self) -> Vec<&[u8]> {
        self.node.delivered.iter().map(|(_, body)| body.as_slice()).collect()
    }

    fn refused(&self, why: TeamRefusal) -> u64 {
        self.router.counts().refused(why)
    }

    fn mate(&self) -> Teammate {
        self.router.teammates()[0]
    }
}

fn source() -> SocketAddr {
    "10.0.0.2:21121".parse().unwrap()
}

fn head(from: u8, to: u8, kind: Type) -> Head {
    let (from, to) = (Name::new(from, 96, 0, local::REPLIES), Name::new(to, 96, 0, local::DATA));
    Head { to, from, kind, id: 3, priority: Priority(96), ..Head::default() }
}

/// All exchange beats until nothing new is said; returns when that is.
fn meet(now_ns: u64, ends: &mut [&mut End]) -> u64 {
    for step in 0..40 {
        let now_ns = now_ns + step * 100 * MS;
        for at in 0..ends.len() {
            let Some(beat) = ends[at].beat(now_ns) else { continue };
            ends.iter_mut().enumerate().filter(|(other, _)| *other != at).for_each(|(_, end)| end.take(now_ns, &beat));
        }
    }
    now_ns + 4 * SECOND
}
