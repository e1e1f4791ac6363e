//! How many packages go from node to node in a second, beside raw datagrams, and what is lost of them.
//!
//! `rate`: the largest datagram holds exactly one package. `packing`: it holds as many as fit. Ours has a window of
//! packages in flight, as senders that await an answer have: more would only be lost in the router of the sending node.
//!
//! ```text
//!  processor 0                  processor 1
//!  raw sender ═══════════════▶ raw receiver
//!  sending router ═══════════▶ receiving router ─▶ receiving module;  sending module, a window at a time
//! ```
//! Two nodes share two processors here. So the sending router has a processor for itself, as the raw sender has. With
//! the sending module on that processor, too, and below its router as launch schedules it, each package costs two
//! process switches: a row of its own shows that.

use super::ground::{LanSegment, WHOLE};
use crate::lan::ends::{LanSink, LanSource};
use crate::lan::flow::{Flow, Flown, KERNEL_SILENCE, LOOK, SILENCE, flow};
use crate::lan::nodes::{self, Network, UNPACED};
use crate::lan::udp::Datagrams;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{End, Failure};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_least, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::{Summary, median};
use rohrpost_mailbox::HEAD_BYTES;
use rohrpost_routers::frame;
use std::cell::RefCell;
use std::time::Duration;

/// Long enough for some ten thousand packages, short enough that the kernel's fair server stays out.
pub(super) const TURN: Duration = Duration::from_millis(500);
/// Less than the slots of a router's mailbox.
const WINDOW: u64 = 60;
/// Above the routers' threads: a sender on the other processor hands over its whole window before they run.
pub(super) const SENDER_FIFO: u8 = 80;
const BESIDE_ROUTER: &str = "beside its router";
/// Headers of IPv4, UDP and a router's frame, before the packages.
const BEFORE_PACKAGES: usize = 28 + frame::HEAD_BYTES;
/// Minimum of a network's MTU.
const MTU_MIN: usize = 576;
/// Messages a second that seed 001 (CBWare, 2006, table 1) reached on a network of 1 Gbit/s, at most 3 MB/s.
const CBWARE: [(usize, f64); 4] = [(2112, 1200.0), (5860, 475.0), (15_236, 195.0), (36_084, 84.0)];

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    let rate = |bytes| Rate { name: "rate", bytes, packs: false, bound: 0.9 };
    let packing = Rate { name: "packing", bytes: 64, packs: true, bound: 3.0 };
    let rates = [64, 2112, 5860, 15_236, 36_084, 62_000].map(rate);
    rates.into_iter().chain([packing]).map(Rate::case).collect()
}

struct Rate {
    name: &'static str,
    bytes: usize,
    /// Whether many packages may share a datagram.
    packs: bool,
    /// Share of the raw datagrams' rate.
    bound: f64,
}

impl Rate {
    fn case(self) -> Case {
        Case::new(self.name, self.bytes, "packages/s", move |settings, subject| Ok(self.measure(settings, subject)))
    }

    fn measure(&self, settings: &Settings, subject: &Subject) -> Vec<Row> {
        let one = (BEFORE_PACKAGES + HEAD_BYTES + self.bytes).max(MTU_MIN);
        let mtu = if self.packs { WHOLE } else { u16::try_from(one).unwrap_or(WHOLE) };
        let ground = LanSegment::new(settings, &Network { mtu, quota: "64 MiB", ..UNPACED });
        let losses = Losses::default();
        let raw = Flow {
            bytes: self.bytes,
            messages: messages(settings),
            window: None,
            sender: End::Ping,
            sender_fifo: 50,
            cap: TURN,
            silence: KERNEL_SILENCE,
        };
        let beside = Flow { window: Some(WINDOW), silence: SILENCE, ..raw };
        let apart = Flow { sender: End::Pong, sender_fifo: SENDER_FIFO, ..beside };
        let ours = |ours: &Flow| {
            let (nodes, turn) = ground.turn()?;
            let [from, to] = [End::Ping, End::Pong].map(|end| nodes::bench(end, turn));
            flow(
                ours,
                || LanSource::open(&nodes.directory(End::Ping), from, to),
                || LanSink::open(&nodes.directory(End::Pong), to, self.bytes),
            )
        };
        let mut contenders = vec![
            losses.rated("rohrpost", 1, || ours(&apart)),
            losses.rated(BESIDE_ROUTER, 1, || ours(&beside)),
            losses
                .rated("udp", 1, || {
                    let open = |end| Datagrams::open(ground.wire()?, end);
                    flow(&raw, || open(End::Ping), || open(End::Pong)?.with_patience(LOOK))
                })
                .beside(at_least(self.bound), None),
        ];
        contenders.extend(cbware(self.bytes));
        let mut rows = compare(settings, subject, &contenders);
        rows.extend(losses.rows(subject));
        rows
    }
}

/// What CBWare reached with messages of this size, if its table says so.
pub(super) fn cbware(bytes: usize) -> Option<Contender<'static>> {
    let (_, rate) = CBWARE.into_iter().find(|(its, _)| *its == bytes)?;
    Some(Contender::fixed("CBWare, its table", Summary::single(rate)).beside(None, None))
}

fn messages(settings: &Settings) -> u64 {
    if settings.quick { settings.count(usize::MAX) as u64 } else { u64::MAX }
}

/// Loss of each contender in each turn, percent.
#[derive(Default)]
pub(super) struct Losses(RefCell<Vec<(&'static str, f64)>>);

impl Losses {
    /// `messages`: so many are one that is counted.
    pub(super) fn rated<'a>(
        &'a self,
        name: &'static str,
        messages: usize,
        turn: impl Fn() -> Result<Flown, Failure> + 'a,
    ) -> Contender<'a> {
        Contender::single(name, move || {
            let flown = turn()?;
            self.0.borrow_mut().push((name, flown.lost_percent()));
            Ok(flown.rate() / messages as f64)
        })
    }

    /// One for each contender that had a turn: the median over rounds, and the worst.
    pub(super) fn rows(&self, subject: &Subject) -> Vec<Row> {
        let losses = self.0.borrow();
        let of = |contender| losses.iter().filter(move |(name, _)| *name == contender).map(|(_, percent)| *percent);
        let row = |contender| {
            let summary = Summary { max: of(contender).reduce(f64::max), ..Summary::single(median(of(contender))?) };
            let subject = Subject { case: format!("{}, lost", subject.case), bytes: subject.bytes, unit: "%" };
            Some(Row::alone(subject, contender, Ok(summary)))
        };
        ["rohrpost", BESIDE_ROUTER, "udp"].into_iter().filter_map(row).collect()
    }
}
