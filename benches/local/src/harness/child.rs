//! A forked process that does one thing, tells why it failed, and dies with its parent.

use super::{Failure, Gate, OrFail, Shared, Zeroable, interrupted};
use nix::sys::signal::{Signal, kill};
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::{ForkResult, Pid, fork, getppid};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU8, AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// What a child has to say of its end.
#[repr(C)]
struct ChildReport {
    /// 0: nothing said; else one of the below.
    end: AtomicU32,
    text: [AtomicU8; 508],
}

// SAFETY: atomics only.
unsafe impl Zeroable for ChildReport {}

const DONE: u32 = 1;
const SKIPPED: u32 = 2;
const FAILED: u32 = 3;

impl ChildReport {
    fn write(&self, result: &Result<(), Failure>) {
        let (end, text) = match result {
            Ok(()) => (DONE, ""),
            Err(Failure::Skipped(text)) => (SKIPPED, text.as_str()),
            Err(Failure::Failed(text)) => (FAILED, text.as_str()),
        };
        for (byte, value) in self.text.iter().zip(text.bytes()) {
            byte.store(value, Ordering::Relaxed);
        }
        // ORDERING: publishes the text; the parent reads it after the child has ended.
        self.end.store(end, Ordering::Release);
    }

    fn read(&self) -> Option<Result<(), Failure>> {
        let end = self.end.load(Ordering::Acquire);
        let bytes = self.text.iter().map(|byte| byte.load(Ordering::Relaxed)).take_while(|byte| *byte != 0);
        let text = || String::from_utf8_lossy(&bytes.collect::<Vec<u8>>()).into_owned();
        match end {
            DONE => Some(Ok(())),
            SKIPPED => Some(Err(Failure::Skipped(text()))),
            FAILED => Some(Err(Failure::Failed(text()))),
            _ => None,
        }
    }
}

/// A forked process. Killed, if it still runs, when this is dropped.
pub struct Child {
    pid: Pid,
    report: Shared<ChildReport>,
    /// How it has ended.
    ended: Option<WaitStatus>,
}

impl Child {
    /// Forks; the child does `body` and ends, without anything that the parent would do at its end.
    ///
    /// The calling process must have no other thread: the child would inherit the locks they hold.
    ///
    /// # Errors
    /// When there can be no further process.
    pub fn start(body: impl FnOnce() -> Result<(), Failure>) -> Result<Self, Failure> {
        let report = Shared::<ChildReport>::new()?;
        let parent = nix::unistd::getpid();
        // SAFETY: the parent has no other thread (see above), so the child may do what any process may.
        match unsafe { fork() }.or_fail("fork")? {
            ForkResult::Parent { child } => Ok(Self { pid: child, report, ended: None }),
            ForkResult::Child => {
                // The parent may have gone between the fork and the wish to go with it.
                let bound = nix::sys::prctl::set_pdeathsig(Signal::SIGKILL).is_ok() && getppid() == parent;
                if bound {
                    let result = catch_unwind(AssertUnwindSafe(body));
                    report.write(&result.unwrap_or_else(|_| Err(Failure::Failed("panicked, see above".into()))));
                }
                // SAFETY: ends the process at once; nothing of the parent's is flushed or dropped twice.
                unsafe { libc::_exit(0) }
            }
        }
    }

    /// Waits until it ends; kills it when its time is over.
    ///
    /// # Errors
    /// What the child failed with, or that it was killed.
    pub fn finish(mut self, deadline: Instant) -> Result<(), Failure> {
        self.await_end(deadline)?;
        self.report.read().unwrap_or_else(|| Err(Failure::Failed("its process was killed".into())))
    }

    /// The same of a child that becomes another program: its exit code is to be 0.
    ///
    /// # Errors
    /// What the child failed with before, its other end, or that it was killed.
    pub fn finish_program(mut self, deadline: Instant) -> Result<(), Failure> {
        let status = self.await_end(deadline)?;
        match (self.report.read(), status) {
            (Some(Err(failure)), _) => Err(failure),
            (_, WaitStatus::Exited(_, 0)) => Ok(()),
            (_, WaitStatus::Exited(_, code)) => Err(Failure::Failed(format!("it ended with {code}"))),
            (_, status) => Err(Failure::Failed(format!("it ended: {status:?}"))),
        }
    }

    fn await_end(&mut self, deadline: Instant) -> Result<WaitStatus, Failure> {
        while !self.has_ended()? {
            if interrupted() {
                return Err(Failure::Failed("interrupted".into()));
            }
            if Instant::now() > deadline {
                return Err(Failure::Failed("hung: killed when its time was over".into()));
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        Ok(self.ended.unwrap_or(WaitStatus::StillAlive))
    }

    /// Its process; after it has ended, perhaps somebody else's.
    pub fn pid(&self) -> i32 {
        self.pid.as_raw()
    }

    /// Sends it a signal, unless it has ended.
    pub fn signal(&mut self, signal: Signal) {
        if self.has_ended() == Ok(false) {
            // Not waited for yet, so its process id is nobody else's.
            let _ = kill(self.pid, signal);
        }
    }

    /// Whether it has ended, by itself or not.
    ///
    /// # Errors
    /// When the kernel does not know it, which cannot be.
    pub fn has_ended(&mut self) -> Result<bool, Failure> {
        if self.ended.is_none() {
            let status = waitpid(self.pid, Some(WaitPidFlag::WNOHANG)).or_fail("waitpid")?;
            self.ended = Some(status).filter(|status| *status != WaitStatus::StillAlive);
        }
        Ok(self.ended.is_some())
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        if self.ended.is_none() {
            let _ = kill(self.pid, Signal::SIGKILL);
            let _ = waitpid(self.pid, None);
        }
    }
}

impl Gate {
    /// Waits for children that come here and then go on until they are dropped.
    ///
    /// # Errors
    /// What a child failed with that does not come, else as [`Self::meet`].
    pub fn meet_children(&self, children: &mut Vec<Child>) -> Result<(), Failure> {
        let Err(late) = self.meet(children.len() as u32 + 1) else { return Ok(()) };
        check_children(children)?;
        children.clear();
        Err(late)
    }
}

/// Takes out those that have ended, of children that end only when they fail.
///
/// # Errors
/// What the first of them failed with.
pub fn check_children(children: &mut Vec<Child>) -> Result<(), Failure> {
    let mut ended = children.extract_if(.., |child| child.has_ended() != Ok(false));
    ended.try_for_each(|child| child.finish(Instant::now()))
}
