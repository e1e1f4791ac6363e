//! What writing a record costs its writer: with no reader, with some that look on their own, with some that sleep.
//!
//! ```text
//!  processor 0                          processor 1
//!  writer: write ─ pause ─ write …      readers that look: newest record ─ asleep for 100 µs ─ newest record …
//!          timed                        readers that sleep: woken by each write
//! ```
//! Only the writes are timed; the time of the clock reading itself is measured before and subtracted. Where readers
//! sleep, the writer pauses until all have read the record, and a while longer, so that each write wakes all of them.

use crate::floors::ring::CacheLine;
use crate::streams::{StreamNode, came, stamp, stream_failure};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    Child, CycleCounter, End, Failure, Gate, OrFail, Placement, Samples, Scheduling, Shared, Zeroable, fill, settle,
};
use rohrpost_bench_local::rounds::{Contender, Target, at_most, compare};
use rohrpost_mailbox::{RecordInfo, StreamReader, StreamShape, Waiting, monotonic_ns};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const BYTES: usize = 64;
const READERS: u32 = 8;
const SHAPE: StreamShape =
    StreamShape { record_bytes: BYTES as u32, keep: 64, readers: READERS as u16, late: Duration::ZERO };
const WARM_UP: usize = 200;
/// Writes for one figure, each with its own clock readings: some processors count in steps of 10 ns.
const GROUP: usize = 16;
/// Writes with sleeping readers: each takes them some ten microseconds.
const WRITES_ASLEEP: usize = 1_600;
/// A reader that looks on its own does so each time.
const LOOK_EACH: Duration = Duration::from_micros(100);
/// From when all have the record: by then they sleep again.
const ASLEEP_AFTER_NS: u64 = 20_000;
const PATIENCE: Duration = Duration::from_secs(20);
/// Number of the last record.
const LAST: u64 = u64::MAX;

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    vec![
        case("cost-of-write", 1_000, 64_000, at_most(1.3)),
        // All that readers have read has left the writer's caches by then.
        case("cost-of-write, paced", 100_000, 1_600, None),
    ]
}

/// What is beside the writer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Readers {
    None,
    Looking,
    Sleeping(u32),
}

impl Readers {
    fn count(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Looking => READERS,
            Self::Sleeping(readers) => readers,
        }
    }
}

