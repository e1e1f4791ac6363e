//! A server, its clients and the lines between them, in virtual time from a seed.

mod faults;
pub(super) mod rings;
mod streams;

use super::oracle::{Known, SessionOracle, Teller};
use super::plan::{Plan, client_settings, clock, loud, module, ranges, server_settings, shared, system_of};
use crate::admission::capped;
use crate::session::LOOK_EVERY_NS;
use crate::session::client::{self, Client, ClientPackage};
use crate::session::server::{self, Server};
use rings::AllRings;
use rohrpost_mailbox::{ALL_SYSTEMS, Head, Name, Options, Priority, TimeRecord, TimeSource, Type};
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_testbed::sim::clock::Clock;
use streams::Connection;

pub(super) const MS: u64 = 1_000_000;
pub(super) const S: u64 = 1000 * MS;
/// True system time, ns ahead of the world's.
const SYSTEM_NS: u64 = 1_700_000_000 * S;
/// What an end may take up: packages that wait and their places, a batch, a frame on each side, and the rest.
const BYTES_MAX: usize = super::plan::QUOTA + 16 * 1024 + 2 * 2 * 66_000 + 8192;

pub(super) struct Node {
    pub(super) client: Client,
    clock: Clock,
    frozen_until_ns: u64,
    wake_ns: u64,
    incarnation: u64,
    pub(super) attempts: u64,
    chance: Chance,
}

pub(super) struct World {
    pub(super) plan: Plan,
    pub(super) now_ns: u64,
    pub(super) oracle: SessionOracle,
    pub(super) server: Server,
    pub(super) server_clock: Clock,
    server_incarnation: u64,
    /// Nobody can connect until then.
    server_down_until_ns: u64,
    server_wake_ns: u64,
    pub(super) nodes: Vec<Node>,
    connections: Vec<Connection>,
    /// Streams and their replicas, if the plan has some.
    pub(super) rings: Option<AllRings>,
    faults: Chance,
    posts: Chance,
    host: Chance,
    impostors: Chance,
    pub(super) may_fail: bool,
    pub(super) may_post: bool,
}

impl World {
    pub(super) fn new(plan: Plan) -> Self {
        let mut chance = Chance::new(plan.seed);
        let node = |index: usize, chance: &mut Chance| {
            let (clock, incarnation) = (clock(chance), chance.bits() | 1);
            let client = Client::new(client_settings(index, incarnation), ranges(index), clock.at(0).monotonic_ns);
            Node { client, clock, frozen_until_ns: 0, wake_ns: 0, incarnation, attempts: 0, chance: chance.fork() }
        };
        let nodes: Vec<Node> = (0..plan.clients).map(|index| node(index, &mut chance)).collect();
        let known = |index| Known {
            system: system_of(index),
            ranges: ranges(index),
            reaches_own: client_settings(index, 1).reaches_own,
        };
        let mut oracle = SessionOracle::new((0..plan.clients).map(known).collect());
        oracle.flooder = plan.flooder;
        let (may_fail, server_incarnation) = (!plan.calm, chance.bits() | 1);
        Self {
            now_ns: 0,
            oracle,
            server: Server::new(server_settings(server_incarnation)),
            server_clock: clock(&mut chance),
            server_incarnation,
            server_down_until_ns: 0,
            server_wake_ns: 0,
            nodes,
            connections: Vec::new(),
            rings: plan.has_replicas.then(|| AllRings::new(plan.clients)),
            faults: chance.fork(),
            posts: chance.fork(),
            host: chance.fork(),
            impostors: Chance::new(!plan.seed),
            may_fail,
            may_post: true,
            plan,
        }
    }

    pub(super) fn run(&mut self, for_ns: u64) {
        let end_ns = self.now_ns + for_ns;
        while self.now_ns < end_ns && self.oracle.problems.is_empty() {
            self.now_ns += MS;
            self.oracle.now_ns = self.now_ns;
            self.fail();
            self.impersonate();
            self.post();
            self.turn_rings();
            self.carry();
            self.poll_server();
            (0..self.nodes.len()).for_each(|index| self.poll_client(index));
            self.connections.retain(|connection| connection.index.is_some() || connection.is_client_open);
            if self.now_ns.is_multiple_of(50 * MS) {
                self.look();
            }
        }
    }

