//! Where a process runs and how it is scheduled.

use super::{End, Failure};
use nix::sched::{CpuSet, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::unistd::Pid;
use rohrpost_mailbox::sys;

/// SCHED_FIFO priority of everything that is timed: above ordinary work, below the kernel's own threads.
const PRIORITY: u8 = 50;

/// Which processors the two ends have.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Placement {
    /// The one that asks on processor 0, the one that answers on 1.
    TwoCores,
    /// Both on processor 0.
    OneCore,
}

/// How both ends are scheduled.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scheduling {
    /// SCHED_FIFO 50.
    Fifo,
    /// Like any other process.
    Normal,
}

/// Places and schedules the calling process, and keeps its memory from being paged out. Where the kernel refuses, it goes
/// on as it is: [`crate::environment`] asks beforehand, and says so.
///
/// # Errors
/// Never for a refusal; only when there is no such processor to name.
pub fn settle(end: End, placement: Placement, scheduling: Scheduling) -> Result<(), Failure> {
    let processor = match (placement, end) {
        (Placement::TwoCores, End::Pong) => 1,
        _ => 0,
    };
    let mut set = CpuSet::new();
    set.set(processor).map_err(|error| Failure::of("processor", error))?;
    let _ = sched_setaffinity(Pid::from_raw(0), &set);
    let _ = mlockall(MlockAllFlags::MCL_CURRENT);
    if scheduling == Scheduling::Fifo {
        let _ = sys::schedule(sys::Scheduling::Fifo(PRIORITY));
    }
    Ok(())
}

/// What the kernel refuses of what the cases ask for; empty when nothing. Changes the calling process: ask in a child.
pub fn refusals() -> Vec<String> {
    let mut refused = Vec::new();
    for processor in [0, 1] {
        let mut set = CpuSet::new();
        let pinned = set.set(processor).and_then(|()| sched_setaffinity(Pid::from_raw(0), &set));
        if let Err(error) = pinned {
            refused.push(format!("processor {processor}: {error}"));
        }
    }
    if let Err(error) = sys::schedule(sys::Scheduling::Fifo(PRIORITY)) {
        refused.push(format!("SCHED_FIFO: {error}"));
    }
    if let Err(error) = mlockall(MlockAllFlags::MCL_CURRENT) {
        refused.push(format!("locked memory: {error}"));
    }
    refused
}
