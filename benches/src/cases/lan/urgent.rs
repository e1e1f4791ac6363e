//! An urgent package each millisecond, there and back over two routers, while a lower class sends as much as it can.
//!
//! ```text
//!  processor 0                                      processor 1
//!  urgent, FIFO 50: each ms ─┐                  ┌─▶ echo, FIFO 50
//!                            ├▶ router ═▶ router┤
//!  flooder (processor 1) ────┘      ◀═          └─▶ swamp (processor 0): takes what comes of the flood
//! ```
//! `urgent`: the routers send at the rate of an Ethernet of 100 Mbit/s, which two processors sustain.
//! `urgent-saturated`: at the default rate, which they do not sustain: then the path of the flood lacks processor time,
//! not that of the urgent packages.
//!
//! The flooder offers more than may leave: the router's mailbox is full of its packages, and so is
//! its quota of the queue; the excess is refused or lost there. No urgent package may be. Flooder and swamp run at
//! FIFO 10, above other programs and below all that is timed, each on the processor that the router of its node does
//! not use. The flooder pauses for 2 ms in 20, so that the kernel's fair server stays out; the queue outlasts the
//! pause.
//!
//! `urgent, replica`, `urgent-saturated, replica`: the same past a flood of a stream's records, twice as many as the
//! routers may send, to a node that has it as a replica. The flooder sleeps until the next is due.
//!
//! The floor, `udp`: sockets in the modules themselves, with a separate socket pair for the flood, at the rate of the
//! routers.

use super::ground::LanSegment;
use crate::lan::Wire;
use crate::lan::ends::{LanSink, LanSource};
use crate::lan::flow::{LOOK, Outlet};
use crate::lan::nodes::{self, Network, Nodes};
use crate::lan::records::{RecordInlet, RecordOutlet};
use crate::lan::udp::Datagrams;
use crate::one_way::Sink;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    Cell, Child, End, Failure, Gate, Pause, Placement, Scheduling, Shared, Zeroable, settle, time_two_processes,
};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use rohrpost_mailbox::{StreamShape, sys};
use std::cell::RefCell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const BYTES: usize = 64;
/// With the headers it fills a packet of 1500 B.
const FLOOD_BYTES: usize = 1_400;
const FLOOD_FIFO: u8 = 10;
const FLOOD: Duration = Duration::from_millis(18);
const LULL: Duration = Duration::from_millis(2);
const MESSAGES: usize = 1_000;
const WARM_UP: usize = 50;
const PACE: Duration = Duration::from_millis(1);
const CAP: Duration = Duration::from_secs(3);
/// Timeout of an urgent package; a later one counts as lost. No router delivers one that is so old.
const LOST_AFTER: Duration = Duration::from_secs(5);
const ENDS_WITHIN: Duration = Duration::from_secs(20);
const CARRIED: Network = Network { mtu: 1_500, rate: "10 MiB", quota: "256 KiB", sealed: false, records: None };
/// The default of users.
const USUAL: Network = Network { rate: "100 MiB", ..CARRIED };
/// Records that flood.
const RECORD_BYTES: usize = 62_000;
const RECORDS: StreamShape =
    StreamShape { record_bytes: RECORD_BYTES as u32, keep: 8, readers: 4, late: Duration::ZERO };
/// Port of the bare flood.
const FLOOD_PORT: u16 = 20_217;
/// Headers of a datagram on an Ethernet, with its gap.
const WIRE_BYTES: u64 = 66;

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    let urgent = |name, network: Network, mib_s: u64, records| {
        let case = Urgent { network: Network { records, ..network }, bytes_s: mib_s << 20 };
        Case::new(name, BYTES, "us", move |settings, subject| Ok(case.measure(settings, subject)))
    };
    vec![
        urgent("urgent", CARRIED, 10, None),
        urgent("urgent-saturated", USUAL, 100, None),
        urgent("urgent, replica", CARRIED, 10, Some(RECORDS)),
        urgent("urgent-saturated, replica", USUAL, 100, Some(RECORDS)),
    ]
}

struct Urgent {
    network: Network,
    /// The network's rate.
    bytes_s: u64,
}

