//! The one point of admission: what comes from another node, from another system, or by the TCP router is validated
//! here before it reaches a mailbox.
//!
//! ```text
//!  LAN ─▶ Inbound ──────────┐                                    ┌─▶ the mailbox, with the priority that it may have
//!                           ├─▶ way · sender · receiver · kind ──┤
//!  TCP router ─▶ Client ────┘             · priority · body      └─▶ refused: counted by cause, a command is answered
//! ```
//!
//! A function of what configuration says and of the package alone: no socket, no clock, no memory of what came before.
//! What a receiver has asked for only the receiver knows: that data are of its subscription is looked at there.

mod packet;

pub use packet::Addresses;
#[cfg(test)]
pub(crate) use packet::tests::v4;

use crate::frame::NodeIndex;
use crate::{counts, session};
use rohrpost_config::{Access, AccessRule, Installation, ROUTER, TCP, TCP_SERVER, TEAM_ROUTER};
use rohrpost_mailbox::{Class, Head, Kind, Name, Priority, Type, local};
use rohrpost_network::Tunnel;

/// Mailbox of a router for IP packets from the same mailbox of other nodes.
pub const TUNNEL: u8 = 4;
/// Type of an IP packet.
pub const PACKET: Type = Type::data(1);
/// An IP packet goes behind all packages of modules.
pub(crate) const PACKET_PRIORITY: Priority = Priority(0);

/// The part of configuration that admission needs. The default refuses nothing but what is wrong in itself.
#[derive(Clone, Debug, Default)]
pub struct Admission {
    /// Which classes may command which, or which modules: the receiving node sees to it.
    pub access: Access,
    /// Class of the routers of the LAN.
    pub router: Option<Class>,
    /// Class of the TCP router and its clients.
    pub tcp: Option<Class>,
    /// Class of the routers of the team.
    pub team: Option<Class>,
    /// The tunnel for ordinary traffic, and which of its addresses is ours.
    pub tunnel: Option<(Tunnel, NodeIndex)>,
}

/// The way by which a package came.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ArrivalPath {
    /// From a node of the LAN. `is_its_name`: the sender's name is one of that node, or nothing vouches for the sender
    /// anyway.
    Lan {
        /// Which node.
        node: NodeIndex,
        /// See above.
        is_its_name: bool,
    },
    /// By the TCP router or the team's, which vouch for the sender. `is_our_name`: this node hosts it itself.
    Beyond {
        /// See above.
        is_our_name: bool,
    },
}

/// Why a package is not admitted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NotAdmitted {
    /// Its sender is not hosted where it came from.
    ForeignName,
    /// It is from or for a router's own mailbox, or for a router of another system.
    RoutersOwn,
    /// It is no IP packet from the tunnel's address of the node that it came from to ours.
    BadPacket,
    /// A command of a class that may not command this module.
    NotAllowed,
}

impl From<NotAdmitted> for counts::Cause {
    fn from(why: NotAdmitted) -> Self {
        match why {
            NotAdmitted::ForeignName => Self::ForeignName,
            NotAdmitted::RoutersOwn => Self::RoutersOwn,
            NotAdmitted::BadPacket => Self::BadPacket,
            NotAdmitted::NotAllowed => Self::NotAllowed,
        }
    }
}

impl From<NotAdmitted> for session::Cause {
    fn from(why: NotAdmitted) -> Self {
        match why {
            NotAdmitted::ForeignName => Self::Foreign,
            NotAdmitted::RoutersOwn | NotAdmitted::BadPacket => Self::RoutersOwn,
            NotAdmitted::NotAllowed => Self::NotAllowed,
        }
    }
}

impl Admission {
    /// Admission for a node, as in the configuration.
    pub fn new(installation: &Installation, node: &str) -> Self {
        let tunnel = installation.tdma.as_ref().and_then(|tdma| tdma.tunnel);
        Self {
            access: installation.access.clone(),
            router: installation.classes.id(ROUTER),
            tcp: installation.classes.id(TCP),
            team: installation.classes.id(TEAM_ROUTER),
            tunnel: tunnel.zip(installation.lan_index(node)),
        }
    }