/// `pause_ns`: between two writes.
fn case(name: &str, pause_ns: u64, writes: usize, bound: Option<Target>) -> Case {
    Case::new(name, BYTES, "ns", move |settings, subject| {
        let beside = |name, readers| {
            let writes = if let Readers::Sleeping(_) = readers { WRITES_ASLEEP } else { writes };
            Contender::sampled(name, move || cost(readers, pause_ns, settings.count(writes)))
        };
        let contenders = [
            beside("rohrpost", Readers::Looking),
            beside("no reader", Readers::None).beside(bound, None),
            beside("1 sleeps", Readers::Sleeping(1)),
            beside("8 sleep", Readers::Sleeping(READERS)),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}

#[repr(C)]
struct WriteTurn {
    gate: Gate,
    samples: Samples,
    /// Records that readers have read that sleep, all together.
    read: CacheLine<AtomicU64>,
}

// SAFETY: atomics only.
unsafe impl Zeroable for WriteTurn {}

/// Nanoseconds a write, one figure for each group of writes.
fn cost(readers: Readers, pause_ns: u64, writes: usize) -> Result<Vec<f64>, Failure> {
    let (node, turn) = (StreamNode::new(SHAPE)?, Shared::<WriteTurn>::new()?);
    let all = readers.count() + 1;
    let writer = Child::start(|| write_all(&node, &turn, readers, pause_ns, writes))?;
    let read = || {
        turn.gate.meet(all)?;
        let mut reader = node.reader()?;
        settle(End::Pong, Placement::TwoCores, Scheduling::Fifo)?;
        turn.gate.meet(2 * all)?;
        if readers == Readers::Looking { look(&mut reader) } else { read_all(&mut reader, &turn.read.0) }
    };
    let beside: Vec<Child> = (0..readers.count()).map(|_| Child::start(read)).collect::<Result<_, _>>()?;
    let deadline = Instant::now() + PATIENCE;
    writer.finish(deadline)?;
    beside.into_iter().try_for_each(|reader| reader.finish(deadline))?;
    Ok(turn.samples.all())
}

fn write_all(
    node: &StreamNode,
    turn: &WriteTurn,
    readers: Readers,
    pause_ns: u64,
    writes: usize,
) -> Result<(), Failure> {
    let all = readers.count() + 1;
    let mut writer = node.writer()?;
    turn.gate.meet(all)?;
    settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
    let clock = CycleCounter::calibrate();
    turn.gate.meet(2 * all)?;
    let (mut record, mut group_ns) = ([0; BYTES], 0.0);
    for number in 0..WARM_UP + writes {
        fill(&mut record, number as u64);
        let stamp = stamp(number as u64);
        let began = CycleCounter::now();
        let written = writer.write(stamp, &record);
        let ended = CycleCounter::now();
        written.or_fail("write")?;
        if number >= WARM_UP {
            group_ns += clock.ns(began, ended);
        }
        if number >= WARM_UP && (number + 1 - WARM_UP).is_multiple_of(GROUP) {
            turn.samples.push(std::mem::take(&mut group_ns) / GROUP as f64);
        }
        if let Readers::Sleeping(readers) = readers {
            await_read(&turn.read.0, (number as u64 + 1) * u64::from(readers))?;
        }
        let pause_ns = if let Readers::Sleeping(_) = readers { ASLEEP_AFTER_NS } else { pause_ns };
        let go_on_ns = monotonic_ns() + pause_ns;
        while monotonic_ns() < go_on_ns {}
    }
    fill(&mut record, LAST);
    let written = writer.write(stamp(writer.written()), &record);
    written.map(drop).or_fail("write")
}

/// Waits until so many records were read.
fn await_read(read: &AtomicU64, records: u64) -> Result<(), Failure> {
    let give_up_ns = monotonic_ns() + PATIENCE.as_nanos() as u64;
    while read.load(Ordering::Acquire) < records {
        if monotonic_ns() > give_up_ns {
            return Err(Failure::Failed(format!("not all of {records} records were read")));
        }
    }
    Ok(())
}

/// Copies the newest record now and then, until the last one.
fn look(reader: &mut StreamReader) -> Result<(), Failure> {
    let (mut body, mut newest) = (Vec::with_capacity(BYTES), 0);
    loop {
        // None before the first record, or when the writer turned the whole ring during each of some looks.
        if let Some(info) = reader.newest_into(&mut body).map_err(stream_failure)? {
            match checked(&body, &info)? {
                LAST => return Ok(()),
                number if number < newest => {
                    return Err(Failure::Failed(format!("record {number} is the newest after {newest}")));
                }
                number => newest = number,
            }
        }
        std::thread::sleep(LOOK_EACH);
    }
}

/// Sleeps until the next record comes, and copies it, until the last one. None may be missing.
fn read_all(reader: &mut StreamReader, read: &AtomicU64) -> Result<(), Failure> {
    let mut body = Vec::with_capacity(BYTES);
    for due in 0.. {
        let info = came(reader.next_timeout_into(&mut body, Waiting::default()))?;
        match checked(&body, &info)? {
            LAST => break,
            number if number != due => {
                return Err(Failure::Failed(format!("record {number} came when {due} was due")));
            }
            // ORDERING: Release; pairs with the load in `await_read`.
            _ => read.fetch_add(1, Ordering::Release),
        };
    }
    Ok(())
}

/// The number of a record, which must be whole and in its place.
fn checked(body: &[u8], info: &RecordInfo) -> Result<u64, Failure> {
    let number = body.first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
    let mut expected = [0; BYTES];
    fill(&mut expected, number);
    if body == expected && (number == LAST || number == info.sequence) {
        return Ok(number);
    }
    Err(Failure::Failed(format!("record {} is damaged", info.sequence)))
}
