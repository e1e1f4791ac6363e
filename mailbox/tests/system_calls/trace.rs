//! A process is followed from one system call to the next. What it does it marks, so that each call belongs to an
//! operation.

use crate::common::crew::{Actor, master};
use crate::common::hands::{OPERATIONS, do_all};
use crate::common::{Ground, tell};
use nix::sys::ptrace;
use nix::sys::signal::{Signal, raise};
use nix::sys::wait::{WaitStatus, waitpid};
use nix::unistd::Pid;

/// The system calls of an operation; of all others, none.
const CALLS: &[(&str, &[&str])] = &[
    ("sleep until a package comes", SLEEP),
    ("sleep for several until a package comes", SLEEP),
    ("sleep until a time has passed", SLEEP),
    ("sleep in poll until a package comes", &["poll", "read"]),
    ("send to a receiver that sleeps", WAKE),
    ("loan and send to a receiver that sleeps", WAKE),
    // A sleeper in `poll` is woken through its pipe, which its ringers open when they need it.
    ("send to a receiver that sleeps in poll", &["futex wake", "openat", "write", "close"]),
];
const SLEEP: &[&str] = &["futex wait"];
const WAKE: &[&str] = &["futex wake"];
const CLOCK: &str = "clock_gettime";

/// Marks are system calls too: questions about processes that cannot be. One before an operation, one after it.
const MARK: u64 = 0x4000_0000;

fn mark(operation: usize) {
    // SAFETY: takes numbers only, and changes nothing.
    assert_eq!(unsafe { libc::syscall(libc::SYS_getpgid, MARK + operation as u64) }, -1);
}

/// Has every operation done by a traced process, and checks what it called.
pub(crate) fn trace_all(ground: &Ground) {
    let start = || {
        ptrace::traceme().unwrap();
        raise(Signal::SIGSTOP).unwrap();
    };
    let around = |at: usize, operate: &mut dyn FnMut()| {
        mark(at);
        operate();
        mark(at);
    };
    master(|| do_all(ground, start, around, |doer| check(&trace(doer))));
    tell("done");
}

/// One time of an operation, and the system calls in it.
type Traced = (usize, Vec<String>);

/// Follows a process from its first stop to its end.
fn trace(doer: Actor) -> Vec<Traced> {
    let pid = doer.pid();
    assert_eq!(waitpid(pid, None).unwrap(), WaitStatus::Stopped(pid, Signal::SIGSTOP));
    ptrace::setoptions(pid, ptrace::Options::PTRACE_O_TRACESYSGOOD | ptrace::Options::PTRACE_O_EXITKILL).unwrap();
    let (mut all, mut inside): (Vec<Traced>, Option<Traced>) = Default::default();
    let mut signal = None;
    loop {
        ptrace::syscall(pid, signal.take()).unwrap();
        match waitpid(pid, None).unwrap() {
            WaitStatus::PtraceSyscall(_) => {}
            WaitStatus::Stopped(_, sent) => {
                signal = Some(sent);
                continue;
            }
            end => {
                doer.has_ended();
                assert_eq!(end, WaitStatus::Exited(pid, 0), "see above");
                return all;
            }
        }
        let Some((number, arguments)) = entered(pid) else { continue };
        // Built with debug assertions, the standard library asks whether what it closes is open.
        if cfg!(debug_assertions) && (number, arguments[1]) == (libc::SYS_fcntl, libc::F_GETFD as u64) {
            continue;
        }
        let operation = arguments[0].checked_sub(MARK).filter(|at| *at < OPERATIONS.len() as u64);
        match (operation.filter(|_| number == libc::SYS_getpgid), &mut inside) {
            (Some(at), None) => inside = Some((at as usize, Vec::new())),
            (Some(_), Some(_)) => all.extend(inside.take()),
            (None, Some((_, calls))) => calls.push(name(number, arguments)),
            (None, None) => {}
        }
    }
}

/// The system call that it is about to make; none when it comes back from one.
fn entered(pid: Pid) -> Option<(libc::c_long, [u64; 6])> {
    let info = ptrace::syscall_info(pid).unwrap();
    // SAFETY: numbers, whichever member the kernel filled; it says whether it was this one.
    let entry = (info.op == libc::PTRACE_SYSCALL_INFO_ENTRY).then_some(unsafe { info.u.entry })?;
    Some((entry.nr as libc::c_long, entry.args))
}

fn name(number: libc::c_long, arguments: [u64; 6]) -> String {
    match number {
        libc::SYS_futex => match arguments[1] as i32 & !libc::FUTEX_PRIVATE_FLAG {
            libc::FUTEX_WAIT => "futex wait".into(),
            libc::FUTEX_WAKE => "futex wake".into(),
            other => format!("futex {other}"),
        },
        #[cfg(target_arch = "x86_64")]
        libc::SYS_poll => "poll".into(),
        libc::SYS_ppoll => "poll".into(),
        libc::SYS_openat => "openat".into(),
        libc::SYS_read => "read".into(),
        libc::SYS_write => "write".into(),
        libc::SYS_close => "close".into(),
        libc::SYS_clock_gettime => CLOCK.into(),
        other => format!("system call {other}"),
    }
}

fn check(all: &[Traced]) {
    assert!(CALLS.iter().all(|(name, _)| OPERATIONS.iter().any(|operation| operation.name == *name)));
    // If the machine's clock source cannot be read without the kernel, every look at the clock is a call: not ours to
    // fix.
    let slow_clock = all.iter().any(|(at, calls)| *at == 0 && calls.iter().any(|call| call == CLOCK));
    if slow_clock {
        tell(
            "the kernel is asked for each look at the clock here (see .../clocksource0/current_clocksource); not \
            counted",
        );
    }
    let mut naps_more = 0;
    for (at, operation) in OPERATIONS.iter().enumerate() {
        let expected = CALLS.iter().find(|(name, _)| *name == operation.name).map_or(&[][..], |(_, calls)| *calls);
        let here: Vec<_> = all.iter().filter(|(operation, _)| *operation == at).collect();
        assert_eq!(here.len() as u64, operation.times, "{}", operation.name);
        for (time, (_, calls)) in here.into_iter().enumerate() {
            let mut calls: Vec<&str> =
                calls.iter().map(String::as_str).filter(|call| !slow_clock || *call != CLOCK).collect();
            // A nap in `poll` ends after a tenth of a second. For so long a busy computer may keep the answer back, now
            // and then.
            let before = calls.len();
            calls.dedup_by(|next, call| next == call && *call == "poll");
            naps_more += before - calls.len();
            assert_eq!(calls, expected, "{}, time {time}", operation.name);
        }
    }
    assert!(naps_more <= 3, "{naps_more} naps more than one for each sleep");
    tell(format_args!("{} operations traced", all.len()));
}
