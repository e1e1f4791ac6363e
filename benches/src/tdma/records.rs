//! Streams of all nodes, each with a replica on the next: written faster than slots carry them, and read.

use super::plan::replica_of;
use super::routers::Routers;
use super::stage::NODES;
use crate::lan::flow::{FILLER, Outlet, checked};
use crate::lan::records::{self, RecordInlet, RecordOutlet};
use crate::one_way::{Sink, put_number};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, Gate, Shared, Zeroable, check_children};
use rohrpost_mailbox::StreamShape;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// All writers and readers, and the process that starts them.
const ALL: u32 = 2 * NODES as u32 + 1;

#[repr(C)]
struct RecordCounts {
    gate: Gate,
    /// Records that each node has read.
    read: [AtomicU64; NODES as usize],
}

// SAFETY: atomics only.
unsafe impl Zeroable for RecordCounts {}

/// Writers and readers, until this is dropped.
pub struct RecordTraffic {
    counts: Shared<RecordCounts>,
    children: Vec<Child>,
}

impl RecordTraffic {
    /// Starts them: each writer has a record of full size so often.
    ///
    /// # Errors
    /// When a replica does not begin.
    pub fn start(routers: &Routers<'_>, shape: StreamShape, each: Duration) -> Result<Self, Failure> {
        let counts = Shared::<RecordCounts>::new()?;
        let (mut children, bytes) = (Vec::new(), shape.record_bytes as usize);
        for node in 0..NODES {
            let (from, to) = (routers.directory(node), routers.directory(replica_of(node)));
            records::begin(&from, &to, node, shape)?;
            children.push(Child::start(|| {
                let (mut outlet, mut record) = (RecordOutlet::open(&to, node)?, vec![0; bytes]);
                counts.gate.meet(ALL)?;
                loop {
                    if outlet.receive(&mut record)? {
                        checked(&record)?;
                        counts.read[usize::from(node)].fetch_add(1, Ordering::AcqRel);
                    }
                }
            })?);
            children.push(Child::start(|| {
                let (mut inlet, mut record) = (RecordInlet::open(&from, node, shape)?, vec![FILLER; bytes]);
                counts.gate.meet(ALL)?;
                for number in 0.. {
                    put_number(&mut record, number);
                    inlet.send(&record)?;
                    std::thread::sleep(each);
                }
                Ok(())
            })?);
        }
        counts.gate.meet_children(&mut children)?;
        Ok(Self { counts, children })
    }

    /// Records that came whole so far: of the stream of each node.
    ///
    /// # Errors
    /// What one of the processes failed with.
    pub fn came(&mut self) -> Result<[u64; NODES as usize], Failure> {
        check_children(&mut self.children)?;
        Ok(self.counts.read.each_ref().map(|read| read.load(Ordering::Acquire)))
    }
}
