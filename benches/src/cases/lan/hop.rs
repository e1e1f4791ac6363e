//! How long a package takes from a module on one node to a module on another, one at a time; every waiting process
//! sleeps.

use super::ground::{LanSegment, WHOLE};
use crate::lan::chain::{time_chain, time_mailbox_chain};
use crate::lan::nodes::{ETHERNET, Network, UNPACED};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, Pause};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use std::time::Duration;

const MESSAGES_PACED: usize = 1_000;
/// Period of packages, as robots send.
const PACE: Duration = Duration::from_micros(500);

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    let whole = |bytes| LanHop { name: "hop", bytes, mtu: WHOLE, pause: Pause::None, has_target: true };
    let mut cases = [64, 1024, 16_384, 62_000].map(whole).to_vec();
    cases.push(LanHop { name: "hop, paced", pause: Pause::Asleep(PACE), has_target: false, ..whole(64) });
    cases.push(LanHop { name: "hop, in fragments", mtu: ETHERNET, has_target: false, ..whole(16_384) });
    cases.into_iter().map(LanHop::case).collect()
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

impl LanHop {
    fn case(self) -> Case {
        Case::new(self.name, self.bytes, "us", move |settings, subject| {
            let ground = LanSegment::new(settings, &Network { mtu: self.mtu, ..UNPACED });
            let messages = settings.count(if self.pause == Pause::None { Cell::HOP_MESSAGES } else { MESSAGES_PACED });
            let cell = Cell { pause: self.pause, ..Cell::hop(self.bytes, messages) };
            let target = |bound| at_most(bound).filter(|_| self.has_target);
            let mailboxes = || time_mailbox_chain(ground.wire()?, &cell);
            let contenders = [
                Contender::sampled("rohrpost", || ground.time(&cell)),
                Contender::sampled("chain", || time_chain(ground.wire()?, &cell)).beside(target(1.15), target(1.3)),
                Contender::sampled("chain of mailboxes", mailboxes).beside(None, None),
                Contender::sampled("udp", || ground.time_udp(&cell)).beside(None, None),
            ];
            Ok(compare(settings, subject, &contenders))
        })
    }
}
