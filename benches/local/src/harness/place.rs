//! Where a process runs and how it is scheduled.

use super::Failure;
use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::unistd::Pid;
use rohrpost_mailbox::sys;

/// SCHED_FIFO priority of everything that is timed: above ordinary work, below the kernel's own threads.
const PRIORITY: u8 = 50;

/// Which of the two ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// Sends first, and measures.
    Ping,
    /// Sends back what it receives.
    Pong,
}

impl End {
    /// The end that this one talks to.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Ping => Self::Pong,
            Self::Pong => Self::Ping,
        }
    }

    /// Index in what both share: 0 of the near end, 1 of the far one.
    pub fn index(self) -> usize {
        usize::from(self == Self::Pong)
    }

    /// Name of the node at this end of a network.
    pub fn node(self) -> &'static str {
        if self == Self::Ping { "near" } else { "far" }
    }
}

/// Which processors the two ends have.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Placement {
    /// The one that asks on the first processor that this program may use, the one that answers on the second.
    TwoCores,
    /// Both on the first.
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

/// The processors that this program may use.
pub fn processors() -> Vec<usize> {
    let allowed = sched_getaffinity(Pid::from_raw(0)).unwrap_or_default();
    (0..CpuSet::count()).filter(|processor| allowed.is_set(*processor) == Ok(true)).collect()
}

/// Places and schedules the calling process, and keeps its memory from being paged out. Where the kernel refuses, it
/// goes on as it is: [`crate::environment`] asks beforehand, and says so.
///
/// # Errors
/// [`Failure::Skipped`] when there are too few processors.
pub fn settle(end: End, placement: Placement, scheduling: Scheduling) -> Result<(), Failure> {
    let at = usize::from(placement == Placement::TwoCores && end == End::Pong);
    let processors = processors();
    // Without a second processor, neither end may go on alone.
    let needed = if placement == Placement::TwoCores { 2 } else { 1 };
    let (Some(processor), true) = (processors.get(at), processors.len() >= needed) else {
        return Err(Failure::Skipped(format!("needs {needed} processors, this program may use {}", processors.len())));
    };
    let _ = pin(*processor);
    let _ = mlockall(MlockAllFlags::MCL_CURRENT);
    if scheduling == Scheduling::Fifo {
        let _ = sys::schedule(sys::Scheduling::Fifo(PRIORITY));
    }
    Ok(())
}

fn pin(processor: usize) -> nix::Result<()> {
    let mut set = CpuSet::new();
    set.set(processor)?;
    sched_setaffinity(Pid::from_raw(0), &set)
}

/// What the kernel refuses of what the cases ask for; empty when nothing. Changes the calling process: ask in a child.
pub fn refusals() -> Vec<String> {
    let mut refused = Vec::new();
    for processor in processors().into_iter().take(2) {
        if let Err(error) = pin(processor) {
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
