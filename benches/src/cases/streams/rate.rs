//! Records a second, from a writer to a reader that spins, with nothing lost.

use crate::floors::ring::{BareRing, DEPTH, RingReceiver, RingSender, SharedRing};
use crate::one_way::{Stream, rate};
use crate::streams::{Progress, RecordSink, RecordSource, StreamNode};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, Scheduling, Shared};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_least, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::StreamShape;
use std::time::Duration;

const BYTES: usize = 64;
/// Long enough for some hundred thousand records, short enough that the kernel's fair server stays out.
const TURN: Duration = Duration::from_millis(500);

/// The case of this file.
pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("rate", BYTES, "records/s", record_rate)]
}

fn record_rate(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let messages = if settings.quick { settings.count(usize::MAX) as u64 } else { u64::MAX };
    let stream = Stream { bytes: BYTES, messages, senders: 1, scheduling: Scheduling::Fifo, cap: TURN };
    let ours = Contender::single("rohrpost", || through_stream(&stream));
    let floor = Contender::single("ring", || {
        let ring = Shared::<SharedRing>::new()?;
        let sink = |_| Ok(BareRing::<RingSender>::sender(&ring));
        rate(&stream, sink, || Ok(BareRing::<RingReceiver>::receiver(&ring)))
    });
    Ok(compare(settings, subject, &[ours, floor.beside(at_least(0.5), None)]))
}

fn through_stream(stream: &Stream) -> Result<f64, Failure> {
    let shape = StreamShape { record_bytes: BYTES as u32, keep: DEPTH as u32, readers: 1, late: Duration::ZERO };
    let (node, progress) = (StreamNode::new(shape)?, Shared::<Progress>::new()?);
    rate(stream, |_| RecordSink::open(&node, &progress), || RecordSource::open(&node, BYTES, &progress))
}
