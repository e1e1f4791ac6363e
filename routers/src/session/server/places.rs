//! The connected clients: places for connections, shared out by principal, and what must be found quickly of those that
//! have one.
//!
//! ```text
//!  accept ─▶ handshake: of too many the oldest of the address that has most gives way
//!  hello  ─▶ member:    of too many the newest of the principal that has most, if the new one's has fewer by two
//! ```

use super::connections::ConnectionsByOwner;
use super::member::{Member, MemberState};
use super::principal::{Principal, PrincipalId, Principals};
use super::work::WORK_SHARE;
use super::{Server, ServerHost};
use crate::session::ClientIndex;
use crate::session::frame::{SessionHello, SessionRefusalReason};
use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;

/// Numbers of parties that are no system.
const STRANGERS: u32 = 256;

/// How often somebody had more of something than its share.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Crowded {
    /// Connections before their hello that gave way, since their address had most.
    pub handshakes: u64,
    /// Clients that gave way to others with fewer, or were not let in while they had most.
    pub clients: u64,
    /// Registrations with more ranges than a principal may have.
    pub ranges: u64,
}

/// All that is to be found of connections without going through them.
#[derive(Debug, Default)]
pub(super) struct Places {
    /// Places that were left.
    free: BTreeSet<u16>,
    /// Clients without a hello yet, by address.
    handshakes: ConnectionsByOwner<Principal>,
    /// Admitted clients.
    pub(super) principals: Principals,
    /// Admitted clients, by principal and incarnation.
    incarnations: BTreeMap<(PrincipalId, u64), ClientIndex>,
    /// Admitted clients, by system.
    systems: BTreeSet<(u8, ClientIndex)>,
    pub(super) crowded: Crowded,
}

impl Places {
    /// A client of a system that takes part.
    pub(super) fn of_system(&self, system: u8) -> Option<ClientIndex> {
        let least = (system, ClientIndex(0));
        self.systems.range(least..).next().filter(|(of, _)| *of == system).map(|(_, client)| *client)
    }

    /// The client of a principal with this incarnation. Another principal may say that it is of the same: it names one
    /// of its own thereby.
    pub(super) fn of_incarnation(&self, owner: &Principal, incarnation: u64) -> Option<ClientIndex> {
        let id = self.principals.id_of(owner)?;
        self.incarnations.get(&(id, incarnation)).copied()
    }

    /// It does not take part any more.
    pub(super) fn leaves(&mut self, now_ns: u64, client: ClientIndex, member: &Member) {
        self.principals.leaves(now_ns, member.principal_id, member.began_ns, client);
        self.systems.remove(&(member.system, client));
        let incarnation = (member.principal_id, member.incarnation);
        if self.incarnations.get(&incarnation) == Some(&client) {
            self.incarnations.remove(&incarnation);
        }
    }

    /// It does not stand before its hello any more.
    pub(super) fn handshake_ends(&mut self, client: ClientIndex, member: &Member) {
        self.handshakes.remove(&member.address, member.began_ns, client);
    }
}

impl Server {
    /// A connection was made, from this address. None: so many are there that it must be closed.
    pub fn accept(&mut self, now_ns: u64, from: SocketAddr, host: &mut impl ServerHost) -> Option<ClientIndex> {
        let address = Principal::of(from.ip());
        if self.places.handshakes.len() >= self.settings.handshakes_max.into() {
            let oldest = self.oldest_handshake(&address)?;
            self.places.crowded.handshakes += 1;
            self.refuse(now_ns, oldest, SessionRefusalReason::Silent, (0, 0), "others wait to be let in", host);
        }
        let index = match self.places.free.pop_first() {
            Some(free) => free,
            None if self.members.len() < self.places_max() => {
                self.members.push(None);
                self.members.len() as u16 - 1
            }
            None => return None,
        };
        let client = ClientIndex(index);
        self.places.handshakes.add(&address, now_ns, client);
        let member = Member::new(now_ns, from.to_string(), address, self.settings.quota_bytes);
        self.members[usize::from(index)] = Some(Box::new(member));
        Some(client)
    }

    /// The connection before its hello that gives way to a new one from this address.
    fn oldest_handshake(&self, address: &Principal) -> Option<ClientIndex> {
        let handshakes = &self.places.handshakes;
        let (largest, most) = handshakes.largest()?;
        let owner = if handshakes.count_of(address) == most { address } else { largest };
        handshakes.ends_of(owner).map(|(oldest, _)| oldest)
    }

    /// A client said hello, and nothing speaks against it: whether there is a place for it.
    pub(super) fn take_in(
        &mut self,
        now_ns: u64,
        client: ClientIndex,
        hello: &SessionHello<'_>,
        host: &mut impl ServerHost,
    ) -> bool {
        let Some(owner) = self.member(client).map(|member| member.principal.clone()) else { return false };
        if self.places.principals.members.len() >= self.settings.clients_max.into() {
            let Some(newest) = self.gives_way_to(&owner) else { return false };
            self.places.crowded.clients += 1;
            let text = "the principal with most connections gives way to one with fewer";
            self.refuse(now_ns, newest, SessionRefusalReason::Full, (0, 0), text, host);
        }
        let Some(Some(member)) = self.members.get_mut(usize::from(client.0)) else { return false };
        self.places.handshake_ends(client, member);
        member.principal_id = self.places.principals.joins(&owner, member.began_ns, client, WORK_SHARE);
        member.joins(now_ns, hello);
        let is_own = self.settings.system.is_some_and(|(system, _)| system == hello.system);
        if member.certified.is_none() && is_own {
            member.rights = self.settings.own_nodes.rights_of(hello.name);
            member.is_at_home = self.settings.own_nodes.is_at_home(hello.name, &member.address);
        }
        let is_node = member.certified.is_some() || is_own && self.settings.own_nodes.has(hello.name);
        member.party = if is_node { hello.system.into() } else { STRANGERS + member.principal_id };
        self.places.incarnations.insert((member.principal_id, member.incarnation), client);
        self.places.systems.insert((member.system, client));
        true
    }

    /// The newest client of the principal with most clients, if that principal has at least two more than `owner`.
    fn gives_way_to(&mut self, owner: &Principal) -> Option<ClientIndex> {
        let members = &self.places.principals.members;
        let own = self.places.principals.id_of(owner).map_or(0, |id| members.count_of(&id));
        let (largest, most) = members.largest()?;
        let newest = members.ends_of(largest).map(|(_, newest)| newest);
        if own > 1 && own == most {
            self.places.crowded.clients += 1;
        }
        newest.filter(|_| most >= own + 2)
    }

    /// The place is free; the next client in it is another.
    pub(super) fn free(&mut self, client: ClientIndex) {
        let Some(member) = self.members.get_mut(usize::from(client.0)).and_then(Option::take) else { return };
        if member.state == MemberState::Handshake {
            self.places.handshake_ends(client, &member);
        }
        if member.is_due {
            self.due.retain(|due| *due != client);
        }
        self.places.free.insert(client.0);
    }

    fn places_max(&self) -> usize {
        usize::from(self.settings.clients_max) + usize::from(self.settings.handshakes_max)
    }
}
