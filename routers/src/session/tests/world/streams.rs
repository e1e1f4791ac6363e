//! What connects clients and server: opened, and bytes carried along it from end to end.

use super::S;
use super::World;
use super::rings::Tap;
use crate::session::ClientIndex;
use crate::session::tests::oracle::Teller;
use crate::session::tests::pipe::Pipe;
use crate::session::tests::plan::address;

/// A stream from a client to the server, as both see it.
pub(super) struct Connection {
    pub(super) client: usize,
    /// Its place at the server, as long as that has it open.
    pub(super) index: Option<ClientIndex>,
    pub(super) is_client_open: bool,
    pub(super) up: Pipe,
    pub(super) down: Pipe,
    pub(super) was_up_full: bool,
    pub(super) was_down_full: bool,
    /// What the server has sent.
    pub(super) tap: Tap,
}

impl World {
    /// Moves bytes from both ends of each connection to the other.
    pub(super) fn carry(&mut self) {
        for at in 0..self.connections.len() {
            self.carry_up(at);
            self.carry_down(at);
        }
    }

    fn carry_up(&mut self, at: usize) {
        let connection = &mut self.connections[at];
        let now_ns = self.server_clock.at(self.now_ns).monotonic_ns;
        let line = self.rings.as_mut().map(|rings| &mut rings.server.line);
        let mut teller = Teller { oracle: &mut self.oracle, client: usize::MAX, chance: &mut self.host, line };
        while let Some(index) = connection.index {
            let Some(bytes) = connection.up.read(self.now_ns) else { break };
            self.server.received(now_ns, index, &bytes, &mut teller);
            self.server_wake_ns = 0;
        }
        if let Some(index) = connection.index {
            if connection.up.is_at_end() {
                self.server.closed(now_ns, index, &mut teller);
                connection.index = None;
                connection.down.is_closed = true;
            } else if connection.was_down_full && connection.down.has_room() {
                connection.was_down_full = false;
                self.server.writable(index);
                self.server_wake_ns = 0;
            }
        }
    }

    fn carry_down(&mut self, at: usize) {
        let connection = &mut self.connections[at];
        let (index, node) = (connection.client, &mut self.nodes[connection.client]);
        if !connection.is_client_open || self.now_ns < node.frozen_until_ns {
            return;
        }
        let now_ns = node.clock.at(self.now_ns).monotonic_ns;
        let line = self.rings.as_mut().map(|rings| &mut rings.clients[index].line);
        let mut teller = Teller { oracle: &mut self.oracle, client: index, chance: &mut node.chance, line };
        while let Some(bytes) = connection.down.read(self.now_ns) {
            node.client.received(now_ns, &bytes, &mut teller);
            node.wake_ns = 0;
        }
        if connection.down.is_at_end() {
            node.client.closed(now_ns, &mut teller);
            node.wake_ns = 0;
            connection.is_client_open = false;
            connection.up.is_closed = true;
        } else if connection.was_up_full && connection.up.has_room() {
            connection.was_up_full = false;
            node.client.writable();
            node.wake_ns = 0;
        }
    }

    pub(super) fn connect(&mut self, index: usize) {
        let node = &mut self.nodes[index];
        node.attempts += 1;
        let now_ns = node.clock.at(self.now_ns).monotonic_ns;
        let is_there = self.now_ns >= self.server_down_until_ns;
        let line = self.rings.as_mut().map(|rings| &mut rings.server.line);
        let mut teller = Teller { oracle: &mut self.oracle, client: usize::MAX, chance: &mut self.host, line };
        let from = address(index, node.attempts);
        let place = self.server_clock.at(self.now_ns).monotonic_ns;
        let Some(place) = is_there.then(|| self.server.accept(place, from, &mut teller)).flatten() else {
            let line = self.rings.as_mut().map(|rings| &mut rings.clients[index].line);
            let mut teller = Teller { oracle: &mut self.oracle, client: index, chance: &mut node.chance, line };
            return node.client.closed(now_ns, &mut teller);
        };
        let line = self.plan.lines[index];
        let (up, down) = (node.chance.fork(), node.chance.fork());
        let (mut up, mut down) = (Pipe::new(up, line, self.plan.calm), Pipe::new(down, line, self.plan.calm));
        if let Some(bytes) = self.plan.held_bytes.filter(|_| index == 0) {
            (up, down) = (up.holding(bytes), down.holding(bytes));
        }
        if self.plan.flooder.is_some_and(|flooder| flooder != index) {
            down = down.holding(8 * 1024);
        }
        if self.plan.holds_little {
            down = down.holding(8 * 1024);
            up = up.holding(8 * 1024);
        }
        if self.plan.stalled == Some(index) && self.now_ns >= S {
            down.stalled_until_ns = u64::MAX;
        }
        if self.may_fail && self.faults.percent(4) {
            (up.is_dead, down.is_dead) = (true, true);
        }
        node.client.connected(now_ns);
        self.connections.push(Connection {
            client: index,
            index: Some(place),
            is_client_open: true,
            up,
            down,
            was_up_full: false,
            was_down_full: false,
            tap: Tap::default(),
        });
    }
}
