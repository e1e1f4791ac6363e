//! What a seed decides: who takes part, with which clocks and lines, and what goes wrong.

use crate::session::client::ClientSettings;
use crate::session::frame::Range;
use crate::session::server::ServerSettings;
use crate::sim::chance::Chance;
use rohrpost_mailbox::Name;

pub(super) const QUOTA: usize = 80 * 1024;
pub(super) const COMMON: u64 = 7;

/// A computer's monotonic clock.
#[derive(Clone, Copy)]
pub(super) struct Clock {
    base_ns: u64,
    ppb: i64,
}

impl Clock {
    pub(super) fn new(chance: &mut Chance) -> Self {
        // Two of them differ by at most 200 ppm.
        Self { base_ns: chance.scale(1_000_000_000, 1 << 50), ppb: chance.around(100_000) }
    }

    pub(super) fn at(&self, true_ns: u64) -> u64 {
        let drift_ns = i128::from(true_ns) * i128::from(self.ppb) / 1_000_000_000;
        self.base_ns + true_ns.saturating_add_signed(drift_ns as i64)
    }
}

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
}

impl Plan {
    pub(super) fn rough(seed: u64) -> Self {
        let mut chance = Chance::new(seed);
        let clients = chance.between(3, 7) as usize;
        let lines = (0..clients).map(|_| chance.scale(20, 100_000)).collect();
        Self { seed, clients, calm: false, stalled: None, lines, held_bytes: None, per_s: chance.scale(100, 3000) }
    }

    pub(super) fn calm(seed: u64) -> Self {
        Self { calm: true, lines: vec![100_000; 7], per_s: 500, ..Self::rough(seed) }
    }

    /// The first client's line takes 64 kbit/s, and holds what a kernel does that knows of it.
    pub(super) fn slow(seed: u64) -> Self {
        let lines = vec![8, 100_000, 100_000];
        Self { clients: 3, lines, held_bytes: Some(8 * 1024), per_s: 30, ..Self::calm(seed) }
    }
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

pub(super) fn ranges(client: usize) -> Vec<Range> {
    let mut ranges = vec![Range::module(module(client))];
    if client < 3 {
        ranges.push(Range::module(shared(system_of(client))));
    }
    match client {
        0 => ranges.push(Range { first: Name::new(1, 100, 0, 0), last: Name::new(1, 110, 255, 255) }),
        3 => ranges.push(Range::module(Name::new(1, 105, 0, 0))),
        _ => {}
    }
    ranges
}

pub(super) fn levels() -> [u8; 256] {
    std::array::from_fn(|priority| if priority < 16 { 31 } else { (15 - (priority as u8 >> 4)) * 2 })
}

pub(super) fn client_settings(client: usize, life: u64) -> ClientSettings {
    ClientSettings {
        name: format!("client {client}"),
        system: system_of(client),
        reaches_own: client.is_multiple_of(2),
        common: COMMON,
        system_digest: u64::from(system_of(client)) * 11,
        life,
        quota_bytes: QUOTA,
        levels: levels(),
    }
}

pub(super) fn server_settings(life: u64) -> ServerSettings {
    ServerSettings {
        name: "the server".into(),
        common: COMMON,
        system: Some((1, 11)),
        life,
        clients_max: 16,
        greetings_max: 4,
        quota_bytes: QUOTA,
        levels: levels(),
    }
}
