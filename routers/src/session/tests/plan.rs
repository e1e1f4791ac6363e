//! What a seed decides: the clients, their clocks and rates, and the faults.

use crate::admission::Admission;
use crate::session::client::ClientSettings;
use crate::session::frame::Range;
use crate::session::server::{MovingHosts, OwnNodes, ServerSettings};
use rohrpost_mailbox::{Class, Name};
use rohrpost_testbed::sim::chance::Chance;
use rohrpost_testbed::sim::clock::Clock;
use std::net::SocketAddr;

pub(super) const QUOTA: usize = 80 * 1024;
pub(super) const COMMON: u64 = 7;

/// The clock of a computer; two of them differ by at most 200 ppm.
pub(super) fn clock(chance: &mut Chance) -> Clock {
    let monotonic_ns = chance.scale(1_000_000_000, 1 << 50);
    Clock::new(monotonic_ns, monotonic_ns, chance.around(100_000))
}

#[derive(Default)]
pub(super) struct Plan {
    pub(super) seed: u64,
    pub(super) clients: usize,
    pub(super) calm: bool,
    /// This one reads nothing from the first second on.
    pub(super) stalled: Option<usize>,
    /// Bytes a ms of each client's line.
    pub(super) lines: Vec<u64>,
    /// What both kernels hold of the first client's line, bytes; none: much. Then nobody else sends.
    pub(super) held_bytes: Option<usize>,
    /// Packages that all clients send together, a second.
    pub(super) per_s: u64,
    /// This one sends what is urgent, more than the lines of all others carry. The others send commands, and their
    /// lines hold little.
    pub(super) flooder: Option<usize>,
    /// Streams go along, more than slow lines carry.
    pub(super) has_replicas: bool,
    /// The kernels hold little of each line.
    pub(super) holds_little: bool,
}

impl Plan {
    pub(super) fn rough(seed: u64) -> Self {
        let mut chance = Chance::new(seed);
        let clients = chance.between(3, 7) as usize;
        let lines = (0..clients).map(|_| chance.scale(20, 100_000)).collect();
        let per_s = chance.scale(100, 3000);
        Self { seed, clients, lines, per_s, ..Self::default() }
    }

    pub(super) fn calm(seed: u64) -> Self {
        Self { calm: true, lines: vec![100_000; 7], per_s: 500, ..Self::rough(seed) }
    }

    /// Replicas beside little else, on lines of 40 kB a second and more.
    pub(super) fn replicated(seed: u64) -> Self {
        let mut chance = Chance::new(seed ^ 0xe1a);
        let plan = Self::rough(seed);
        let lines = (0..plan.clients).map(|_| chance.scale(40, 10_000)).collect();
        Self { lines, per_s: 30, has_replicas: true, holds_little: true, ..plan }
    }

    /// One client floods all others, at rates of some hundred kB a second.
    pub(super) fn flooded(seed: u64) -> Self {
        let mut chance = Chance::new(seed ^ 0xf10);
        let plan = Self::calm(seed);
        let flooder = chance.below(plan.clients as u64) as usize;
        let line = |client: usize| if client == flooder { 100_000 } else { chance.scale(100, 1000) };
        let lines = (0..plan.clients).map(line).collect();
        Self { lines, per_s: 40, flooder: Some(flooder), ..plan }
    }

    /// The first client's line takes 64 kbit/s, and holds what a kernel does that knows of it.
    pub(super) fn slow(seed: u64) -> Self {
        let lines = vec![8, 100_000, 100_000];
        Self { clients: 3, lines, held_bytes: Some(8 * 1024), per_s: 30, ..Self::calm(seed) }
    }
}

/// Of what a client hosts, this class is one of routers.
pub(super) const ROUTER: Class = Class(103);

/// Where a client comes from, at its so many-th connection.
pub(super) fn address(client: usize, connection: u64) -> SocketAddr {
    ([10, 0, 0, client as u8], 1024 + connection as u16).into()
}

pub(super) fn system_of(client: usize) -> u8 {
    1 + (client % 3) as u8
}

/// The module of a client.
pub(super) fn module(client: usize) -> Name {
    Name::new(system_of(client), 60, client as u8, 0)
}

/// What each system has once: with its first client.
pub(super) fn shared(system: u8) -> Name {
    Name::new(system, 40, 0, 0)
}

/// The module of a client that is the most urgent of all.
pub(super) fn loud(client: usize) -> Name {
    Name::new(system_of(client), 250, client as u8, 0)
}

pub(super) fn ranges(client: usize) -> Vec<Range> {
    let mut ranges = vec![Range::module(module(client)), Range::module(loud(client))];
    if client < 3 {
        ranges.push(Range::module(shared(system_of(client))));
    }
    match client {
        0 => ranges.extend([classes(100, 104), classes(106, 110)]),
        3 => ranges.push(Range::module(Name::new(1, 105, 0, 0))),
        _ => {}
    }
    ranges
}

/// All names of system 1 from one class to another.
pub(super) fn classes(first: u8, last: u8) -> Range {
    Range { first: Name::new(1, first, 0, 0), last: Name::new(1, last, 255, 255) }
}

pub(super) fn levels() -> [u8; 256] {
    std::array::from_fn(|priority| if priority < 16 { 31 } else { (15 - (priority as u8 >> 4)) * 2 })
}

pub(super) fn client_settings(client: usize, incarnation: u64) -> ClientSettings {
    ClientSettings {
        name: format!("client {client}"),
        system: system_of(client),
        reaches_own: client.is_multiple_of(2),
        common: COMMON,
        system_digest: u64::from(system_of(client)) * 11,
        incarnation,
        quota_bytes: QUOTA,
        levels: levels(),
        admission: Admission { router: Some(ROUTER), ..Admission::default() },
    }
}

pub(super) fn server_settings(incarnation: u64) -> ServerSettings {
    ServerSettings {
        name: "the server".into(),
        common: COMMON,
        system: Some((1, 11)),
        own_nodes: OwnNodes::default(),
        moving: MovingHosts::default(),
        incarnation,
        clients_max: 16,
        handshakes_max: 4,
        quota_bytes: QUOTA,
        levels: levels(),
    }
}
