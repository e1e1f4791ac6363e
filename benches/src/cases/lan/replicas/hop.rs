//! How long a pose takes from a module on one node to a module on another as a record of a stream, beside a package of
//! the same routers; every waiting process sleeps.

use crate::cases::lan::ground::LanSegment;
use crate::lan::nodes::{Network, UNPACED, index};
use crate::lan::records::RecordLink;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Scheduling, time_two_processes};
use rohrpost_bench_local::rounds::{Contender, Target, at_most, compare};
use rohrpost_mailbox::StreamShape;
use std::time::Duration;

const BYTES: usize = 64;
const SHAPE: StreamShape = StreamShape { record_bytes: BYTES as u32, keep: 64, readers: 4, late: Duration::ZERO };

pub(super) fn cases() -> Vec<Case> {
    vec![
        case("replica, hop", Scheduling::Fifo, at_most(1.1)),
        case("replica, hop, default scheduler", Scheduling::Normal, None),
    ]
}

/// The scheduling is that of modules. Routers schedule themselves: threads of packages above all modules, those of
/// replicas like any process. `bound`: beside a package.
fn case(name: &str, scheduling: Scheduling, bound: Option<Target>) -> Case {
    Case::new(name, BYTES, "us", move |settings, subject| {
        let ground = LanSegment::new(settings, &Network { records: Some(SHAPE), ..UNPACED });
        let cell = Cell { scheduling, ..Cell::hop(BYTES, settings.count(Cell::HOP_MESSAGES)) };
        let contenders = [
            Contender::sampled("rohrpost", || {
                let (nodes, _) = ground.turn()?;
                time_two_processes(&cell, |end, meetings| {
                    let link = RecordLink::open(&nodes.directory(end), [end, end.other()].map(index), SHAPE)?;
                    // Both read before one writes.
                    meetings.meet()?;
                    Ok(link)
                })
            }),
            Contender::sampled("a package", || ground.time(&cell)).beside(bound, None),
            Contender::sampled("udp", || ground.time_udp(&cell)).beside(None, None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}
