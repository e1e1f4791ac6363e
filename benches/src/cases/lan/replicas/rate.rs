//! How many records go from node to node in a second, beside as many raw datagrams of the same size.
//!
//! ```text
//!  processor 0                   processor 1
//!  raw sender ════════════════▶ raw receiver
//!  router of the origin ══════▶ router of the replica ─▶ reader;  writer, a window of records at a time
//! ```
//! The writer has a window of records in flight, as a camera has that takes the next picture when one is through:
//! without one it would write over what has not left. Records are written whole and read in place.

use crate::cases::lan::ground::{LanSegment, replicating};
use crate::cases::lan::rates::{Losses, SENDER_FIFO, TURN, cbware};
use crate::lan::flow::{Flow, KERNEL_SILENCE, LOOK, SILENCE, flow};
use crate::lan::nodes::index;
use crate::lan::records::{RecordInlet, RecordOutlet};
use crate::lan::udp::{Datagrams, RawParts};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{End, Failure};
use rohrpost_bench_local::rounds::{Row, Subject, Target, Versus, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::StreamShape;
use rohrpost_routers::frame;
use std::time::Duration;

/// Bytes in flight, about, and records.
const WINDOW_BYTES: usize = 1 << 20;
const WINDOW_MIN: usize = 2;
const WINDOW_MAX: usize = 60;
/// Of a datagram that fills a packet of an Ethernet.
const DATAGRAM_BYTES: usize = 1_472;
const HEADS_BYTES: usize = frame::HEAD_BYTES + frame::RECORD_PART_HEAD_BYTES;
/// Bytes of a quick turn, about.
const QUICK_BYTES: usize = 16 << 20;

pub(super) fn cases() -> Vec<Box<dyn Case>> {
    let told = [2112, 5860, 15_236, 36_084].map(|bytes| ReplicaRate { bytes, bound: None });
    let measured = [62_000, 4 << 20].map(|bytes| ReplicaRate { bytes, bound: Some(Target::AtLeast(0.8)) });
    told.into_iter().chain(measured).map(|case| Box::new(case) as Box<dyn Case>).collect()
}

struct ReplicaRate {
    bytes: usize,
    /// Share of the raw datagrams' rate.
    bound: Option<Target>,
}

impl Case for ReplicaRate {
    fn name(&self) -> String {
        "replica, rate".into()
    }

    fn run(&self, settings: &Settings) -> Result<Vec<Row>, Failure> {
        let window = (WINDOW_BYTES / self.bytes).clamp(WINDOW_MIN, WINDOW_MAX);
        // Behind by half of the ring, a replica goes on with the newest.
        let (record_bytes, keep) = (self.bytes as u32, 4 * window as u32);
        let shape = StreamShape { record_bytes, keep, readers: 4, late: Duration::ZERO };
        let ground = LanSegment::new(settings, &replicating(shape));
        let parts = self.bytes.div_ceil(DATAGRAM_BYTES - HEADS_BYTES);
        let records = if settings.quick { (QUICK_BYTES / self.bytes).min(300) as u64 } else { u64::MAX };
        let ours = Flow {
            bytes: self.bytes,
            messages: records,
            window: Some(window as u64),
            sender: End::Pong,
            sender_fifo: SENDER_FIFO,
            cap: TURN,
            silence: SILENCE,
        };
        let raw = Flow {
            bytes: self.bytes.div_ceil(parts) + HEADS_BYTES,
            messages: records.saturating_mul(parts as u64),
            window: None,
            sender: End::Ping,
            sender_fifo: 50,
            silence: KERNEL_SILENCE,
            ..ours
        };
        let losses = Losses::default();
        let mut contenders = vec![
            losses.rated("rohrpost", || {
                let (nodes, _) = ground.turn()?;
                flow(
                    &ours,
                    || RecordInlet::open(&nodes.directory(End::Ping), index(End::Ping), shape),
                    || RecordOutlet::open(&nodes.directory(End::Pong), index(End::Ping)),
                )
            }),
            losses.rated_in("udp", parts, || {
                let open = |end| Datagrams::open(ground.wire()?, end);
                flow(
                    &raw,
                    || Ok(RawParts::new(open(End::Ping)?, self.bytes)),
                    || Ok(RawParts::new(open(End::Pong)?.with_patience(LOOK)?, self.bytes)),
                )
            }),
        ];
        contenders.extend(cbware(self.bytes));
        let bound = |name| self.bound.filter(|_| name == "udp");
        let versus: Vec<Versus> = contenders[1..]
            .iter()
            .map(|other| Versus { name: other.name, p50: bound(other.name), p99: None })
            .collect();
        let subject = Subject { case: self.name(), bytes: Some(self.bytes), unit: "records/s" };
        let mut rows = compare(settings, &subject, &contenders, &versus);
        rows.extend(losses.rows(&subject));
        Ok(rows)
    }
}
