//! Processes made by forking, a hundred times as cheap as starting a program: for tests that kill thousands of them.
//!
//! A fork has one thread only, whatever its parent has, and is only sound while no other thread of the parent holds a
//! lock of some library. So such a test runs in a process of its own with one thread, a *master*: see [`alone`] and
//! [`master`].

use super::board::shared;
use super::{Ground, PATIENCE};
use nix::sys::ptrace;
use nix::sys::signal::{Signal, kill, raise};
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::{ForkResult, Pid, fork};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};

/// Not 0: one of those that this process forked has panicked; in memory that they share. It tells also of one that was
/// killed before it had said why.
static ALARM: OnceLock<&'static AtomicU32> = OnceLock::new();

fn assert_no_alarm() {
    let alarm = ALARM.get().is_some_and(|alarm| alarm.load(SeqCst) != 0);
    assert!(!alarm, "a process found something wrong; see above");
}

/// A forked process; killed when dropped.
pub(crate) struct Actor {
    pid: Pid,
    ended: bool,
}

impl Actor {
    /// Does `act` in a process of its own, which then ends. It dies with this one.
    ///
    /// What holds a lock here must not live while this is called: the child would hold it too.
    pub(crate) fn new(act: impl FnOnce()) -> Self {
        let alarm = ALARM.get_or_init(shared);
        let parent = nix::unistd::getpid();
        // SAFETY: no other thread holds a lock of any library: there is none, or it is the harness's, which waits
        // (`master`).
        match unsafe { fork() }.unwrap() {
            ForkResult::Parent { child } => Self { pid: child, ended: false },
            ForkResult::Child => {
                // SAFETY: takes numbers only.
                unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) };
                let orphan = nix::unistd::getppid() != parent;
                // The alarm first: writing takes time, and the writer may be killed meanwhile.
                std::panic::set_hook(Box::new(|why| {
                    alarm.store(1, SeqCst);
                    eprintln!("{why}");
                }));
                let well = !orphan && catch_unwind(AssertUnwindSafe(act)).is_ok();
                // Not `exit`: what the parent wants to do at its end is not ours to do.
                // SAFETY: takes a number only.
                unsafe { libc::_exit(if well { 0 } else { 101 }) }
            }
        }
    }

    pub(crate) fn pid(&self) -> Pid {
        self.pid
    }

    /// It must still live: one that ended by itself found something wrong, and said so on its standard error.
    pub(crate) fn assert_alive(&self) {
        assert_no_alarm();
        let found = waitpid(self.pid, Some(WaitPidFlag::WNOHANG)).unwrap();
        assert_eq!(found, WaitStatus::StillAlive, "it ended by itself; see above");
    }

    /// Kills it wherever it is just now.
    pub(crate) fn kill(mut self) {
        kill(self.pid, Signal::SIGKILL).unwrap();
        self.ended = true;
        let how = waitpid(self.pid, None).unwrap();
        assert_eq!(how, WaitStatus::Signaled(self.pid, Signal::SIGKILL, false), "it ended by itself; see above");
        assert_no_alarm();
    }

    /// Stops it wherever it is just now, and returns when it has stopped.
    pub(crate) fn stop(&self) {
        kill(self.pid, Signal::SIGSTOP).unwrap();
        self.stopped();
    }

    /// Returns when it has stopped.
    pub(crate) fn stopped(&self) {
        let how = waitpid(self.pid, Some(WaitPidFlag::WUNTRACED)).unwrap();
        assert_eq!(how, WaitStatus::Stopped(self.pid, Signal::SIGSTOP), "it ended by itself; see above");
    }

    /// Leads it through one instruction; it is stopped, and asked to be traced.
    pub(crate) fn step(&self, what: &str) {
        ptrace::step(self.pid, None).unwrap();
        let how = waitpid(self.pid, None).unwrap();
        assert_eq!(how, WaitStatus::Stopped(self.pid, Signal::SIGTRAP), "{what}: see above");
    }

    /// Lets one go on that was led up to here.
    pub(crate) fn go_on_alone(&self) {
        ptrace::detach(self.pid, None).unwrap();
    }

    /// Lets a stopped one go on.
    pub(crate) fn go_on(&self) {
        kill(self.pid, Signal::SIGCONT).unwrap();
    }

    /// Somebody else has waited for its end.
    pub(crate) fn has_ended(mut self) {
        self.ended = true;
    }

    /// Until it ends by itself, well.
    pub(crate) fn finish(mut self) {
        self.ended = true;
        assert_eq!(waitpid(self.pid, None).unwrap(), WaitStatus::Exited(self.pid, 0), "see above");
    }
}

impl Drop for Actor {
    fn drop(&mut self) {
        if !self.ended {
            let _ = kill(self.pid, Signal::SIGKILL);
            let _ = waitpid(self.pid, None);
        }
    }
}

/// In an [`Actor`] that is to be led: has it traced, and stops it. What it does from here on is led.
pub(crate) fn be_led() {
    ptrace::traceme().unwrap();
    raise(Signal::SIGSTOP).unwrap();
}

/// Kills of each operation that is led; an environment variable makes them more.
pub(crate) fn instruction_kills() -> u64 {
    std::env::var("ROHRPOST_INSTRUCTION_KILLS").map_or(10, |kills| kills.parse().expect("a number of kills"))
}

/// In a role: does `act` with one thread, so that it may fork, and comes back when it is done. The test harness has a
/// thread besides the role's, which only waits for that.
pub(crate) fn master(act: impl FnOnce()) {
    let threads = || std::fs::read_dir("/proc/self/task").unwrap().count();
    assert_eq!(threads(), 2, "only the harness's thread and ours: it was started with --test-threads=1");
    super::until("the harness's thread waits", || is_asleep(nix::unistd::getpid()));
    Actor::new(|| {
        assert_eq!(threads(), 1);
        act();
    })
    .finish();
}

/// Whether a process's first thread waits for something, as the kernel says.
pub(crate) fn is_asleep(pid: Pid) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/task/{pid}/stat")).unwrap_or_default();
    // Its name is in parentheses and may hold anything.
    stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with('S'))
}

/// Runs a role of this test binary as a master and waits for its end. It has to [`tell`](super::tell) something now and
/// then, and `done` when all is well: one that says nothing for a long time hangs, and what it forked dies with it.
pub(crate) fn alone(ground: &Ground, role: &str) {
    let master = ground.start(role);
    loop {
        // Longer than it waits for others: then it says itself for which.
        match master.told.recv_timeout(2 * PATIENCE) {
            Ok(told) if told == "done" => return master.finish(),
            Ok(told) => println!("{role}: {told}"),
            Err(error) => panic!("{role}: it found something wrong (see above), or hangs: {error}"),
        }
    }
}