impl Urgent {
    fn measure(&self, settings: &Settings, subject: &Subject) -> Vec<Row> {
        let ground = LanSegment::new(settings, &self.network);
        let hop = Cell::hop(BYTES, settings.count(MESSAGES));
        let cell = Cell { warm_up: hop.warm_up.min(WARM_UP), pause: Pause::Asleep(PACE), cap: CAP, ..hop };
        let floods = [RefCell::new(Vec::new()), RefCell::new(Vec::new())];
        let beside = |flood: Flooder, floods: &RefCell<Vec<_>>, samples: Result<Vec<f64>, Failure>| {
            let flooded = flood.end();
            let samples = samples?;
            floods.borrow_mut().push(flooded?);
            Ok(samples)
        };
        let udp = || ground.time_udp(&cell);
        let p99 = if self.network.records.is_some() { 2.0 } else { 3.0 };
        let contenders = [
            Contender::sampled("rohrpost", || {
                let (nodes, turn) = ground.turn()?;
                let flood = match self.network.records {
                    None => Flooder::over(nodes, turn)?,
                    Some(shape) => Flooder::of_records(nodes, shape, self.bytes_s)?,
                };
                beside(flood, &floods[0], urgent(nodes, turn, &cell))
            }),
            Contender::sampled("no flood", || {
                let (nodes, turn) = ground.turn()?;
                urgent(nodes, turn, &cell)
            })
            .beside(at_most(1.5), at_most(p99)),
            Contender::sampled("udp", || beside(Flooder::bare(ground.wire()?, self.bytes_s)?, &floods[1], udp()))
                .beside(None, None),
            Contender::sampled("udp, no flood", udp),
        ];
        let mut rows = compare(settings, subject, &contenders);
        let what = match self.network.records {
            None => ("packages/s", FLOOD_BYTES),
            Some(_) => ("records/s", RECORD_BYTES),
        };
        rows.extend(flood_rows(&subject.case, what, ["flood, taken", "flood, arrived"], &floods[0].borrow()));
        let (what, udp) = (("packages/s", FLOOD_BYTES), ["flood by udp, sent", "flood by udp, arrived"]);
        rows.extend(flood_rows(&subject.case, what, udp, &floods[1].borrow()));
        rows
    }
}

/// Half of each round trip, µs. A lost package fails the turn.
fn urgent(nodes: &Nodes, turn: u8, cell: &Cell) -> Result<Vec<f64>, Failure> {
    time_two_processes(cell, |end, meetings| {
        let module = nodes.module(end, turn, BYTES, meetings)?;
        // The far end waits for the first package while the near end still sleeps.
        Ok(if end == End::Ping { module.with_patience(LOST_AFTER) } else { module })
    })
}

/// Packages or records a second that the flooder sent, and that arrived.
#[derive(Clone, Copy)]
struct Flooded {
    sent: f64,
    received: f64,
}

#[repr(C)]
struct UrgentCounts {
    /// The mailbox to flood exists.
    swamp: Gate,
    /// The flood has begun.
    flooding: Gate,
    over: AtomicU64,
    sent: AtomicU64,
    received: AtomicU64,
}

// SAFETY: atomics only.
unsafe impl Zeroable for UrgentCounts {}

/// A flooder and the receiver of its flood, until they are ended or dropped.
struct Flooder {
    counts: Shared<UrgentCounts>,
    children: [Child; 2],
    began: Instant,
}

impl Flooder {
    /// From a module of the near node to a module of the far node.
    fn over(nodes: &Nodes, turn: u8) -> Result<Self, Failure> {
        let [from, to] = [End::Ping, End::Pong].map(|end| nodes::flood(end, turn));
        let sink = || LanSink::open(&nodes.directory(End::Pong), to, FLOOD_BYTES);
        let source = || {
            let mut source = LanSource::open(&nodes.directory(End::Ping), from, to)?;
            Ok(move |message: &[u8]| source.offer(message))
        };
        Self::start(FLOOD_BYTES, sink, source)
    }

    /// Of records of the near node's stream to a reader of its replica, twice as many as so many bytes a second are.
    fn of_records(nodes: &Nodes, shape: StreamShape, bytes_s: u64) -> Result<Self, Failure> {
        let origin = nodes::index(End::Ping);
        let each = Duration::from_secs_f64(RECORD_BYTES as f64 / (2 * bytes_s) as f64);
        let source = || {
            let mut inlet = RecordInlet::open(&nodes.directory(End::Ping), origin, shape)?;
            let mut due = Instant::now();
            Ok(move |message: &[u8]| {
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
                due = (due + each).max(Instant::now());
                inlet.send(message).map(|()| true)
            })
        };
        Self::start(RECORD_BYTES, || RecordOutlet::open(&nodes.directory(End::Pong), origin), source)
    }

