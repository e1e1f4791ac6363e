//! What crosses the wire for ten readers of one replica on one node, beside what crosses it for one: each record once.

use crate::cases::lan::ground::LanSegment;
use crate::lan::flow::{FILLER, Outlet, SILENCE, checked};
use crate::lan::nodes::{Network, UNPACED, index};
use crate::lan::records::{RecordInlet, RecordOutlet};
use crate::lan::sent::Sent;
use crate::one_way::{Sink, put_number};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Child, End, Failure, Gate, Shared, Zeroable};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::{Summary, median};
use rohrpost_mailbox::StreamShape;
use std::cell::RefCell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const BYTES: usize = 62_000;
const READERS: u32 = 10;
const RECORDS: usize = 200;
/// With some seats to spare, since readers of the turn before may still be there.
const SHAPE: StreamShape = StreamShape { record_bytes: BYTES as u32, keep: 64, readers: 32, late: Duration::ZERO };
/// From one record to the next: a wire that keeps pace.
const EACH: Duration = Duration::from_millis(2);
/// Records in flight, at most: behind by half of the ring, a replica goes on with the newest.
const WINDOW: u64 = 16;
const _: () = assert!(2 * WINDOW <= SHAPE.keep as u64, "the window must fit into half of the ring");
const ENDS_WITHIN: Duration = Duration::from_secs(60);
/// Ours, and what is compared with it.
const ALL: &str = "rohrpost";
const ONE: &str = "one reader";
const ONCE: &str = "its bytes";

pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("replica, ten readers", BYTES, "B", replica_readers)]
}

fn replica_readers(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let ground = LanSegment::new(settings, &Network { records: Some(SHAPE), ..UNPACED });
    let records = settings.count(RECORDS) as u64;
    let packets = RefCell::new(Vec::new());
    let read_by = |contender, readers| {
        let (ground, packets) = (&ground, &packets);
        Contender::single(contender, move || {
            let sent = watch(ground, readers, records)?;
            packets.borrow_mut().push((contender, sent.packets as f64 / records as f64));
            Ok(sent.bytes as f64 / records as f64)
        })
    };
    let contenders = [
        read_by(ALL, READERS),
        // Descriptions and what routers say to each other are in both.
        read_by(ONE, 1).beside(at_most(1.02), None),
        Contender::fixed(ONCE, Summary::single(BYTES as f64)).beside(None, None),
    ];
    let mut rows = compare(settings, subject, &contenders);
    let packets = packets.borrow();
    rows.extend([ALL, ONE].into_iter().filter_map(|contender| {
        let own = packets.iter().filter(|(name, _)| *name == contender).map(|(_, packets)| *packets);
        let case = format!("{}, packets", subject.case);
        let subject = Subject { case, bytes: Some(BYTES), unit: "a record" };
        Some(Row::alone(subject, contender, Ok(Summary::single(median(own)?))))
    }));
    Ok(rows)
}

#[repr(C)]
struct Watched {
    gate: Gate,
    bytes: AtomicU64,
    packets: AtomicU64,
    /// Records that each reader has read.
    read: [AtomicU64; READERS as usize],
}

// SAFETY: atomics only.
unsafe impl Zeroable for Watched {}

/// What leaves the origin's node until so many readers of the replica have read all records.
fn watch(ground: &LanSegment, readers: u32, records: u64) -> Result<Sent, Failure> {
    let ((nodes, _), wire, watched) = (ground.turn()?, ground.wire()?, Shared::<Watched>::new()?);
    let (origin, all) = (index(End::Ping), readers + 1);
    let of = |count: &AtomicU64| count.load(Ordering::Acquire);
    // All meet before the first record and behind the last one.
    let reader = |reader: u32| {
        let mut outlet = RecordOutlet::open(&nodes.directory(End::Pong), origin)?;
        watched.gate.meet(all)?;
        let mut record = vec![0; BYTES];
        for due in 0..records {
            let since = Instant::now();
            while !outlet.receive(&mut record)? {
                if since.elapsed() > SILENCE {
                    return Err(Failure::Failed(format!("record {due} was due, and none came for {SILENCE:?}")));
                }
            }
            let came = checked(&record)?;
            if came != due {
                return Err(Failure::Failed(format!("record {due} was due, and {came} came")));
            }
            watched.read[reader as usize].store(due + 1, Ordering::Release);
        }
        watched.gate.meet(2 * all)
    };
    let writer = || {
        wire.enter(End::Ping)?;
        let mut inlet = RecordInlet::open(&nodes.directory(End::Ping), origin, SHAPE)?;
        watched.gate.meet(all)?;
        let (before, mut record) = (Sent::now()?, vec![FILLER; BYTES]);
        let slowest = || watched.read[..readers as usize].iter().map(of).min().unwrap_or(0);
        for number in 0..records {
            while number >= slowest() + WINDOW {
                std::thread::sleep(EACH);
            }
            put_number(&mut record, number);
            inlet.send(&record)?;
            std::thread::sleep(EACH);
        }
        watched.gate.meet(2 * all)?;
        let sent = Sent::now()?.since(before);
        watched.bytes.store(sent.bytes, Ordering::Release);
        watched.packets.store(sent.packets, Ordering::Release);
        Ok(())
    };
    let mut children =
        (0..readers).map(|number| Child::start(|| reader(number))).collect::<Result<Vec<_>, Failure>>()?;
    children.push(Child::start(writer)?);
    let deadline = Instant::now() + ENDS_WITHIN;
    children.into_iter().try_for_each(|child| child.finish(deadline))?;
    Ok(Sent { bytes: of(&watched.bytes), packets: of(&watched.packets) })
}
