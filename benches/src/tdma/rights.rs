//! Scheduling that the routers' process may ask the kernel for.

use nix::sys::resource::{Resource, setrlimit};
use rohrpost_bench_local::{Failure, OrFail};
use std::io;

/// How a router may be scheduled.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Rights {
    /// Any: SCHED_DEADLINE, or SCHED_FIFO.
    RealTime,
    /// As any other process.
    Ordinary,
}

/// The capability to use any scheduling, as in `capabilities(7)`.
const CAP_SYS_NICE: libc::c_ulong = 23;

impl Rights {
    /// Sets the rights of the calling process, and of what it executes.
    ///
    /// # Errors
    /// When the kernel does not let it drop rights.
    pub fn take(self) -> Result<(), Failure> {
        if self == Self::RealTime {
            return Ok(());
        }
        setrlimit(Resource::RLIMIT_RTPRIO, 0, 0).or_fail("limit of real-time priority")?;
        // SAFETY: changes the rights after an exec, and touches no memory.
        match unsafe { libc::prctl(libc::PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0) } {
            0 => Ok(()),
            _ => Err(Failure::of("drop of CAP_SYS_NICE", io::Error::last_os_error())),
        }
    }
}