    /// Whether a package that came may go to its mailbox. Its head is one that [`capped`] has been applied to.
    ///
    /// # Errors
    /// Why not.
    pub fn validate(&self, way: ArrivalPath, head: &Head, body: &[u8]) -> Result<(), NotAdmitted> {
        let is_reply = matches!(head.kind.kind(), Kind::Reply(_));
        match way {
            ArrivalPath::Lan { is_its_name: false, .. } => {
                return Err(NotAdmitted::ForeignName);
            }
            // In our own names the server itself speaks: it says that a module of ours is not there.
            ArrivalPath::Beyond { is_our_name } if is_our_name && !is_reply || !head.from.is_mailbox() => {
                return Err(NotAdmitted::ForeignName);
            }
            ArrivalPath::Lan { .. } | ArrivalPath::Beyond { .. } => {}
        }
        // A reply in the name of such a mailbox says that it takes nothing.
        if self.is_routers_own(head.to) || self.is_routers_own(head.from) && !is_reply {
            self.validate_routers_own(way, head, body)?;
        }
        if self.is_across_systems(way, head) {
            return Err(NotAdmitted::RoutersOwn);
        }
        if self.rule_against(head).is_none() { Ok(()) } else { Err(NotAdmitted::NotAllowed) }
    }

    /// The rule of `[access]` that keeps a package from its mailbox: a command, or what else takes up room in a mailbox
    /// for commands.
    pub(crate) fn rule_against(&self, head: &Head) -> Option<&AccessRule> {
        let is_command = matches!(head.kind.kind(), Kind::Command(_)) || head.to.local() == local::COMMANDS;
        if is_command { self.access.against(head.from, head.to) } else { None }
    }

    /// Whether a body is an IP packet from the tunnel's address of a node to ours.
    pub(crate) fn is_packet_of(&self, node: NodeIndex, body: &[u8]) -> bool {
        let Some((tunnel, own)) = &self.tunnel else { return false };
        let expected = Addresses { source: tunnel.address(node).into(), destination: tunnel.address(*own).into() };
        Addresses::of(body) == Some(expected)
    }

    /// The node that this mailbox for IP packets belongs to.
    pub(crate) fn tunnel_end(&self, name: Name) -> Option<NodeIndex> {
        (Some(name.class()) == self.router && name.local() == TUNNEL).then_some(name.instance())
    }

    /// Whether a mailbox is one by which routers carry packages. Commands, replies and data of their modules have the
    /// same mailboxes as those of any module.
    fn is_routers_own(&self, name: Name) -> bool {
        let class = Some(name.class());
        name.local() >= local::TRANSIT && (class == self.router || class == self.tcp || class == self.team)
    }

    /// From and to the mailboxes of routers nothing comes but IP packets by the LAN, from each node with its own
    /// address.
    fn validate_routers_own(&self, way: ArrivalPath, head: &Head, body: &[u8]) -> Result<(), NotAdmitted> {
        let node = match way {
            ArrivalPath::Lan { node, .. } => Some(node),
            ArrivalPath::Beyond { .. } => None,
        };
        let is_tunnel = node.is_some()
            && self.tunnel.is_some()
            && self.tunnel_end(head.from) == node
            && self.tunnel_end(head.to).is_some()
            && head.kind == PACKET;
        match node.filter(|_| is_tunnel) {
            None => Err(NotAdmitted::RoutersOwn),
            Some(node) if !self.is_packet_of(node, body) => Err(NotAdmitted::BadPacket),
            Some(_) => Ok(()),
        }
    }

    /// Whether a package of another system is for a router. The TCP router alone is for all: they ask it what it hosts.
    fn is_across_systems(&self, way: ArrivalPath, head: &Head) -> bool {
        let Head { to, from, .. } = *head;
        let class = Some(to.class());
        let is_for_all = class == self.tcp && to.module() == Name::new(to.system(), to.class().0, TCP_SERVER, 0);
        let is_router = class == self.router || class == self.tcp || class == self.team;
        matches!(way, ArrivalPath::Beyond { .. }) && from.system() != to.system() && is_router && !is_for_all
    }
}

/// A package's head with the priority that it may have beyond its own node.
///
/// A command has at most the class of its sender: no sender gives others more urgency than it has itself. A reply has
/// the priority of the command, so at most the class of its receiver, which sent the command. Data are either asked
/// for, like a reply, or sent unasked, like a command: they have at most the greater of both classes. Requests are not
/// tracked, so nothing tighter can be checked; and pretended replies are no more urgent to their receiver than its own
/// class. A mailbox for commands takes nothing above its sender's class: that would push commands out of it.
#[must_use]
pub fn capped(head: &Head) -> Head {
    let (sender, receiver) = (head.from.class().priority(), head.to.class().priority());
    let limit = match head.kind.kind() {
        Kind::Command(_) | Kind::None => sender,
        Kind::Reply(_) | Kind::Data(_) if head.to.local() == local::COMMANDS => sender,
        Kind::Reply(_) => receiver,
        Kind::Data(_) if sender.outranks(receiver) => sender,
        Kind::Data(_) => receiver,
    };
    Head { priority: head.priority.at_most(limit), ..*head }
}

#[cfg(test)]
mod tests;
