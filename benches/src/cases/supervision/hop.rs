//! The floor: a package of 64 B from process to process, one way.

use crate::one_way::{OwnNode, Retry, Sink, Source, number_at, put_number};
use rohrpost_bench_local::harness::{
    Child, End, Failure, Gate, Placement, Samples, Scheduling, Shared, Zeroable, settle,
};
use rohrpost_mailbox::{OverflowPolicy, monotonic_ns};
use std::time::{Duration, Instant};

const BYTES: usize = 64;
const SLOTS: usize = 16;
const PRIORITY: u8 = 140;
/// The longest turn, with all that may halt it.
const PATIENCE: Duration = Duration::from_secs(120);

#[repr(C)]
struct HopTurn {
    gate: Gate,
    /// µs.
    samples: Samples,
}

// SAFETY: atomics only.
unsafe impl Zeroable for HopTurn {}

/// Sends so many packages from the processor of this end to the other, and gives µs of each until it is received.
/// `wait` waits before each, and gives the moment from which it counts, monotonic ns.
///
/// # Errors
/// What either end failed with.
pub(super) fn hops(count: usize, from: End, wait: impl Fn() -> u64) -> Result<Vec<f64>, Failure> {
    let (node, turn) = (OwnNode::new(SLOTS, BYTES, OverflowPolicy::Displace)?, Shared::<HopTurn>::new()?);
    let receiver = Child::start(|| {
        let mut source = node.source(false)?;
        settle(from.other(), Placement::TwoCores, Scheduling::Fifo)?;
        turn.gate.meet(2)?;
        let mut message = [0; BYTES];
        for _ in 0..count {
            source.receive(&mut message)?;
            let us = monotonic_ns().saturating_sub(number_at(&message, 0)) as f64 / 1000.0;
            turn.samples.push(us);
        }
        Ok(())
    })?;
    let sender = Child::start(|| {
        turn.gate.meet(2)?;
        let mut sink = node.sink(PRIORITY, Retry::Never)?;
        settle(from, Placement::TwoCores, Scheduling::Fifo)?;
        let mut message = [0; BYTES];
        for _ in 0..count {
            put_number(&mut message, wait());
            sink.send(&message)?;
        }
        Ok(())
    })?;
    let deadline = Instant::now() + PATIENCE;
    sender.finish(deadline)?;
    receiver.finish(deadline)?;
    Ok(turn.samples.all())
}