    /// What must hold at any moment.
    fn look(&mut self) {
        let (server_ns, system_ns) = (self.server_clock.at(self.now_ns).monotonic_ns, SYSTEM_NS + self.now_ns);
        let record = TimeRecord {
            epoch: 1,
            source: TimeSource::Master,
            monotonic_ns: server_ns,
            system_ns,
            pace_ppb: 1_000_000_000,
            error_ns: 100,
            drift_ns_s: 200_000,
        };
        self.server.set_time(Some(record));
        for (index, node) in self.nodes.iter().enumerate() {
            let now_ns = node.clock.at(self.now_ns).monotonic_ns;
            let session = node.client.clock().session(now_ns).filter(|_| node.client.is_up() && self.is_reached(index));
            if let Some(session) = session.filter(|session| session.ns.abs_diff(server_ns) > session.error_ns) {
                self.oracle.problems.push(format!("client {index}: session clock {session:?}, in truth {server_ns}"));
            }
            if let Some(time) = node.client.clock().system(now_ns).map(|record| record.at(now_ns)) {
                let off_ns = time.ns.abs_diff(system_ns);
                if u128::from(off_ns) > time.error.as_nanos() {
                    self.oracle.problems.push(format!("client {index}: system time {time:?} is {off_ns} ns off"));
                }
            }
            if node.client.bytes() > BYTES_MAX {
                self.oracle.problems.push(format!("client {index} takes up {} bytes", node.client.bytes()));
            }
        }
        for (index, _, _) in self.server.clients() {
            let bytes = self.server.bytes_of(index);
            if bytes > BYTES_MAX {
                self.oracle.problems.push(format!("the server has {bytes} bytes for {index:?}"));
            }
        }
    }

    /// Whether a client knows the server's present incarnation.
    fn is_reached(&self, client: usize) -> bool {
        let is_whole = |connection: &Connection| connection.is_client_open && connection.index.is_some();
        self.connections.iter().any(|connection| connection.client == client && is_whole(connection))
    }

    /// As much as the flooder's own line takes, to all others.
    fn flood(&mut self) {
        let Some(flooder) = self.plan.flooder.filter(|_| self.may_post) else { return };
        for to in (0..self.nodes.len()).filter(|to| *to != flooder) {
            let len = self.posts.between(200, 2000) as u16;
            let (from, kind, priority) = (loud(flooder), Type::data(2), Priority(250));
            self.send(flooder, Head { to: module(to), from, len, kind, priority, ..Head::default() }, false);
        }
    }

    fn post(&mut self) {
        self.flood();
        let share = (self.plan.per_s * 1000).min(1_000_000) as u32;
        let times = if self.posts.per_million(5000) { 40 } else { 1 };
        for _ in 0..times {
            if self.may_post && self.posts.per_million(share) {
                self.post_one();
            }
        }
    }

    fn post_one(&mut self) {
        let posts = &mut self.posts;
        let senders = if self.plan.held_bytes.is_some() { 1 } else { self.nodes.len() };
        let from = posts.below(senders as u64) as usize;
        let is_forged = posts.percent(2) && self.plan.flooder.is_none();
        let sender = if is_forged { (from + 1) % self.nodes.len() } else { from };
        let other = posts.below(self.nodes.len() as u64) as usize;
        let to = match posts.below(100) {
            0..70 if other != from => module(other),
            70..80 => Name::new(ALL_SYSTEMS, shared(1).class().0, 0, 0),
            80..85 => Name::new(1, 105, 0, 0),
            85..90 => Name::new(1, 103, 0, 7),
            90..95 => shared(system_of(other)),
            _ => Name::new(2, 250, 9, 0),
        };
        let is_short = posts.percent(95) || self.plan.flooder.is_some();
        let len = if is_short { posts.between(8, 200) } else { posts.between(8, 65_000) } as u16;
        let priority = Priority(posts.pick(&[10, 60, 60, 150, 250]));
        let is_command = posts.percent(40) || self.plan.flooder.is_some_and(|flooder| flooder != from);
        let kind = if is_command { Type::command(16) } else { Type::data(1) };
        let is_newest = kind == Type::data(1) && posts.percent(60);
        let (id, options) = if is_newest { (posts.below(3) as u16, Options::NEWEST) } else { (0, Options::default()) };
        let head = Head { to, from: module(sender).with_local(1), len, kind, id, priority, options };
        self.send(from, head, is_forged);
    }

    pub(super) fn send(&mut self, from: usize, head: Head, is_forged: bool) -> usize {
        let (number, body) = self.oracle.post(from, capped(&head), is_forged);
        self.oracle.saw("posted");
        let node = &mut self.nodes[from];
        let now_ns = node.clock.at(self.now_ns).monotonic_ns;
        let line = self.rings.as_mut().map(|rings| &mut rings.clients[from].line);
        let mut teller = Teller { oracle: &mut self.oracle, client: from, chance: &mut node.chance, line };
        node.client.send(now_ns, &ClientPackage { head, body: &body, published_ns: now_ns, hops: 0 }, &mut teller);
        node.wake_ns = 0;
        number
    }

