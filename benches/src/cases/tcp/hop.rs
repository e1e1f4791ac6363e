//! How long a package takes from a module through the TCP router to a module of another system, one at a time; every
//! waiting process sleeps.

use crate::lan::ends::Module;
use crate::tcp::relays::{time_mailbox_relays, time_relays};
use crate::tcp::systems::{Security, Systems, bench};
use crate::tcp::zenoh::time_zenoh;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Failure, time_two_processes};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use std::cell::Cell as Counter;
use std::time::Duration;

/// A package in flight for longer than 1.5 s counts as lost.
const LOST: Duration = Duration::from_secs(5);
/// Ratio to the least possible cost.
const OF_RELAYS: f64 = 1.3;
/// Ratio to the cost without TLS.
const OF_OPEN: f64 = 1.3;

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    [64, 1024, 16_384, 62_000].map(hop).into_iter().chain([64, 1024].map(sealed_hop)).collect()
}

/// Beside the floor and zenoh.
fn hop(bytes: usize) -> Case {
    Case::new("hop", bytes, "us", move |settings, subject| {
        let cell = Cell::hop(bytes, settings.count(Cell::HOP_MESSAGES));
        let open = TcpSegment::start(settings, Security::None);
        let contenders = [
            Contender::sampled("rohrpost", || open.time(&cell)),
            Contender::sampled("relays", || time_relays(&cell)).beside(at_most(OF_RELAYS), None),
            Contender::sampled("relays of mailboxes", || time_mailbox_relays(&cell)).beside(at_most(OF_RELAYS), None),
            Contender::sampled("zenoh", || time_zenoh(&cell)).beside(None, None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

/// With TLS beside without.
fn sealed_hop(bytes: usize) -> Case {
    Case::new("hop, sealed", bytes, "us", move |settings, subject| {
        let cell = Cell::hop(bytes, settings.count(Cell::HOP_MESSAGES));
        let [sealed, open] = [Security::Tls, Security::None].map(|security| TcpSegment::start(settings, security));
        let contenders = [
            Contender::sampled("rohrpost", || sealed.time(&cell)),
            Contender::sampled("not sealed", || open.time(&cell)).beside(at_most(OF_OPEN), None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

/// Two systems at a TCP router, and a module on each: what all turns of a case share.
pub(in crate::cases) struct TcpSegment {
    /// None without the command, or if it does not start: then the others still have figures.
    systems: Result<Systems, Failure>,
    turns: Counter<u8>,
}

impl TcpSegment {
    pub(in crate::cases) fn start(settings: &Settings, security: Security) -> Self {
        let systems = Systems::start(settings, security).and_then(Systems::with_clients);
        Self { systems, turns: Counter::new(0) }
    }

    /// The systems, if they started.
    pub(in crate::cases) fn systems(&self) -> Result<&Systems, Failure> {
        self.systems.as_ref().map_err(Clone::clone)
    }

    /// One way from module to module, µs.
    pub(in crate::cases) fn time(&self, cell: &Cell) -> Result<Vec<f64>, Failure> {
        let systems = self.systems()?;
        let turn = self.turns.get();
        self.turns.set(turn.wrapping_add(1));
        time_two_processes(cell, |end, meetings| {
            let other = end.other();
            let names = [bench(end, turn), bench(other, turn)];
            Module::between(&systems.directory(end), names, cell.bytes, meetings)
                .map(|module| module.with_patience(LOST))
        })
    }
}
