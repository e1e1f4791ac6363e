//! The cost of sealed datagrams: the hop with keys beside the same hop without, turn by turn.

use super::ground::{ETHERNET, LanSegment};
use crate::lan::nodes::{Network, UNPACED};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Failure, time_two_processes};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
use rohrpost_bench_local::settings::Settings;

/// All cases of this file.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    [64, 1024].map(|bytes| Box::new(Sealed { bytes }) as Box<dyn Case>).into()
}

struct Sealed {
    bytes: usize,
}

impl Case for Sealed {
    fn name(&self) -> String {
        "hop, sealed".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let network = Network { mtu: ETHERNET, rate: UNPACED, quota: "1 MiB", sealed: false, records: None };
        let [sealed, open] = [true, false].map(|sealed| LanSegment::new(settings, &Network { sealed, ..network }));
        let cell = Cell::hop(self.bytes, settings.count(Cell::HOP_MESSAGES));
        let time = |ground: &LanSegment| {
            let (nodes, turn) = ground.turn()?;
            time_two_processes(&cell, |end, meetings| nodes.module(end, turn, self.bytes, meetings))
        };
        let contenders =
            [Contender::sampled("rohrpost", || time(&sealed)), Contender::sampled("not sealed", || time(&open))];
        let versus = [Versus { name: "not sealed", p50: Some(Target::AtMost(1.25)), p99: None }];
        let subject = Subject { case: self.name(), bytes: Some(self.bytes), unit: "us" };
        Ok(compare(settings, &subject, &contenders, &versus))
    }
}
