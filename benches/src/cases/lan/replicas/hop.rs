//! How long a pose takes from a module on one node to a module on another as a record of a stream, beside a package of
//! the same routers; every waiting process sleeps.

use crate::cases::lan::ground::{LanSegment, replicating};
use crate::lan::nodes::index;
use crate::lan::records::RecordLink;
use crate::lan::udp::Datagrams;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, End, Failure, Scheduling, time_two_processes};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::StreamShape;
use std::time::Duration;

const BYTES: usize = 64;
const SHAPE: StreamShape = StreamShape { record_bytes: BYTES as u32, keep: 64, readers: 4, late: Duration::ZERO };

pub(super) fn cases() -> Vec<Box<dyn Case>> {
    vec![
        Box::new(ReplicaHop { name: "replica, hop", scheduling: Scheduling::Fifo, bound: Some(Target::AtMost(1.1)) }),
        Box::new(ReplicaHop { name: "replica, hop, default scheduler", scheduling: Scheduling::Normal, bound: None }),
    ]
}

struct ReplicaHop {
    name: &'static str,
    /// Of the modules. Routers schedule themselves: threads of packages above all modules, those of replicas like any
    /// process.
    scheduling: Scheduling,
    /// Beside a package.
    bound: Option<Target>,
}

impl Case for ReplicaHop {
    fn name(&self) -> String {
        self.name.into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let ground = LanSegment::new(settings, &replicating(SHAPE));
        let cell = Cell { scheduling: self.scheduling, ..Cell::hop(BYTES, settings.count(Cell::HOP_MESSAGES)) };
        let contenders = [
            Contender::sampled("rohrpost", || {
                let (nodes, _) = ground.turn()?;
                time_two_processes(&cell, |end, meetings| {
                    let other = if end == End::Ping { End::Pong } else { End::Ping };
                    let link = RecordLink::open(&nodes.directory(end), [end, other].map(index), SHAPE)?;
                    // Both read before one writes.
                    meetings.meet()?;
                    Ok(link)
                })
            }),
            Contender::sampled("a package", || {
                let (nodes, turn) = ground.turn()?;
                time_two_processes(&cell, |end, meetings| nodes.module(end, turn, BYTES, meetings))
            }),
            Contender::sampled("udp", || time_two_processes(&cell, |end, _| Datagrams::open(ground.wire()?, end))),
        ];
        let versus =
            [Versus { name: "a package", p50: self.bound, p99: None }, Versus { name: "udp", p50: None, p99: None }];
        let subject = Subject { case: self.name(), bytes: Some(BYTES), unit: "us" };
        Ok(compare(settings, &subject, &contenders, &versus))
    }
}
