//! Processes that this one descends from, and those that descend from it.

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use std::fs;
use std::io;
use std::os::fd::{AsFd, FromRawFd, OwnedFd, RawFd};

/// So many parents of parents are asked for. Numbers that are given away meanwhile must not lead in a circle.
const GENERATIONS_MAX: usize = 64;

/// A descriptor of the process that has this number now; none when there is none.
pub(crate) fn pidfd(pid: u32) -> io::Result<Option<OwnedFd>> {
    let Ok(number) = libc::pid_t::try_from(pid) else { return Ok(None) };
    // SAFETY: takes numbers only.
    match Errno::result(unsafe { libc::syscall(libc::SYS_pidfd_open, number, 0) }) {
        // SAFETY: the kernel has just made it for us, and nobody else knows it.
        Ok(made) => Ok(Some(unsafe { OwnedFd::from_raw_fd(made as RawFd) })),
        // None, or a thread's.
        Err(Errno::ESRCH | Errno::EINVAL | Errno::ENOENT) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Whether the process of a pidfd has ended, also if its parent has not asked for that yet. Waits until it has, for so
/// long.
pub(crate) fn has_ended(pidfd: &OwnedFd, patience: PollTimeout) -> bool {
    poll(&mut [PollFd::new(pidfd.as_fd(), PollFlags::POLLIN)], patience).is_ok_and(|ready| ready > 0)
}

/// A process that this one descends from. If its number is given away, this is still the one before.
pub struct Ancestor(OwnedFd);

impl Ancestor {
    /// The ancestor of this number; none when that is none, or it has ended.
    ///
    /// # Errors
    /// When the kernel is older than 5.3.
    pub fn find(pid: u32) -> io::Result<Option<Self>> {
        // Opened first: a process that is found in the line afterwards is the one that was opened.
        let opened = pidfd(pid)?;
        Ok(opened.filter(|_| descends_from(std::process::id(), pid)).map(Self))
    }

    /// Waits until it has ended.
    pub fn wait_end(&self) {
        // A signal interrupts it.
        while !has_ended(&self.0, PollTimeout::NONE) {}
    }
}

/// Whether a process is a child, or a child of a child, of another one.
pub fn descends_from(pid: u32, ancestor: u32) -> bool {
    let line = std::iter::successors(parent_of(pid), |pid| parent_of(*pid));
    line.take(GENERATIONS_MAX).any(|parent| parent == ancestor)
}

/// The number behind the state, which follows the name in brackets; that may hold anything.
fn parent_of(pid: u32) -> Option<u32> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let (_, rest) = stat.rsplit_once(") ")?;
    rest.split(' ').nth(1)?.parse().ok().filter(|parent| *parent != 0)
}

/// The number of a child that has ended and was not waited for yet. It is not waited for here either: it stays a
/// zombie, and keeps its number. `pid`: that child alone, else any.
///
/// # Errors
/// When there is no such child.
pub fn ended_child(pid: Option<u32>) -> io::Result<Option<u32>> {
    let (kind, number) = pid.map_or((libc::P_ALL, 0), |pid| (libc::P_PID, pid));
    // SAFETY: numbers, for which zero is a value; the kernel leaves it so if no child has ended.
    let mut told: libc::siginfo_t = unsafe { std::mem::zeroed() };
    let options = libc::WEXITED | libc::WNOHANG | libc::WNOWAIT;
    // SAFETY: writes what it tells, which lives here.
    Errno::result(unsafe { libc::waitid(kind, number, &raw mut told, options) })?;
    // SAFETY: of a child the kernel tells its number there, else it is still zero.
    let ended = unsafe { told.si_pid() };
    Ok(u32::try_from(ended).ok().filter(|ended| *ended != 0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::signal::{Signal, kill};
    use nix::unistd::{Pid, getppid};
    use std::process::{Command, Stdio};

    #[test]
    fn a_line_of_parents_is_followed() {
        let own = std::process::id();
        // Two commands, so that the shell stays.
        let script = "sleep 600 & echo $!; wait";
        let mut shell = Command::new("sh").args(["-c", script]).stdout(Stdio::piped()).spawn().unwrap();
        let mut told = String::new();
        let mut out = io::BufReader::new(shell.stdout.take().unwrap());
        io::BufRead::read_line(&mut out, &mut told).unwrap();
        let below: u32 = told.trim().parse().unwrap();
        assert!(descends_from(below, shell.id()) && descends_from(below, own));
        assert!(!descends_from(own, below) && !descends_from(own, own), "nobody is below itself");
        assert!(Ancestor::find(below).unwrap().is_none());
        assert!(Ancestor::find(getppid().as_raw().cast_unsigned()).unwrap().is_some());
        assert!(Ancestor::find(u32::MAX).unwrap().is_none());
        let sleeps = pidfd(below).unwrap().unwrap();
        kill(Pid::from_raw(below.cast_signed()), Signal::SIGKILL).unwrap();
        Ancestor(sleeps).wait_end();
        shell.wait().unwrap();
    }

    #[test]
    fn a_child_that_ended_is_told_and_keeps_its_end() {
        let mut child = Command::new("sh").args(["-c", "exit 7"]).spawn().unwrap();
        let number = child.id();
        let told = loop {
            match ended_child(Some(number)).unwrap() {
                Some(told) => break told,
                None => std::thread::yield_now(),
            }
        };
        assert_eq!((told, ended_child(Some(number)).unwrap()), (number, Some(number)));
        assert!(ended_child(None).unwrap().is_some(), "it, or one of another test");
        assert_eq!(child.wait().unwrap().code(), Some(7));
        assert!(ended_child(Some(number)).is_err(), "there is no such child any more");
    }
}
