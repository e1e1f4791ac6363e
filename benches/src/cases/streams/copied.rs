//! A record of 1 MiB copied in and copied out, beside two copies of as many bytes.
//!
//! One thread does both, so that nothing waits for another processor. Its two buffers are as near in the caches for
//! both contenders: one has just been filled, the other just been compared.

use crate::streams::{StreamNode, came, stamp};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    End, Failure, OrFail, Placement, Samples, Scheduling, fill, sample_in_child, settle,
};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::{StreamShape, monotonic_ns};
use std::hint::black_box;
use std::time::Duration;

const BYTES: usize = 1 << 20;
const SHAPE: StreamShape = StreamShape { record_bytes: BYTES as u32, keep: 2, readers: 1, late: Duration::ZERO };
/// Records of a turn, and those before them that do not count. Few enough to take less than 0.6 s, with filling and
/// comparing: see [`rohrpost_bench_local::harness::Cell::cap`].
const RECORDS: usize = 600;
const WARM_UP: usize = 60;
const PATIENCE: Duration = Duration::from_secs(60);

/// The case of this file.
pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("copied", BYTES, "us", copied_records)]
}

fn copied_records(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let records = settings.count(RECORDS);
    let ours = Contender::sampled("rohrpost", || {
        let node = StreamNode::new(SHAPE)?;
        sample_in_child(PATIENCE, |samples| through_stream(&node, records, samples))
    });
    let floor =
        Contender::sampled("two memcpy", || sample_in_child(PATIENCE, |samples| through_room(records, samples)));
    Ok(compare(settings, subject, &[ours, floor.beside(at_most(1.3), None)]))
}

fn through_stream(node: &StreamNode, records: usize, samples: &Samples) -> Result<(), Failure> {
    let (mut writer, mut reader) = (node.writer()?, node.reader()?);
    time_copies(records, samples, |message, copy| {
        let written = writer.write(stamp(writer.written()), message);
        written.or_fail("write")?;
        came(reader.try_next_into(copy)).map(drop)
    })
}

fn through_room(records: usize, samples: &Samples) -> Result<(), Failure> {
    let mut room = vec![0; BYTES];
    time_copies(records, samples, |message, copy| {
        room.copy_from_slice(message);
        // Else the compiler could leave it out.
        let room = black_box(&room);
        copy.clear();
        copy.extend_from_slice(room);
        Ok(())
    })
}

/// Microseconds that `pass` takes to bring a message into the copy, which must be the same.
fn time_copies(
    records: usize,
    samples: &Samples,
    mut pass: impl FnMut(&[u8], &mut Vec<u8>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let (mut message, mut copy) = (vec![0; BYTES], Vec::with_capacity(BYTES));
    settle(End::Ping, Placement::OneCore, Scheduling::Fifo)?;
    for number in 0..WARM_UP + records {
        fill(&mut message, number as u64);
        let began_ns = monotonic_ns();
        pass(&message, &mut copy)?;
        let took_ns = monotonic_ns() - began_ns;
        if copy != message {
            return Err(Failure::Failed(format!("record {number} is damaged")));
        }
        if number >= WARM_UP {
            samples.push(took_ns as f64 / 1000.0);
        }
    }
    Ok(())
}
