//! What the kernel is asked for a process: its scheduling and its memory. A refusal is told, not fatal.

use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use nix::sys::statvfs::statvfs;
use std::io;
use std::path::Path;

/// How a process is scheduled.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scheduling {
    /// SCHED_FIFO with this priority, 1 (least) to 99.
    Fifo(u8),
    /// The normal scheduler with this niceness, -20 (most) to 19.
    Normal(i8),
}

/// A FIFO process that runs for so long without sleeping is ended by the kernel (RLIMIT_RTTIME), µs.
const RUNAWAY_US: u64 = 2_000_000;

/// Schedules the calling thread, and the threads that it starts from now on.
///
/// # Errors
/// Mostly EPERM: no right to real-time scheduling (`ulimit -r`, CAP_SYS_NICE).
pub fn schedule(how: Scheduling) -> io::Result<()> {
    match how {
        Scheduling::Fifo(priority) => {
            // A runaway must not take the computer with it. Only ever lowered, so it cannot be refused.
            let (soft, hard) = getrlimit(Resource::RLIMIT_RTTIME)?;
            setrlimit(Resource::RLIMIT_RTTIME, RUNAWAY_US.min(soft), hard)?;
            let parameters = libc::sched_param { sched_priority: i32::from(priority.clamp(1, 99)) };
            // SAFETY: reads the parameters, which live here; 0 is the calling thread.
            check(unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) })
        }
        Scheduling::Normal(nice) => {
            // SAFETY: takes numbers only; 0 is the calling process.
            check(unsafe { libc::setpriority(libc::PRIO_PROCESS, 0, i32::from(nice)) })
        }
    }
}

/// How the calling thread is scheduled.
///
/// # Errors
/// When the kernel does not say.
pub fn scheduling() -> io::Result<Scheduling> {
    scheduling_of(0)
}

/// How the main thread of a process is scheduled; 0 is the caller.
///
/// # Errors
/// When there is no such process.
pub fn scheduling_of(pid: u32) -> io::Result<Scheduling> {
    let pid = libc::pid_t::try_from(pid).map_err(|_| io::ErrorKind::InvalidInput)?;
    let mut parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: takes a number only.
    let policy = unsafe { libc::sched_getscheduler(pid) };
    check(policy.min(0))?;
    // SAFETY: writes the parameters, which live here.
    check(unsafe { libc::sched_getparam(pid, &raw mut parameters) })?;
    if policy & !libc::SCHED_RESET_ON_FORK == libc::SCHED_FIFO {
        return Ok(Scheduling::Fifo(parameters.sched_priority.clamp(0, 99) as u8));
    }
    // SAFETY: takes numbers only. -1 may be a niceness; an unknown process was refused above.
    Ok(Scheduling::Normal(unsafe { libc::getpriority(libc::PRIO_PROCESS, pid as libc::id_t) } as i8))
}

/// Keeps the process's memory from being paged out, now and later, if the memlock limit has room for all it may need.
/// False when it has not: with a small limit, later allocations would fail instead of being paged.
///
/// # Errors
/// When the kernel refuses all the same.
pub fn lock_memory() -> io::Result<bool> {
    let (soft, _) = getrlimit(Resource::RLIMIT_MEMLOCK)?;
    if soft != nix::libc::RLIM_INFINITY {
        return Ok(false);
    }
    mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE)?;
    Ok(true)
}

/// Room of a file system, bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Room {
    /// All in all.
    pub bytes: u64,
    /// What this user may still take.
    pub free: u64,
}

/// Room of the file system that a path is on.
///
/// # Errors
/// When there is no such path.
pub fn room(path: &Path) -> io::Result<Room> {
    let told = statvfs(path)?;
    Ok(Room { bytes: told.blocks() * told.fragment_size(), free: told.blocks_available() * told.fragment_size() })
}

fn check(result: i32) -> io::Result<()> {
    if result < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}