    fn poll_server(&mut self) {
        let now_ns = self.server_clock.at(self.now_ns).monotonic_ns;
        if now_ns < self.server_wake_ns || self.now_ns < self.server_down_until_ns {
            return;
        }
        loop {
            let written = self.rings.as_ref().map(AllRings::written);
            let line = self.rings.as_mut().map(|rings| &mut rings.server.line);
            let mut teller = Teller { oracle: &mut self.oracle, client: usize::MAX, chance: &mut self.host, line };
            let (server, connections) = (&mut self.server, &mut self.connections);
            let find = |index| move |connection: &&mut Connection| connection.index == Some(index);
            match server.poll(now_ns, &mut teller) {
                server::ServerStep::Write(index) => {
                    let Some(connection) = connections.iter_mut().find(find(index)) else { break };
                    let count = connection.down.write(self.now_ns, server.ready(index));
                    connection.was_down_full = count < server.ready(index).len();
                    if let Some(written) = written {
                        connection.tap.took(&server.ready(index)[..count], written, teller.oracle);
                    }
                    server.took(now_ns, index, count);
                }
                server::ServerStep::Close(index) => {
                    let Some(connection) = connections.iter_mut().find(find(index)) else { break };
                    connection.index = None;
                    connection.down.is_closed = true;
                }
                server::ServerStep::Look => {}
                server::ServerStep::Wait { until_ns } => {
                    assert!(until_ns > now_ns && until_ns <= now_ns + LOOK_EVERY_NS);
                    self.server_wake_ns = until_ns;
                    break;
                }
            }
        }
    }

    fn poll_client(&mut self, index: usize) {
        let now_ns = self.nodes[index].clock.at(self.now_ns).monotonic_ns;
        if now_ns < self.nodes[index].wake_ns || self.now_ns < self.nodes[index].frozen_until_ns {
            return;
        }
        loop {
            let node = &mut self.nodes[index];
            let line = self.rings.as_mut().map(|rings| &mut rings.clients[index].line);
            let mut teller = Teller { oracle: &mut self.oracle, client: index, chance: &mut node.chance, line };
            let open = |connection: &&mut Connection| connection.client == index && connection.is_client_open;
            match node.client.poll(now_ns, &mut teller) {
                client::ClientStep::Connect => self.connect(index),
                client::ClientStep::Write => {
                    let Some(connection) = self.connections.iter_mut().find(open) else { break };
                    let count = connection.up.write(self.now_ns, node.client.ready());
                    connection.was_up_full = count < node.client.ready().len();
                    node.client.took(now_ns, count);
                }
                client::ClientStep::Close => {
                    if let Some(connection) = self.connections.iter_mut().find(open) {
                        connection.is_client_open = false;
                        connection.up.is_closed = true;
                    }
                }
                client::ClientStep::Wait { until_ns } => {
                    assert!(until_ns > now_ns, "client {index} waits for the past");
                    node.wake_ns = until_ns;
                    break;
                }
            }
        }
    }

    /// Every package that came has passed, or was lost with a cause; or still waits, if `waits_none` is false.
    pub(super) fn check_server(&mut self, waits_none: bool) {
        let problems = check_counts("the server", self.server.counts(), waits_none);
        self.oracle.problems.extend(problems);
    }

    /// Packages that newer ones took the place of, as those ends count them that still live.
    pub(super) fn replaced(&self) -> u64 {
        let clients = self.nodes.iter().map(|node| node.client.out());
        let all = clients.chain([self.server.counts()]);
        all.flat_map(|counts| counts.classes()).map(|(_, class)| class.replaced.get()).sum()
    }

    pub(super) fn check_clients(&mut self) {
        for (index, node) in self.nodes.iter().enumerate() {
            self.oracle.problems.extend(check_counts(&format!("client {index}, out"), node.client.out(), true));
            self.oracle.problems.extend(check_counts(&format!("client {index}, in"), node.client.inn(), true));
        }
    }
}

fn check_counts(end: &str, counts: &crate::session::SessionCounts, waits_none: bool) -> Vec<String> {
    let wrong = counts.classes().filter_map(|(priority, class)| {
        let (came, went) = (class.packages.get(), class.settled());
        let holds = if waits_none { came == went } else { came >= went };
        (!holds).then(|| format!("{end}: of class {} came {came}, and {went} are accounted for", priority.0))
    });
    wrong.collect()
}
