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

use super::ground::LanSegment;
use crate::lan::Wire;
use crate::lan::junk::Junk;
use crate::lan::nodes::{ETHERNET, UNPACED};
use crate::lan::wire::address;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Cell, End, Failure, Pause};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
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
pub(super) fn cases() -> Vec<Case> {
    vec![case("junk", JunkSource::Stranger), case("junk of a peer", JunkSource::Peer)]
}

fn case(name: &'static str, from: JunkSource) -> Case {
    Case::new(name, BYTES, "us", move |settings, subject| {
        let ground = LanSegment::on(settings, &UNPACED, Wire::with_stranger(ETHERNET));
        let cell = Cell { pause: Pause::Asleep(PACE), ..Cell::hop(BYTES, settings.count(MESSAGES)) };
        let rates = RefCell::new(Vec::new());
        let under_junk = |ports, timed: &dyn Fn() -> Result<Vec<f64>, Failure>| {
            let wire = ground.wire()?;
            let go = || match from {
                JunkSource::Stranger => wire.enter_stranger(),
                JunkSource::Peer => wire.enter(End::Ping),
            };
            let junk = Junk::start(go, address(End::Pong), ports)?;
            let samples = timed();
            rates.borrow_mut().push(junk.end()?);
            samples
        };
        let ours = || ground.time(&cell);
        let udp = || ground.time_udp(&cell);
        let target = at_most(1.2).filter(|_| from == JunkSource::Stranger);
        let contenders = [
            Contender::sampled("rohrpost", || under_junk(&PORTS, &ours)),
            Contender::sampled("no junk", ours).beside(None, target),
            Contender::sampled("udp, junk on unread ports", || under_junk(&UNREAD, &udp)).beside(None, None),
            Contender::sampled("udp", udp).beside(None, None),
        ];
        let mut rows = compare(settings, subject, &contenders);
        let median = rohrpost_bench_local::statistics::median(rates.borrow().iter().copied());
        rows.extend(median.map(|median| {
            let subject = Subject { case: name.into(), bytes: None, unit: "datagrams/s" };
            Row::alone(subject, "junk to each port", Ok(Summary::single(median)))
        }));
        Ok(rows)
    })
}
