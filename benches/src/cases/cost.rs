//! What one send costs its sender while the receiver is awake, on another processor.
//!
//! The receiver has taken everything before the clock starts, and polls for more. Only the sends are timed; the time of
//! the clock reading itself is measured before and subtracted.

use crate::floors::ring::DEPTH;
use crate::floors::vyukov::{QueueMemory, Vyukov};
use crate::floors::{SlotMemory, SlotReceiver, SlotSender};
use crate::one_way::{OwnNode, Retry, Sink, Source};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    Child, CycleCounter, End, Failure, Gate, Placement, Samples, Scheduling, Shared, Zeroable, settle,
};
use rohrpost_bench_local::rounds::{Contender, Versus, at_most, compare};
use rohrpost_mailbox::{OverflowPolicy, monotonic_ns};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const BYTES: usize = 64;
const WARM_UP: usize = 200;
/// Bursts for one figure, each with its own clock readings: some processors count in steps of 10 ns.
const GROUP: usize = 16;
/// From the receiver's last message to the next burst: by then the receiver polls again.
const PAUSE_NS: u64 = 400;
const PATIENCE: Duration = Duration::from_secs(15);

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    // The floor of one send includes what any queue with a sleeping receiver needs; the floor of many is the bare
    // queue.
    vec![case(1, 0, 1.3), case(16, 1, 2.0)]
}

/// So many packages sent in a row, beside one of the floors.
fn case(burst: usize, floor: usize, bound: f64) -> Case {
    Case::new(format!("cost-of-{burst}"), BYTES, "ns", move |settings, subject| {
        let bursts = settings.count(32_000) / burst + GROUP;
        let ours = Contender::sampled("rohrpost", || {
            let ground = OwnNode::new(DEPTH, BYTES, OverflowPolicy::Displace)?;
            cost(burst, bursts, || ground.sink(100, Retry::Never), || ground.source(true))
        });
        let mut floors = [
            Contender::sampled("Vyukov, wakeable", || vyukov::<true>(burst, bursts)),
            Contender::sampled("Vyukov", || vyukov::<false>(burst, bursts)),
        ];
        let versus = floors[floor].name;
        floors[floor].versus.push(Versus { name: versus, p50: at_most(bound), p99: None });
        let [wakeable, bare] = floors;
        let core = Contender::sampled("slot core", || {
            let memory = Shared::<SlotMemory>::new()?;
            let source = || Ok(SlotReceiver::new(&memory, BYTES));
            cost(burst, bursts, || Ok(SlotSender::new(&memory, BYTES, 100)), source)
        });
        Ok(compare(settings, subject, &[ours, wakeable, bare, core]))
    })
}

fn vyukov<const FENCED: bool>(burst: usize, bursts: usize) -> Result<Vec<f64>, Failure> {
    let memory = Shared::<QueueMemory>::new()?;
    let open = || Ok(Vyukov::<FENCED>::new(&memory, BYTES));
    open()?.format();
    cost(burst, bursts, open, open)
}

#[repr(C)]
struct CostTurn {
    gate: Gate,
    samples: Samples,
    /// Has cache lines of its own: the sender polls it.
    received: crate::floors::ring::CacheLine<AtomicU64>,
}

// SAFETY: atomics only.
unsafe impl Zeroable for CostTurn {}

/// Nanoseconds a send, one figure for each group of bursts.
fn cost<I: Sink, O: Source>(
    burst: usize,
    bursts: usize,
    sink: impl Fn() -> Result<I, Failure>,
    source: impl Fn() -> Result<O, Failure>,
) -> Result<Vec<f64>, Failure> {
    let turn = Shared::<CostTurn>::new()?;
    let all = (burst * (WARM_UP + bursts)) as u64;
    let receiver = Child::start(|| {
        let mut source = source()?;
        settle(End::Pong, Placement::TwoCores, Scheduling::Fifo)?;
        turn.gate.meet(2)?;
        turn.gate.meet(4)?;
        let mut message = [0; BYTES];
        for number in 1..=all {
            source.receive(&mut message)?;
            turn.received.0.store(number, Ordering::Release);
        }
        Ok(())
    })?;
    let sender = Child::start(|| {
        turn.gate.meet(2)?;
        let mut sink = sink()?;
        settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
        let clock = CycleCounter::calibrate();
        turn.gate.meet(4)?;
        let (mut sent, mut group_ns) = (0, 0.0);
        for number in 0..WARM_UP + bursts {
            let began = CycleCounter::now();
            for _ in 0..burst {
                sink.send(&[7; BYTES])?;
            }
            let took_ns = clock.ns(began, CycleCounter::now());
            if number >= WARM_UP {
                group_ns += took_ns;
            }
            if number >= WARM_UP && (number + 1 - WARM_UP).is_multiple_of(GROUP) {
                turn.samples.push(std::mem::take(&mut group_ns) / (GROUP * burst) as f64);
            }
            sent += burst as u64;
            await_received(&turn.received.0, sent)?;
        }
        Ok(())
    })?;
    let deadline = Instant::now() + PATIENCE;
    sender.finish(deadline)?;
    receiver.finish(deadline)?;
    Ok(turn.samples.all())
}

/// Waits until the receiver has everything, and a while longer.
fn await_received(received: &AtomicU64, sent: u64) -> Result<(), Failure> {
    let give_up = monotonic_ns() + PATIENCE.as_nanos() as u64;
    while received.load(Ordering::Acquire) < sent {
        if monotonic_ns() > give_up {
            return Err(Failure::Failed(format!("not all of {sent} packages came")));
        }
    }
    let go_on = monotonic_ns() + PAUSE_NS;
    while monotonic_ns() < go_on {}
    Ok(())
}
