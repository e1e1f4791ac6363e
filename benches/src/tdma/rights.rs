//! What the routers' process may ask the kernel for.

use crate::Failure;
use nix::sys::resource::{Resource, setrlimit};
use std::io;

/// How a router may be scheduled.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Rights {
    /// As it likes: SCHED_DEADLINE, or SCHED_FIFO.
    RealTime,
    /// As any other process.
    Ordinary,
}

/// The capability of those who may schedule as they like, as `capabilities(7)` has it.
const CAP_SYS_NICE: libc::c_ulong = 23;

impl Rights {
    /// From now on the calling process, and what it executes, has these.
    ///
    /// # Errors
    /// When the kernel lets nobody drop rights.
    pub fn take(self) -> Result<(), Failure> {
        if self == Self::RealTime {
            return Ok(());
        }
        setrlimit(Resource::RLIMIT_RTPRIO, 0, 0).map_err(|error| Failure::of("limit of real-time priority", error))?;
        // SAFETY: changes what the process may have after an exec, and touches no memory.
        match unsafe { libc::prctl(libc::PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0) } {
            0 => Ok(()),
            _ => Err(Failure::of("drop of CAP_SYS_NICE", io::Error::last_os_error())),
        }
    }
}
