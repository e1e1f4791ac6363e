//! An urgent package each millisecond, while a lower class keeps the mailbox full.
//!
//! ```text
//!  processor 0                                    processor 1
//!  flooder, FIFO 50: fills, 18 ms of each 20 ─┐
//!                                             ├─▶ receiver: urgent first, works 5 µs on each
//!  urgent, FIFO 60: one each ms, while full ──┘
//! ```
//! The flooder pauses for 2 ms in 20, so that the receiver sleeps now and then and the kernel's fair server stays out.
//! Only what was sent while the mailbox was full counts: from before the send until it has been copied out.

use crate::floors::ring::DEPTH;
use crate::floors::{Queue, QueueSink, TwoRings, TwoRingsReceiver, TwoRingsSender};
use crate::one_way::{OwnNode, Retry, Sink, Source};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    Child, End, Failure, Gate, Placement, Samples, Scheduling, Shared, Zeroable, settle,
};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::{OverflowPolicy, monotonic_ns, sys};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const BYTES: usize = 64;
const LOW: u8 = 10;
const URGENT: u8 = 200;
/// Above the flooder, on the same processor.
const URGENT_FIFO: u8 = 60;
const TICK: Duration = Duration::from_millis(1);
const WORK_NS: u64 = 5_000;
const FLOOD: Duration = Duration::from_millis(18);
const LULL: Duration = Duration::from_millis(2);
/// Sleep of a flooder after a refused package.
const REFUSED: Duration = Duration::from_micros(50);
const PATIENCE: Duration = Duration::from_secs(20);
/// Head of a message: when it was sent, or one of these.
const ORDINARY: u64 = 0;
const LAST: u64 = u64::MAX;

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    vec![Case::new("flood", BYTES, "us", measure)]
}

fn measure(settings: &Settings, subject: &Subject) -> Result<Vec<Row>, Failure> {
    let urgent = settings.count(1_000);
    // Where the urgent can be refused, as they are by no means under `displace` and `latest`, their sender tries
    // again.
    let ours = |full, states, room: Option<u64>| {
        move || {
            let ground = OwnNode::new(DEPTH, BYTES, full)?;
            let low = || Ok(ground.sink(LOW, Retry::Sleep(REFUSED))?.with_states(states));
            let high = || {
                Ok(ground.sink(URGENT, if room.is_some() { Retry::Spin(64) } else { Retry::Never })?.with_commands())
            };
            flood(urgent, room, high, low, || ground.source(false))
        }
    };
    let two_rings = Contender::sampled("two rings", || {
        let rings = Shared::<TwoRings>::new()?;
        let sink = |urgent| Ok(TwoRingsSender::new(&rings, urgent));
        flood(urgent, None, || sink(true), || sink(false), || Ok(TwoRingsReceiver::new(&rings)))
    });
    let queue = |priority: u32| {
        move || {
            let queue = Queue::new(DEPTH, BYTES)?;
            let sink = |priority| Ok(QueueSink::new(&queue, priority));
            flood(urgent, None, || sink(priority), || sink(0), || Ok(&queue))
        }
    };
    let contenders = [
        Contender::sampled("rohrpost", ours(OverflowPolicy::Displace, 1, None)),
        two_rings.beside(at_most(1.5), None),
        Contender::sampled("posix-mq", queue(1)).beside(None, at_most(1.5)),
        Contender::sampled("rohrpost, latest", ours(OverflowPolicy::Latest, 2 * DEPTH as u16, None)),
        // A contender that rejects packages has no room for urgent ones unless the flooder leaves some.
        Contender::sampled("rohrpost, reject, 8 left free", ours(OverflowPolicy::Reject, 1, Some(DEPTH as u64 - 8))),
        Contender::sampled("posix-mq, one priority", queue(0)),
    ];
    Ok(compare(settings, subject, &contenders))
}

#[repr(C)]
struct FloodTurn {
    gate: Gate,
    /// Ordinary packages sent and received.
    sent: AtomicU64,
    received: AtomicU64,
    /// Not 0: the mailbox is full after this many packages were sent without a pause.
    full: AtomicU64,
    /// Not 0: all urgent packages are sent.
    over: AtomicU64,
    samples: Samples,
}

// SAFETY: atomics only.
unsafe impl Zeroable for FloodTurn {}

