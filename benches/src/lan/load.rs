//! Load that makes clocks and time slots hard to keep: busy processors, and a network full of foreign datagrams.

use super::udp::Datagrams;
use rohrpost_bench_local::harness::{Child, End, Failure, Link, Placement, Scheduling, settle};
use rohrpost_mailbox::monotonic_ns;
use std::time::Duration;

/// Datagrams of an ordinary network, about 40 000 a second.
const BYTES: usize = 1_400;
const BURST: usize = 40;
const EACH: Duration = Duration::from_millis(1);

/// Work on both processors, and datagrams from place to place, until it is dropped.
pub struct Load {
    _children: [Child; 4],
}

impl Load {
    /// Starts it. `from` and `to` open the ends of the flood, each in a process of its own.
    ///
    /// # Errors
    /// When there can be no further process.
    pub fn start(
        from: impl FnOnce() -> Result<Datagrams, Failure>,
        to: impl FnOnce() -> Result<Datagrams, Failure>,
    ) -> Result<Self, Failure> {
        let swamp = Child::start(|| {
            let mut datagrams = to()?;
            let mut message = vec![0; BYTES];
            loop {
                datagrams.receive(&mut message)?;
            }
        })?;
        let flooder = Child::start(|| {
            let mut datagrams = from()?;
            settle(End::Ping, Placement::TwoCores, Scheduling::Normal)?;
            let message = vec![7; BYTES];
            loop {
                for _ in 0..BURST {
                    // Refused until the swamp is ready.
                    let _ = datagrams.send(&message);
                }
                std::thread::sleep(EACH);
            }
        })?;
        Ok(Self { _children: [busy_loop()?, busy_loop()?, swamp, flooder] })
    }
}

/// An ordinary process that works until it is dropped.
///
/// # Errors
/// When there can be no further process.
pub fn busy_loop() -> Result<Child, Failure> {
    Child::start(|| {
        loop {
            std::hint::black_box(monotonic_ns());
        }
    })
}