    /// From socket to socket, at most at this rate.
    fn bare(wire: &Wire, bytes_s: u64) -> Result<Self, Failure> {
        let open = |end| Datagrams::between(wire, end, [FLOOD_PORT; 2]);
        let source = || {
            let mut socket = open(End::Ping)?;
            let (began, mut sent_bytes) = (Instant::now(), 0);
            Ok(move |message: &[u8]| {
                let may_bytes = (began.elapsed().as_secs_f64() * bytes_s as f64) as u64;
                // A short lull is made up for, since a router's queue outlasts one; a longer one is not.
                sent_bytes = may_bytes.saturating_sub((LULL.as_secs_f64() * bytes_s as f64) as u64).max(sent_bytes);
                let may = sent_bytes <= may_bytes;
                if may {
                    Sink::send(&mut socket, message)?;
                    sent_bytes += FLOOD_BYTES as u64 + WIRE_BYTES;
                }
                Ok(may)
            })
        };
        Self::start(FLOOD_BYTES, || open(End::Pong)?.with_patience(LOOK), source)
    }

    /// `sink` opens the receiving side. `source` opens the sending side and reports whether each package was accepted.
    fn start<O: Outlet, S: FnMut(&[u8]) -> Result<bool, Failure>>(
        bytes: usize,
        sink: impl FnOnce() -> Result<O, Failure>,
        source: impl FnOnce() -> Result<S, Failure>,
    ) -> Result<Self, Failure> {
        let counts = Shared::<UrgentCounts>::new()?;
        let swamp = Child::start(|| {
            let mut sink = sink()?;
            settle_low(End::Ping)?;
            counts.swamp.meet(2)?;
            let mut message = vec![0; bytes];
            while counts.over.load(Ordering::Acquire) == 0 {
                if sink.receive(&mut message)? {
                    counts.received.fetch_add(1, Ordering::AcqRel);
                }
            }
            Ok(())
        })?;
        let flooder = Child::start(|| {
            counts.swamp.meet(2)?;
            let mut offer = source()?;
            settle_low(End::Pong)?;
            counts.flooding.meet(2)?;
            let message = vec![7; bytes];
            let is_over = || counts.over.load(Ordering::Acquire) != 0;
            while !is_over() {
                let ends = Instant::now() + FLOOD;
                while Instant::now() < ends && !is_over() {
                    if offer(&message)? {
                        counts.sent.fetch_add(1, Ordering::AcqRel);
                    }
                }
                std::thread::sleep(LULL);
            }
            Ok(())
        })?;
        counts.flooding.meet(2)?;
        Ok(Self { counts, children: [flooder, swamp], began: Instant::now() })
    }

    /// Ends both, and reports the rates.
    fn end(self) -> Result<Flooded, Failure> {
        let seconds = self.began.elapsed().as_secs_f64();
        self.counts.over.store(1, Ordering::Release);
        let deadline = Instant::now() + ENDS_WITHIN;
        self.children.into_iter().try_for_each(|child| child.finish(deadline))?;
        let rate = |count: &AtomicU64| count.load(Ordering::Acquire) as f64 / seconds;
        let flooded = Flooded { sent: rate(&self.counts.sent), received: rate(&self.counts.received) };
        if flooded.received == 0.0 {
            return Err(Failure::Failed("nothing of the flood came".into()));
        }
        Ok(flooded)
    }
}

/// Above other programs, and below all that is timed.
fn settle_low(end: End) -> Result<(), Failure> {
    settle(end, Placement::TwoCores, Scheduling::Normal)?;
    // Refused, the environment says so.
    let _ = sys::schedule(sys::Scheduling::Fifo(FLOOD_FIFO));
    Ok(())
}

/// `unit` and `bytes` of what floods.
fn flood_rows(
    case: &str,
    (unit, bytes): (&'static str, usize),
    [sent, arrived]: [&'static str; 2],
    floods: &[Flooded],
) -> Vec<Row> {
    // What the router's mailbox, or the stream, took, and what arrived.
    let row = |contender, rate: fn(&Flooded) -> f64| {
        let median = rohrpost_bench_local::statistics::median(floods.iter().map(rate))?;
        let subject = Subject { case: case.into(), bytes: Some(bytes), unit };
        Some(Row::alone(subject, contender, Ok(Summary::single(median))))
    };
    [row(sent, |flood| flood.sent), row(arrived, |flood| flood.received)].into_iter().flatten().collect()
}
