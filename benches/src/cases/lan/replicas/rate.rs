//! How many records go from node to node in a second, beside as many raw datagrams of the same size.
//!
//! ```text
//!  processor 0                   processor 1
//!  raw sender ════════════════▶ raw receiver
//!  router of the origin ══════▶ router of the replica ─▶ reader;  writer, a window of records at a time
//! ```
//! The writer has a window of records in flight, as a camera has that takes the next picture when one is through:
//! without one it would write over what has not left. Records are written whole and read in place.

use crate::cases::lan::ground::LanSegment;
use crate::cases::lan::rates::{Losses, SENDER_FIFO, TURN, cbware};
use crate::lan::flow::{Flow, KERNEL_SILENCE, LOOK, SILENCE, flow};
use crate::lan::nodes::{Network, UNPACED, index};
use crate::lan::records::{RecordInlet, RecordOutlet};
use crate::lan::udp::{Datagrams, RawParts};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::End;
use rohrpost_bench_local::rounds::{Row, Subject, Target, at_least, compare};
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

pub(super) fn cases() -> Vec<Case> {
    let told = [2112, 5860, 15_236, 36_084].map(|bytes| (bytes, None));
    let measured = [62_000, 4 << 20].map(|bytes| (bytes, at_least(0.8)));
    let case = |(bytes, bound)| {
        let measure = move |settings: &Settings, subject: &Subject| Ok(measure(settings, subject, bytes, bound));
        Case::new("replica, rate", bytes, "records/s", measure)
    };
    told.into_iter().chain(measured).map(case).collect()
}

/// `bound`: share of the raw datagrams' rate.
fn measure(settings: &Settings, subject: &Subject, bytes: usize, bound: Option<Target>) -> Vec<Row> {
    let window = (WINDOW_BYTES / bytes).clamp(WINDOW_MIN, WINDOW_MAX);
    // Behind by half of the ring, a replica goes on with the newest.
    let (record_bytes, keep) = (bytes as u32, 4 * window as u32);
    let shape = StreamShape { record_bytes, keep, readers: 4, late: Duration::ZERO };
    let ground = LanSegment::new(settings, &Network { records: Some(shape), ..UNPACED });
    let parts = bytes.div_ceil(DATAGRAM_BYTES - HEADS_BYTES);
    let records = if settings.quick { (QUICK_BYTES / bytes).min(300) as u64 } else { u64::MAX };
    let ours = Flow {
        bytes,
        messages: records,
        window: Some(window as u64),
        sender: End::Pong,
        sender_fifo: SENDER_FIFO,
        cap: TURN,
        silence: SILENCE,
    };
    let raw = Flow {
        bytes: bytes.div_ceil(parts) + HEADS_BYTES,
        messages: records.saturating_mul(parts as u64),
        window: None,
        sender: End::Ping,
        sender_fifo: 50,
        silence: KERNEL_SILENCE,
        ..ours
    };
    let losses = Losses::default();
    let mut contenders = vec![
        losses.rated("rohrpost", 1, || {
            let (nodes, _) = ground.turn()?;
            flow(
                &ours,
                || RecordInlet::open(&nodes.directory(End::Ping), index(End::Ping), shape),
                || RecordOutlet::open(&nodes.directory(End::Pong), index(End::Ping)),
            )
        }),
        losses
            .rated("udp", parts, || {
                let open = |end| Datagrams::open(ground.wire()?, end);
                flow(
                    &raw,
                    || Ok(RawParts::new(open(End::Ping)?, bytes)),
                    || Ok(RawParts::new(open(End::Pong)?.with_patience(LOOK)?, bytes)),
                )
            })
            .beside(bound, None),
    ];
    contenders.extend(cbware(bytes));
    let mut rows = compare(settings, subject, &contenders);
    rows.extend(losses.rows(subject));
    rows
}