/// Microseconds of each urgent message. With `room`, the flooder keeps that many ordinary messages in flight.
///
/// # Errors
/// When an urgent message is refused or lost; this error comes first.
fn flood<I: Sink, L: Sink, O: Source>(
    urgent: usize,
    room: Option<u64>,
    urgent_sink: impl Fn() -> Result<I, Failure>,
    low_sink: impl Fn() -> Result<L, Failure>,
    source: impl Fn() -> Result<O, Failure>,
) -> Result<Vec<f64>, Failure> {
    let turn = Shared::<FloodTurn>::new()?;
    let receiver = Child::start(|| {
        let mut source = source()?;
        settle(End::Pong, Placement::TwoCores, Scheduling::Fifo)?;
        turn.gate.meet(3)?;
        receive(&mut source, &turn)
    })?;
    let flooder = Child::start(|| {
        turn.gate.meet(3)?;
        let mut sink = low_sink()?;
        settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
        turn.gate.meet(5)?;
        send_low(&mut sink, &turn, room)
    })?;
    let sender = Child::start(|| {
        turn.gate.meet(3)?;
        let mut sink = urgent_sink()?;
        settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
        // If the kernel refuses, the environment line says so.
        let _ = sys::schedule(sys::Scheduling::Fifo(URGENT_FIFO));
        turn.gate.meet(5)?;
        send_urgent(&mut sink, &turn, urgent)
    })?;
    let deadline = Instant::now() + PATIENCE;
    sender.finish(deadline)?;
    flooder.finish(deadline)?;
    receiver.finish(deadline)?;
    if turn.samples.len() == urgent {
        return Ok(turn.samples.all());
    }
    Err(Failure::Failed(format!("of {urgent} urgent ones only {} came", turn.samples.len())))
}

fn send_urgent(sink: &mut impl Sink, turn: &FloodTurn, urgent: usize) -> Result<(), Failure> {
    let mut message = [0; BYTES];
    let mut sent = 0;
    while sent < urgent {
        std::thread::sleep(TICK);
        // A receiver that the kernel stops for long would find only urgent messages.
        let waiting = sent - turn.samples.len();
        if turn.full.load(Ordering::Acquire) == 0 || waiting > DEPTH / 2 {
            continue;
        }
        message[..8].copy_from_slice(&monotonic_ns().to_le_bytes());
        sink.send(&message)?;
        sent += 1;
    }
    turn.over.store(1, Ordering::Release);
    Ok(())
}

fn send_low(sink: &mut impl Sink, turn: &FloodTurn, room: Option<u64>) -> Result<(), Failure> {
    let mut message = [0; BYTES];
    message[..8].copy_from_slice(&ORDINARY.to_le_bytes());
    while turn.over.load(Ordering::Acquire) == 0 {
        let ends = Instant::now() + FLOOD;
        let mut burst = 0;
        while Instant::now() < ends && turn.over.load(Ordering::Acquire) == 0 {
            let sent = turn.sent.load(Ordering::Relaxed);
            if room.is_some_and(|room| sent - turn.received.load(Ordering::Acquire) >= room) {
                turn.full.store(1, Ordering::Release);
                std::thread::sleep(REFUSED);
                continue;
            }
            sink.send(&message)?;
            turn.sent.store(sent + 1, Ordering::Release);
            burst += 1;
            turn.full.store(u64::from(burst > 2 * DEPTH), Ordering::Release);
        }
        turn.full.store(0, Ordering::Release);
        std::thread::sleep(LULL);
    }
    message[..8].copy_from_slice(&LAST.to_le_bytes());
    sink.send(&message)
}

fn receive(source: &mut impl Source, turn: &FloodTurn) -> Result<(), Failure> {
    let mut message = [0; BYTES];
    loop {
        source.receive(&mut message)?;
        let now_ns = monotonic_ns();
        let mut sent_ns = [0; 8];
        sent_ns.copy_from_slice(&message[..8]);
        match u64::from_le_bytes(sent_ns) {
            LAST => return Ok(()),
            ORDINARY => drop(turn.received.fetch_add(1, Ordering::AcqRel)),
            sent_ns => turn.samples.push(now_ns.saturating_sub(sent_ns) as f64 / 1000.0),
        }
        while monotonic_ns() < now_ns + WORK_NS {}
    }
}
