//! Modules that always have packages for others, on each node: one process that floods the next node, and takes what it
//! is flooded with.

use super::plan::flood;
use super::routers::Routers;
use super::stage::NODES;
use crate::lan::ends::{LanSink, LanSource};
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, Gate, Shared};
use std::time::Duration;

/// Fills a datagram of 1500 bytes, all heads counted.
const BYTES: usize = 1_420;
/// More than slots carry: the queue outlasts a while without processor time for this process.
const BURST: usize = 4;
const EACH: Duration = Duration::from_millis(1);

/// Feeders of all nodes, until this is dropped.
pub struct Traffic {
    _feeders: Vec<Child>,
}

impl Traffic {
    /// Starts them.
    ///
    /// # Errors
    /// When a mailbox cannot be made.
    pub fn start(routers: &Routers<'_>) -> Result<Self, Failure> {
        let ready = Shared::<Gate>::new()?;
        let all = u32::from(NODES) + 1;
        let feeder = |node: u8| {
            Child::start(|| {
                let (directory, to) = (routers.directory(node), flood((node + 1) % NODES));
                let mut sink = LanSink::open(&directory, flood(node), BYTES)?;
                let mut source = LanSource::open(&directory, flood(node), to)?;
                ready.meet(all)?;
                let package = [7; BYTES];
                loop {
                    sink.drain();
                    let offered = (0..BURST).try_for_each(|_| source.offer(&package).map(drop));
                    // Its router is gone, and perhaps back.
                    if let (Err(_), Ok(again)) = (offered, LanSource::open(&directory, flood(node), to)) {
                        source = again;
                    }
                    std::thread::sleep(EACH);
                }
            })
        };
        let mut feeders = (0..NODES).map(feeder).collect::<Result<Vec<_>, Failure>>()?;
        ready.meet_children(&mut feeders)?;
        Ok(Self { _feeders: feeders })
    }
}
