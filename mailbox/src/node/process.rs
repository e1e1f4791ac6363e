//! The process of a participant, known by more than its number.
//!
//! A number means a process in one pid namespace, and until that ends. A container that shares the node's directory
//! (`docker run --ipc=host`) has numbers of its own, and the kernel gives a number away again. So the number in a
//! node's table only says where to look. The proof is the lock on the participant's byte of the file `node` (`lock`):
//! the kernel says which process holds it. A pidfd keeps that process, so a signal reaches it or nobody.
//!
//! ```text
//!  number ──pidfd_open──▶ pidfd ──/proc/self/fdinfo──▶ N, its number in this /proc ──/proc/N/fdinfo──▶ has the lock?
//!                           └──▶ signals, and whether it has ended
//! ```

use crate::node::directory::Node;
use crate::node::entry::ParticipantInfo;
use crate::sys::family::{has_ended, pidfd};
use nix::errno::Errno;
use nix::poll::PollTimeout;
use nix::sys::signal::Signal;
use std::fs;
use std::io;
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;

/// Why it is not known which process a participant is. Nobody may be sent a signal then.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// Its number means nobody here, or another process.
    #[error(
        "no process of this pid namespace is it: it runs in another one, such as a container that shares the \
         directory of the node (docker run --ipc=host)"
    )]
    Elsewhere,
    /// The kernel does not say what a process holds.
    #[error(
        "whether it is the process of that number here cannot be told: {0}; it takes /proc, Linux 5.3, and a program \
         of this user without file capabilities"
    )]
    Untold(#[source] io::Error),
}

/// A process that was a living participant when this was made. Its number may mean another process later, this cannot.
pub struct ParticipantProcess {
    pid: u32,
    pidfd: OwnedFd,
    /// Its folder in /proc. If that is another's by now, this process has ended.
    folder: PathBuf,
}

impl Node {
    /// The process of a participant; none when it has ended, or left.
    ///
    /// # Errors
    /// [`ProcessError`] when it is not the process of that number here, or the kernel does not say so.
    pub fn process_of(&self, participant: &ParticipantInfo) -> Result<Option<ParticipantProcess>, ProcessError> {
        let place = || self.living().find(|(_, now)| now.incarnation == participant.incarnation);
        let Some((claimant, _)) = place() else { return Ok(None) };
        let found = ParticipantProcess::open(participant.pid).and_then(|process| {
            let Some(process) = process else { return Ok(None) };
            let is_it = process.holds(self.identity(), u64::from(claimant.participant))?;
            Ok(is_it.then_some(process))
        });
        match found {
            Ok(Some(process)) => Ok(Some(process)),
            // It ended meanwhile.
            _ if place().is_none() => Ok(None),
            Ok(None) => Err(ProcessError::Elsewhere),
            Err(error) => Err(ProcessError::Untold(error)),
        }
    }
}

impl ParticipantProcess {
    /// The process of this number in our pid namespace, whichever it is; none when there is none.
    fn open(pid: u32) -> io::Result<Option<Self>> {
        let Some(pidfd) = pidfd(pid)? else { return Ok(None) };
        // The /proc that is mounted may be that of another namespace, in which the process has another number, or none.
        let told = fs::read_to_string(format!("/proc/self/fdinfo/{}", pidfd.as_raw_fd()))?;
        let number = told.lines().find_map(|line| line.strip_prefix("Pid:")?.trim().parse::<u32>().ok());
        Ok(number.filter(|number| *number != 0).map(|number| {
            let folder = format!("/proc/{number}").into();
            Self { pid, pidfd, folder }
        }))
    }

    /// Its number in our pid namespace.
    pub fn pid(&self) -> u32 {
        self.pid
    }

    /// Asks it to end: SIGTERM.
    ///
    /// # Errors
    /// When it has ended, or we have no right to.
    pub fn terminate(&self) -> io::Result<()> {
        self.signal(Signal::SIGTERM)
    }

    /// Ends it: SIGKILL.
    ///
    /// # Errors
    /// When it has ended, or we have no right to.
    pub fn kill(&self) -> io::Result<()> {
        self.signal(Signal::SIGKILL)
    }

    fn signal(&self, signal: Signal) -> io::Result<()> {
        let (pidfd, nothing) = (self.pidfd.as_raw_fd(), std::ptr::null::<libc::siginfo_t>());
        // SAFETY: takes numbers; without a `siginfo_t` the kernel makes the one of kill(2).
        let sent = unsafe { libc::syscall(libc::SYS_pidfd_send_signal, pidfd, signal as libc::c_int, nothing, 0) };
        Ok(Errno::result(sent).map(drop)?)
    }

    /// Whether it has ended, also if its parent has not noticed yet.
    pub fn has_ended(&self) -> bool {
        has_ended(&self.pidfd, PollTimeout::ZERO)
    }

    /// What a variable of this name held in the environment that it was started with; none: there was none.
    ///
    /// # Errors
    /// When the kernel does not say.
    pub fn was_given(&self, variable: &str) -> io::Result<Option<String>> {
        let all = fs::read(self.folder.join("environ"))?;
        let value = |entry: &[u8]| {
            let value = entry.strip_prefix(variable.as_bytes())?.strip_prefix(b"=")?;
            Some(String::from_utf8_lossy(value).into_owned())
        };
        Ok(all.split(|byte| *byte == 0).find_map(value))
    }

