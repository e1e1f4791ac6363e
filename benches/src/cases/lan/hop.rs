//! How long a package takes from a module on one node to a module on another, one at a time; every waiting process
//! sleeps.

use super::ground::{ETHERNET, LanSegment, WHOLE};
use crate::lan::chain::{time_chain, time_mailbox_chain};
use crate::lan::nodes::{Network, UNPACED};
use crate::lan::udp::Datagrams;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Failure, Pause, time_two_processes};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
use rohrpost_bench_local::settings::Settings;
use std::time::Duration;

const MESSAGES_PACED: usize = 1_000;
/// Period of packages, as robots send.
const PACE: Duration = Duration::from_micros(500);

/// All cases of this file.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    let whole = |bytes| LanHop { name: "hop", bytes, mtu: WHOLE, pause: Pause::None, has_target: true };
    let mut cases = [64, 1024, 16_384, 62_000].map(whole).to_vec();
    cases.push(LanHop { name: "hop, paced", pause: Pause::Asleep(PACE), has_target: false, ..whole(64) });
    cases.push(LanHop { name: "hop, in fragments", mtu: ETHERNET, has_target: false, ..whole(16_384) });
    cases.into_iter().map(|case| Box::new(case) as Box<dyn Case>).collect()
}

#[derive(Clone)]
struct LanHop {
    name: &'static str,
    bytes: usize,
    mtu: u16,
    pause: Pause,
    /// Whether the targets apply.
    has_target: bool,
}

impl Case for LanHop {
    fn name(&self) -> String {
        self.name.into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let ground = LanSegment::new(
            settings,
            &Network { mtu: self.mtu, rate: UNPACED, quota: "1 MiB", sealed: false, records: None },
        );
        let messages = settings.count(if self.pause == Pause::None { Cell::HOP_MESSAGES } else { MESSAGES_PACED });
        let cell = Cell { pause: self.pause, ..Cell::hop(self.bytes, messages) };
        let contenders = [
            Contender::sampled("rohrpost", || {
                let (nodes, turn) = ground.turn()?;
                time_two_processes(&cell, |end, meetings| nodes.module(end, turn, self.bytes, meetings))
            }),
            Contender::sampled("chain", || time_chain(ground.wire()?, &cell)),
            Contender::sampled("chain of mailboxes", || time_mailbox_chain(ground.wire()?, &cell)),
            Contender::sampled("udp", || time_two_processes(&cell, |end, _| Datagrams::open(ground.wire()?, end))),
        ];
        let target = |bound| self.has_target.then_some(Target::AtMost(bound));
        let versus = [
            Versus { name: "chain", p50: target(1.15), p99: target(1.3) },
            Versus { name: "chain of mailboxes", p50: None, p99: None },
            Versus { name: "udp", p50: None, p99: None },
        ];
        let subject = Subject { case: self.name(), bytes: Some(self.bytes), unit: "us" };
        Ok(compare(settings, &subject, &contenders, &versus))
    }
}
