//! Modules of declared flows, on each node: one process that publishes, and one that takes the packages of others.
//!
//! Each package is due somewhat later than its flow allows, and each flow drifts through the cycle at its own rate. So
//! each flow is published at all moments of the cycle, and sometimes all flows at once.

use super::capture::{STAMP_BYTES, STAMPED};
use super::plan::{Declared, Plan, ear};
use super::routers::Routers;
use super::stage::NODES;
use crate::lan::ends::{LanSink, LanSource};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, Gate, Shared, Zeroable, check_children};
use rohrpost_mailbox::{Name, monotonic_ns};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Extra time between packages, at least; a little more for further flows.
const DRIFT_US: u64 = 37;
/// Receivers poll this often.
const EAR_EACH: Duration = Duration::from_millis(1);
/// A package that has not arrived by then is lost.
const COMES_WITHIN: Duration = Duration::from_secs(2);

#[repr(C)]
struct TalkerCounts {
    gate: Gate,
    over: AtomicU64,
    ended: AtomicU64,
    published: AtomicU64,
    taken: AtomicU64,
}

// SAFETY: atomics only.
unsafe impl Zeroable for TalkerCounts {}

/// Runs until this is dropped.
pub struct Talkers {
    counts: Shared<TalkerCounts>,
    children: Vec<Child>,
}

/// How many packages there were.
#[derive(Clone, Copy, Debug)]
pub struct Talked {
    /// Published.
    pub published: u64,
    /// Of these, taken out of the mailboxes that they were for.
    pub taken: u64,
}

impl Talkers {
    /// Starts them.
    ///
    /// # Errors
    /// When a mailbox cannot be made.
    pub fn start(routers: &Routers<'_>, plan: &Plan) -> Result<Self, Failure> {
        let counts = Shared::<TalkerCounts>::new()?;
        let mut children = Vec::new();
        for node in 0..NODES {
            let directory = routers.directory(node);
            children.push(Child::start(|| listen(&directory, node, plan, &counts))?);
            children.push(Child::start(|| talk(&directory, node, plan, &counts))?);
        }
        counts.gate.meet_children(&mut children)?;
        Ok(Self { counts, children })
    }

    /// Ends the publishing, and waits for what is on its way.
    ///
    /// # Errors
    /// What one of them failed with.
    pub fn end(mut self) -> Result<Talked, Failure> {
        let count = |count: &AtomicU64| count.load(Ordering::Acquire);
        self.counts.over.store(1, Ordering::Release);
        let give_up = Instant::now() + COMES_WITHIN;
        let is_over = |counts: &TalkerCounts| {
            count(&counts.ended) == u64::from(NODES) && count(&counts.taken) >= count(&counts.published)
        };
        while !is_over(&self.counts) && Instant::now() < give_up {
            std::thread::sleep(EAR_EACH);
        }
        check_children(&mut self.children)?;
        Ok(Talked { published: count(&self.counts.published), taken: count(&self.counts.taken) })
    }
}

/// Takes all packages of declared flows.
fn listen(directory: &Path, node: u8, plan: &Plan, counts: &TalkerCounts) -> Result<(), Failure> {
    let largest = plan.flows.iter().map(|flow| flow.bytes).max().unwrap_or_default();
    let mut sink = LanSink::open(directory, ear(node), largest as usize)?;
    counts.gate.meet(ALL)?;
    loop {
        counts.taken.fetch_add(sink.drain(), Ordering::AcqRel);
        std::thread::sleep(EAR_EACH);
    }
}

/// All of them, and the process that starts them.
const ALL: u32 = 2 * NODES as u32 + 1;

/// A flow, and when its next package is due.
struct Due<'a> {
    flow: &'a Declared,
    source: LanSource,
    body: Vec<u8>,
    at_ns: u64,
    each_ns: u64,
}

impl<'a> Due<'a> {
    fn open(directory: &Path, flow: &'a Declared, node: u8, place: u64) -> Result<Self, Failure> {
        let (own, to): (Name, Name) = (flow.sender(node), flow.receiver(node));
        let source = LanSource::open(directory, own, to)?.of_type(STAMPED);
        // No two flows have the same rate, so that their moments meet in all combinations.
        let drift_us = DRIFT_US + 5 * (place + 3 * u64::from(node));
        let each_ns = (flow.period_us + drift_us) * 1000;
        Ok(Self { flow, source, body: vec![9; flow.bytes as usize], at_ns: monotonic_ns(), each_ns })
    }

    /// Publishes; the next one is due when the drift says, and never before the flow may.
    fn publish(&mut self) -> Result<bool, Failure> {
        let end = self.body.len() - STAMP_BYTES;
        let now_ns = monotonic_ns();
        self.body[end..].copy_from_slice(&now_ns.to_le_bytes());
        self.at_ns = (self.at_ns + self.each_ns).max(now_ns + self.flow.period_us * 1000);
        self.source.offer(&self.body)
    }
}

fn talk(directory: &Path, node: u8, plan: &Plan, counts: &TalkerCounts) -> Result<(), Failure> {
    let (ready, over) = (&counts.gate, &counts.over);
    let mut flows = Vec::new();
    for (flow, place) in plan.flows.iter().zip(0..) {
        flows.push(Due::open(directory, flow, node, place)?);
    }
    ready.meet(ALL)?;
    while over.load(Ordering::Acquire) == 0 {
        let Some(next) = flows.iter_mut().min_by_key(|due| due.at_ns) else { break };
        std::thread::sleep(Duration::from_nanos(next.at_ns.saturating_sub(monotonic_ns())));
        // Counted before, so that no package is taken before it is counted. A package that the router's mailbox refuses
        // is lost.
        counts.published.fetch_add(1, Ordering::AcqRel);
        next.publish()?;
    }
    counts.ended.fetch_add(1, Ordering::AcqRel);
    Ok(())
}