    /// Whether one of its open files holds the lock on this byte of the file with this device and number.
    fn holds(&self, file: (u64, u64), byte: u64) -> io::Result<bool> {
        for entry in fs::read_dir(self.folder.join("fdinfo"))? {
            let entry = entry?;
            let told = match fs::read_to_string(entry.path()) {
                Ok(told) => told,
                Err(error) if error.kind() == io::ErrorKind::PermissionDenied => return Err(error),
                // Closed meanwhile.
                Err(_) => continue,
            };
            if told.lines().any(|line| is_lock_on(line, file.1, byte)) {
                // The line has the device in another form than `stat`, on some file systems another device even.
                let there = match fs::metadata(self.folder.join("fd").join(entry.file_name())) {
                    Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                    there => there?,
                };
                if (there.dev(), there.ino()) == file {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }
}

/// Whether this line of an `fdinfo` is a lock on this byte of a file of this number, held by the open file:
/// `lock: 1: OFDLCK  ADVISORY  WRITE -1 00:1a:4711 3 3`.
fn is_lock_on(line: &str, inode: u64, byte: u64) -> bool {
    let fields: Vec<&str> = line.split_whitespace().collect();
    let ["lock:", _, "OFDLCK", _, "WRITE", _, file, first, last] = fields[..] else { return false };
    let is_file = file.rsplit(':').next().is_some_and(|number| number.parse() == Ok(inode));
    let (Ok(first), Ok(last)) = (first.parse::<u64>(), if last == "EOF" { Ok(u64::MAX) } else { last.parse() }) else {
        return false;
    };
    is_file && (first..=last).contains(&byte)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::name::Name;
    use crate::node::participant::Participant;
    use std::os::unix::process::ExitStatusExt;
    use std::process::{Child, Command};
    use std::sync::atomic::Ordering;

    const MODULE: Name = Name::new(1, 200, 0, 0);

    /// A process that is no participant, and that must not be hit. It ends when this drops.
    struct Bystander(Child);

    impl Drop for Bystander {
        fn drop(&mut self) {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }

    fn bystander() -> Bystander {
        Bystander(Command::new("sleep").arg("600").env("TOLD", "1").spawn().unwrap())
    }

    #[test]
    fn a_number_is_no_proof_and_the_lock_is() {
        let directory = tempfile::tempdir().unwrap();
        let node = Node::create(&directory.path().join("node"), 0o700).unwrap();
        let participant = Participant::join(&node, MODULE).unwrap();
        let told = || node.participants().into_iter().find(|there| there.module == MODULE);
        let found = node.process_of(&told().unwrap()).unwrap().unwrap();
        assert_eq!((found.pid(), found.has_ended()), (std::process::id(), false));
        // As in a container that shares the directory: the number means somebody else here, or nobody.
        let other = bystander();
        for pid in [other.0.id(), 1, u32::MAX, i32::MAX as u32] {
            participant.entry().pid.store(pid, Ordering::Relaxed);
            let refused = node.process_of(&told().unwrap());
            // The first process of the computer may be another user's, which may not be looked into.
            let is_refused = matches!(refused, Err(ProcessError::Elsewhere) | Err(ProcessError::Untold(_)));
            assert!(is_refused, "process {pid}");
        }
        participant.entry().pid.store(std::process::id(), Ordering::Relaxed);
        let was = told().unwrap();
        drop(participant);
        assert!(matches!(node.process_of(&was), Ok(None)), "it has left");
        // Another participant of this process has the place now: not the one that is meant.
        let _next = Participant::join(&node, MODULE).unwrap();
        assert!(matches!(node.process_of(&was), Ok(None)), "another one is there");
    }

    #[test]
    fn a_signal_reaches_the_process_that_was_opened_or_nobody() {
        let mut other = bystander();
        let process = ParticipantProcess::open(other.0.id()).unwrap().unwrap();
        assert!(!process.has_ended());
        // Between fork and exec it still has our environment.
        while process.was_given("TOLD").unwrap().is_none() {
            std::thread::yield_now();
        }
        assert_eq!(["TOL", "TOLD1"].map(|name| process.was_given(name).unwrap()), [None, None]);
        process.kill().unwrap();
        assert_eq!(other.0.wait().unwrap().signal(), Some(libc::SIGKILL));
        assert!(process.has_ended());
        let refused = process.terminate().unwrap_err();
        assert_eq!(refused.raw_os_error(), Some(libc::ESRCH), "its number may be another's by now: {refused}");
    }

    #[test]
    fn lines_of_locks_are_read() {
        for (line, is_it, why) in [
            ("lock:\t1: OFDLCK  ADVISORY  WRITE -1 00:1a:4711 3 3", true, "the byte"),
            ("lock:\t2: OFDLCK  ADVISORY  WRITE -1 00:1a:4711 0 7", true, "among others: the kernel joins them"),
            ("lock:\t2: OFDLCK  ADVISORY  WRITE -1 00:1a:4711 2 EOF", true, "up to the end"),
            ("lock:\t1: OFDLCK  ADVISORY  WRITE -1 00:1a:4711 4 4", false, "another's byte"),
            ("lock:\t1: OFDLCK  ADVISORY  WRITE -1 00:1a:4712 3 3", false, "another file"),
            ("lock:\t1: POSIX  ADVISORY  WRITE 77 00:1a:4711 3 3", false, "a lock that says nothing of a participant"),
            ("lock:\t1: OFDLCK  ADVISORY  READ -1 00:1a:4711 3 3", false, "no participant's either"),
            ("lock:\t1: OFDLCK  ADVISORY  WRITE -1 00:1a:4711 3 x", false, "no number"),
            ("ino:\t4711", false, "no lock"),
        ] {
            assert_eq!(is_lock_on(line, 4711, 3), is_it, "{why}: {line}");
        }
    }
}
