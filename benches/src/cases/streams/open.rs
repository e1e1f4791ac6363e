//! A reader opens a stream of 512 MiB and has its newest record in hand, beside one of 1 MiB.
//!
//! Both have as many frames, so they differ in nothing but the size of a record. 16 bytes of it are read.

use crate::streams::{StreamNode, stamp, stream_failure};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    End, Failure, OrFail, Placement, Samples, Scheduling, fill, sample_in_child, settle,
};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::{StreamShape, monotonic_ns};
use std::time::Duration;

/// Of all frames of the stream.
const LARGE_BYTES: usize = 512 << 20;
const SMALL_BYTES: usize = 1 << 20;
/// One for each record that is kept, one for the reader, one to write.
const FRAMES: usize = 64;
const RECORDS: u64 = 3;
/// Times that it is opened in a turn.
const OPENINGS: usize = 300;
/// Bytes of a record that are written and read.
const TOUCHED: usize = 16;
const PATIENCE: Duration = Duration::from_secs(60);

/// The case of this file.
pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("open", LARGE_BYTES, "us", first_record)]
}

fn first_record(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let openings = settings.count(OPENINGS);
    let opened = |name, bytes| {
        let (record_bytes, keep) = ((bytes / FRAMES) as u32, FRAMES as u32 - 2);
        let shape = StreamShape { record_bytes, keep, readers: 1, late: Duration::ZERO };
        Contender::sampled(name, move || {
            let node = StreamNode::new(shape)?;
            sample_in_child(PATIENCE, |samples| open_often(&node, openings, samples))
        })
    };
    let small = opened("1 MiB", SMALL_BYTES).beside(at_most(2.0), None);
    Ok(compare(settings, subject, &[opened("rohrpost", LARGE_BYTES), small]))
}

fn open_often(node: &StreamNode, openings: usize, samples: &Samples) -> Result<(), Failure> {
    // Before the stream is there: all that this process has by then is locked.
    settle(End::Ping, Placement::OneCore, Scheduling::Fifo)?;
    let mut writer = node.writer()?;
    let record_bytes = writer.shape().record_bytes as usize;
    let mut head = [0; TOUCHED];
    for number in 0..RECORDS {
        fill(&mut head, number);
        let mut record = writer.begin(stamp(number)).or_fail("begin")?;
        record.body_mut()[..TOUCHED].copy_from_slice(&head);
        record.finish(record_bytes).or_fail("finish")?;
    }
    let open = node.readers()?;
    for _ in 0..openings {
        let began_ns = monotonic_ns();
        let mut reader = open()?;
        let record = reader.newest().map_err(stream_failure)?;
        let record = record.ok_or_else(|| Failure::Failed("the records are not there".into()))?;
        let read: Option<[u8; TOUCHED]> = record.body().first_chunk().copied();
        let took_ns = monotonic_ns() - began_ns;
        if read != Some(head) || record.body().len() != record_bytes {
            return Err(Failure::Failed(format!("the newest record begins with {read:?}, not {head:?}")));
        }
        samples.push(took_ns as f64 / 1000.0);
    }
    Ok(())
}
