//! A package now and then from node to node, while 500 000 foreign datagrams a second arrive at each port of the far
//! node: how much later the package arrives than without them.
//!
//! ```text
//!  processor 0                                processor 1
//!  ping ─▶ router ═══════════════════════════▶ router ─▶ pong
//!  junk ══════════════════════════════════════▶ both of its ports
//! ```
//! `junk`: from an address that no node has; `junk of a peer`: from the address of the near node, as an attacker may
//! forge it. The floor of each: a bare hop by UDP under the same junk, to ports that nobody reads. It shows what the
//! junk costs the computer that carries it.

use super::ground::{ETHERNET, LanSegment};
use crate::lan::Wire;
use crate::lan::junk::Junk;
use crate::lan::nodes::{Network, UNPACED};
use crate::lan::udp::Datagrams;
use crate::lan::wire::address;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, End, Failure, Pause, time_two_processes};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, Target, Versus, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use std::cell::RefCell;
use std::time::Duration;

const BYTES: usize = 64;
const MESSAGES: usize = 2_000;
const PACE: Duration = Duration::from_micros(500);
/// Default ports of packages and of time; and two that nobody reads.
const PORTS: [u16; 2] = [21_117, 21_118];
const UNREAD: [u16; 2] = [21_217, 21_218];

/// The source address of junk.
#[derive(Clone, Copy, PartialEq, Eq)]
enum JunkSource {
    /// A third computer, which is no node.
    Stranger,
    /// The near end: a node from which the far one accepts datagrams.
    Peer,
}

/// All cases of this file.
pub(super) fn cases() -> Vec<Box<dyn Case>> {
    let case = |name, from| Box::new(LanJunk { name, from }) as Box<dyn Case>;
    vec![case("junk", JunkSource::Stranger), case("junk of a peer", JunkSource::Peer)]
}

struct LanJunk {
    name: &'static str,
    from: JunkSource,
}

impl Case for LanJunk {
    fn name(&self) -> String {
        self.name.into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let network = Network { mtu: ETHERNET, rate: UNPACED, quota: "1 MiB", sealed: false, records: None };
        let ground = LanSegment::on(settings, &network, Wire::with_stranger(network.mtu));
        let cell = Cell { pause: Pause::Asleep(PACE), ..Cell::hop(BYTES, settings.count(MESSAGES)) };
        let rates = RefCell::new(Vec::new());
        let under_junk = |ports, timed: &dyn Fn() -> Result<Vec<f64>, Failure>| {
            let wire = ground.wire()?;
            let go = || match self.from {
                JunkSource::Stranger => wire.enter_stranger(),
                JunkSource::Peer => wire.enter(End::Ping),
            };
            let junk = Junk::start(go, address(End::Pong), ports)?;
            let samples = timed();
            rates.borrow_mut().push(junk.end()?);
            samples
        };
        let ours = || {
            let (nodes, turn) = ground.turn()?;
            time_two_processes(&cell, |end, meetings| nodes.module(end, turn, BYTES, meetings))
        };
        let udp = || time_two_processes(&cell, |end, _| Datagrams::open(ground.wire()?, end));
        let contenders = [
            Contender::sampled("rohrpost", || under_junk(&PORTS, &ours)),
            Contender::sampled("no junk", ours),
            Contender::sampled("udp, junk on unread ports", || under_junk(&UNREAD, &udp)),
            Contender::sampled("udp", udp),
        ];
        let target = (self.from == JunkSource::Stranger).then_some(Target::AtMost(1.2));
        let versus = [
            Versus { name: "no junk", p50: None, p99: target },
            Versus { name: "udp, junk on unread ports", p50: None, p99: None },
            Versus { name: "udp", p50: None, p99: None },
        ];
        let subject = Subject { case: self.name(), bytes: Some(BYTES), unit: "us" };
        let mut rows = compare(settings, &subject, &contenders, &versus);
        let median = rohrpost_bench_local::statistics::median(rates.borrow().iter().copied());
        rows.extend(median.map(|median| {
            let subject = Subject { case: self.name(), bytes: None, unit: "datagrams/s" };
            Row::alone(subject, "junk to each port", Ok(Summary::single(median)))
        }));
        Ok(rows)
    }
}
