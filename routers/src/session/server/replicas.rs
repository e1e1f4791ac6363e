//! Replicas of nodes that are clients. A node is the client that hosts its name, `tcp.I`: so what lets nobody take a
//! name lets nobody read, or write, what is another node's.

use super::{Server, ServerHost};
use crate::frame::ReplicaFrame;
use crate::session::ClientIndex;
use crate::session::outgoing::add_part;

impl Server {
    /// Clients for which a record waits have something to do.
    pub(super) fn look_for_parts(&mut self, now_ns: u64, host: &mut impl ServerHost) {
        let Some(replicas) = host.replicas() else { return };
        replicas.refresh(now_ns);
        for (node, name) in replicas.nodes() {
            let Some(client) = self.table.client_of(*name) else { continue };
            let waits = replicas.waits_for(now_ns, *node);
            self.member_mut(client).into_iter().for_each(|member| member.has_parts = waits);
            if replicas.is_behind(*node) {
                self.is_due(client);
            }
        }
    }

    /// Makes the next part for a client ready, if nothing else is, no packages go first, and it got none in this turn.
    /// Whether one was made.
    pub(super) fn add_part(&mut self, now_ns: u64, client: ClientIndex, host: &mut impl ServerHost) -> bool {
        let (turn, party) = (self.turn, self.settings.system.map_or(0, |(system, _)| system.into()));
        let Some(member) = self.member_mut(client).filter(|member| member.is_member()) else { return false };
        let Some(node) = member.node.filter(|_| member.outgoing.ready().is_empty()) else { return false };
        if member.part_turn == turn {
            self.has_put_off |= member.has_parts;
            return false;
        }
        let (is_made, has_parts) = add_part(&mut member.outgoing, now_ns, (node, party), host);
        member.has_parts = has_parts;
        if is_made {
            member.part_turn = turn;
        }
        is_made
    }

    /// A client may host other names now: it may be a node by now, or may have been one.
    pub(super) fn look_at_node(&mut self, now_ns: u64, client: ClientIndex, host: &mut impl ServerHost) {
        let Some(replicas) = host.replicas() else { return };
        let is_its = |name| self.table.client_of(name) == Some(client);
        let node = replicas.nodes().iter().find(|(_, name)| is_its(*name)).map(|(node, _)| *node);
        let Some(member) = self.member_mut(client).filter(|member| member.node != node) else { return };
        member.has_parts = false;
        let before = std::mem::replace(&mut member.node, node);
        before.into_iter().for_each(|before| replicas.left(now_ns, before));
        node.into_iter().for_each(|node| replicas.came(now_ns, node));
    }

    /// Takes a part that a client sends.
    pub(super) fn take_part(
        &mut self,
        now_ns: u64,
        client: ClientIndex,
        part: &ReplicaFrame<'_>,
        host: &mut impl ServerHost,
    ) {
        let Some((replicas, member)) = host.replicas().zip(self.member(client)) else { return };
        replicas.take(now_ns, (member.node, member.incarnation), part);
    }
}
