//! The two records around a time, beside binary search in a vector of stamps.
//!
//! Times are random, the same for all that search among as many stamps. What is found is checked: the sum over a group
//! is computed beforehand.

use crate::streams::{StreamNode, stream_failure};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    CycleCounter, End, Failure, OrFail, Placement, Samples, Scheduling, sample_in_child, settle,
};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::{Around, Stamp, StreamShape};
use std::hint::black_box;
use std::time::Duration;

const MANY: usize = 100_000;
const FEW: usize = 1_000;
/// Times of a turn; as many before them do not count.
const TIMES: usize = 20_000;
/// Times for one figure: reading the clock takes as long as some comparisons.
const GROUP: usize = 16;
const EPOCH: u64 = 1;
const PATIENCE: Duration = Duration::from_secs(60);

/// The case of this file.
pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("around", None, "ns", around_time)]
}

fn around_time(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let times = settings.count(TIMES);
    let ours = |name, records| {
        let shape = StreamShape { record_bytes: 8, keep: records as u32, readers: 1, late: Duration::ZERO };
        Contender::sampled(name, move || {
            let node = StreamNode::new(shape)?;
            sample_in_child(PATIENCE, |samples| in_stream(&node, records, times, samples))
        })
    };
    let floor =
        Contender::sampled("binary search", || sample_in_child(PATIENCE, |samples| in_vector(MANY, times, samples)));
    let few = ours("1000 records", FEW).beside(at_most(2.5), None);
    Ok(compare(settings, subject, &[ours("rohrpost", MANY), floor.beside(at_most(3.0), None), few]))
}

/// Looks in a stream that keeps all its records.
fn in_stream(node: &StreamNode, records: usize, times: usize, samples: &Samples) -> Result<(), Failure> {
    let stamps = stamps(records);
    let (mut writer, mut reader) = (node.writer()?, node.reader()?);
    for ns in &stamps {
        writer.write(Stamp { epoch: EPOCH, ns: *ns }, &ns.to_le_bytes()).or_fail("write")?;
    }
    time_lookups(&stamps, times, samples, |ns| match reader.around(Stamp { epoch: EPOCH, ns }) {
        Ok(Around::Records { before, after }) => Ok((before.stamp.ns, after.stamp.ns)),
        Ok(other) => Err(Failure::Failed(format!("around {ns} ns: {other:?}"))),
        Err(error) => Err(stream_failure(error)),
    })
}

fn in_vector(records: usize, times: usize, samples: &Samples) -> Result<(), Failure> {
    let stamps = stamps(records);
    time_lookups(&stamps, times, samples, |ns| Ok(search(black_box(&stamps), ns)))
}

/// The stamps around a time that is neither before the first nor after the last; both are the same if there is this
/// one.
fn search(stamps: &[u64], ns: u64) -> (u64, u64) {
    let after = stamps.partition_point(|stamp_ns| *stamp_ns < ns);
    let after_ns = stamps[after];
    (if after_ns == ns { ns } else { stamps[after - 1] }, after_ns)
}

/// Nanoseconds a lookup, one figure for each group of lookups.
fn time_lookups(
    stamps: &[u64],
    times: usize,
    samples: &Samples,
    mut find: impl FnMut(u64) -> Result<(u64, u64), Failure>,
) -> Result<(), Failure> {
    let times = times_within(stamps, times);
    let sum = |sum: u64, (before, after): (u64, u64)| sum.wrapping_mul(31).wrapping_add(before ^ (after << 1));
    let all_expected: Vec<u64> = times
        .chunks_exact(GROUP)
        .map(|group| group.iter().fold(0, |so_far, ns| sum(so_far, search(stamps, *ns))))
        .collect();
    settle(End::Ping, Placement::OneCore, Scheduling::Fifo)?;
    let clock = CycleCounter::calibrate();
    for counts in [false, true] {
        for (group, expected) in times.chunks_exact(GROUP).zip(&all_expected) {
            let mut found = 0;
            let began = CycleCounter::now();
            for ns in group {
                found = sum(found, find(*ns)?);
            }
            let ended = CycleCounter::now();
            if found != *expected {
                return Err(Failure::Failed(format!("wrong records around one of the times {group:?}")));
            }
            if counts {
                samples.push(clock.ns(began, ended) / GROUP as f64);
            }
        }
    }
    Ok(())
}

/// Stamps half a microsecond to one and a half apart, as a producer that is not quite regular has them.
fn stamps(records: usize) -> Vec<u64> {
    let mut random = Random::new();
    let mut ns = 0;
    let stamps = (0..records).map(|_| {
        ns += 500 + random.below(1_001);
        ns
    });
    stamps.collect()
}

/// Random times from the first stamp to the last.
fn times_within(stamps: &[u64], times: usize) -> Vec<u64> {
    let (Some(first), Some(last)) = (stamps.first(), stamps.last()) else { return Vec::new() };
    let mut random = Random::new();
    (0..times).map(|_| first + random.below(last - first + 1)).collect()
}

/// The same numbers in each run: xorshift64.
struct Random(u64);

impl Random {
    fn new() -> Self {
        Self(0x9e37_79b9_7f4a_7c15)
    }

    fn below(&mut self, bound: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % bound
    }
}
