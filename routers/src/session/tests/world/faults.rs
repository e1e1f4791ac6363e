//! What goes wrong: streams that stall, break or die, clients that freeze, ends that start anew.

use super::{MS, S, World};
use crate::session::ClientIndex;
use crate::session::client::Client;
use crate::session::server::{MemberState, Server};
use crate::session::tests::oracle::Teller;
use crate::session::tests::pipe::Pipe;
use crate::session::tests::plan::{address, client_settings, ranges, server_settings};

/// Its address is none of a client.
const IMPOSTOR: usize = 250;

impl World {
    pub(super) fn fail(&mut self) {
        if self.plan.stalled.is_some() && self.now_ns == S {
            let stalled = self.plan.stalled;
            for connection in self.connections.iter_mut().filter(|connection| Some(connection.client) == stalled) {
                connection.down.stalled_until_ns = u64::MAX;
            }
        }
        if !self.may_fail || !self.faults.per_million(2500) {
            return;
        }
        let client = self.faults.below(self.nodes.len() as u64) as usize;
        let until_ns = self.now_ns + self.faults.between(100, 4000) * MS;
        match self.faults.below(12) {
            0 => self.restart_server(),
            1 => self.restart_client(client),
            2 => self.nodes[client].frozen_until_ns = until_ns,
            what => {
                let mut connections = self.connections.iter_mut();
                let Some(connection) = connections.find(|one| one.client == client && one.is_client_open) else {
                    return;
                };
                self.oracle.seen.entry("line faults").and_modify(|count| *count += 1).or_insert(1);
                match what {
                    3 | 4 => connection.down.stalled_until_ns = until_ns,
                    5 => connection.up.stalled_until_ns = until_ns,
                    6 => connection.down.is_dead = true,
                    7 => connection.up.is_dead = true,
                    8 => (connection.up.is_dead, connection.down.is_dead) = (true, true),
                    // Both are told, after what is under way; or nothing of that comes.
                    9 => (connection.up.is_closed, connection.down.is_closed) = (true, true),
                    _ => self.break_connection(client),
                }
            }
        }
    }

    /// Somebody at an address of its own says hello as the present incarnation of a client, and goes again. Nobody
    /// loses its place by that.
    pub(super) fn impersonate(&mut self) {
        let is_there = self.may_fail && self.now_ns >= self.server_down_until_ns;
        if !is_there || !self.impostors.per_million(500) {
            return;
        }
        let index = self.impostors.below(self.nodes.len() as u64) as usize;
        let (node, now_ns) = (&self.nodes[index], self.server_clock.at(self.now_ns).monotonic_ns);
        let mut impostor = Client::new(client_settings(index, node.incarnation), Vec::new(), now_ns);
        (0..=self.impostors.below(2 * node.attempts + 2)).for_each(|_| impostor.connected(now_ns));
        let line = self.rings.as_mut().map(|rings| &mut rings.server.line);
        let mut teller = Teller { oracle: &mut self.oracle, client: usize::MAX, chance: &mut self.impostors, line };
        let before = members(&self.server);
        let Some(place) = self.server.accept(now_ns, address(IMPOSTOR, 0), &mut teller) else { return };
        self.server.received(now_ns, place, impostor.ready(), &mut teller);
        let after = members(&self.server);
        self.server.closed(now_ns, place, &mut teller);
        self.server_wake_ns = 0;
        self.oracle.saw("impostors");
        if !before.iter().all(|client| after.contains(client)) {
            self.oracle.broken(format!("somebody else takes the place of client {index} by its incarnation"));
        }
    }

    /// Both ends are told at once, and what is under way is lost.
    fn break_connection(&mut self, client: usize) {
        for connection in self.connections.iter_mut().filter(|connection| connection.client == client) {
            let line = self.plan.lines[client];
            (connection.up, connection.down) =
                (Pipe::new(self.faults.fork(), line, false), Pipe::new(self.faults.fork(), line, false));
            (connection.up.is_closed, connection.down.is_closed) = (true, true);
        }
    }

    /// The server is gone, and does not come again.
    pub(in crate::session::tests) fn end_server(&mut self) {
        self.server_down_until_ns = u64::MAX;
    }

    fn restart_server(&mut self) {
        self.oracle.saw("server restarted");
        self.check_server(false);
        self.server_incarnation += 2;
        self.server = Server::new(server_settings(self.server_incarnation));
        self.rings.iter_mut().for_each(|rings| rings.server.restart());
        self.server_wake_ns = 0;
        self.server_down_until_ns = self.now_ns + self.faults.between(0, 1500) * MS;
        let is_told = self.faults.percent(70);
        for connection in &mut self.connections {
            connection.index = None;
            connection.down.is_closed = is_told;
            connection.down.is_dead |= !is_told;
        }
    }

    fn restart_client(&mut self, index: usize) {
        self.oracle.saw("client restarted");
        let node = &mut self.nodes[index];
        node.incarnation += 2;
        let now_ns = node.clock.at(self.now_ns).monotonic_ns;
        node.client = Client::new(client_settings(index, node.incarnation), ranges(index), now_ns);
        self.rings.iter_mut().for_each(|rings| rings.clients[index].restart());
        node.wake_ns = 0;
        let is_told = self.faults.percent(50);
        for connection in self.connections.iter_mut().filter(|one| one.client == index) {
            connection.is_client_open = false;
            connection.up.is_closed = is_told;
            connection.up.is_dead |= !is_told;
            connection.down.is_dead = true;
        }
    }
}

/// Clients that take part.
fn members(server: &Server) -> Vec<ClientIndex> {
    server.clients().filter(|(_, _, state)| *state == MemberState::Member).map(|(client, _, _)| client).collect()
}
