//! What routers ask of the kernel for a package, counted by tracing their threads: one call to send, one to receive,
//! one to sleep and one to wake on each side.

#![allow(clippy::unwrap_used, reason = "these are tests")]
#![cfg(all(target_os = "linux", target_env = "gnu"))]

#[path = "shell_common/mod.rs"]
mod common;

use common::{PATIENCE, Pair, label, module};
use nix::errno::Errno;
use nix::libc;
use nix::sys::ptrace;
use nix::sys::signal::{Signal, raise};
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::Pid;
use rohrpost_mailbox::Shape;
use rohrpost_routers::lab::stall_detector::{Watched, repeated_on_stall};
use std::collections::BTreeMap;
use std::process::{Command, Stdio};

const PACKAGES: u64 = 200;
/// Marks are system calls too: questions about a process that cannot be. Between the first and the second it is
/// counted.
const MARK: u64 = 0x4000_0000;
const ROLE: &str = "ROHRPOST_TEST_TRACED";

/// In a process of its own: packages go from one node to the other, one after the other.
#[test]
fn role() {
    if std::env::var_os(ROLE).is_none() {
        return;
    }
    ptrace::traceme().unwrap();
    raise(Signal::SIGSTOP).unwrap();
    let pair = Pair::new();
    let way = |from: u8, to: u8| {
        let mut receiver = pair.sides[usize::from(to)].receiver(module(to), Shape::default());
        let mut sender = pair.sides[usize::from(from)].sender(module(to));
        move |id| {
            sender.send(&label(module(from), 100, id), &[b"a package"]).unwrap();
            assert_eq!(receiver.receive_timeout(PATIENCE).unwrap().head().id, id);
        }
    };
    let (mut round, mut back) = (way(0, 1), way(1, 0));
    // Both ways: then all threads of both routers have begun.
    (0..50).for_each(&mut back);
    (0..50).for_each(&mut round);
    let mark = || assert!(nix::unistd::getpgid(Some(Pid::from_raw(MARK as i32))).is_err());
    mark();
    (0..PACKAGES as u16).for_each(&mut round);
    mark();
}

/// How often each thread made each system call, by the names of both.
type Calls = BTreeMap<(String, String), u64>;

/// Follows all threads of the process that this one has started, from the first stop of the first to the end of all.
fn trace() -> Calls {
    let options = ptrace::Options::PTRACE_O_TRACESYSGOOD
        | ptrace::Options::PTRACE_O_EXITKILL
        | ptrace::Options::PTRACE_O_TRACECLONE;
    let (mut calls, mut marks, mut first) = (Calls::new(), 0, None);
    loop {
        let status = match waitpid(None, Some(WaitPidFlag::__WALL)) {
            Ok(status) => status,
            Err(Errno::ECHILD) => return calls,
            Err(error) => panic!("{error}"),
        };
        let (thread, signal) = match status {
            // The first by its own wish; each new one as it begins.
            WaitStatus::Stopped(thread, Signal::SIGSTOP) => {
                if first.is_none() {
                    ptrace::setoptions(thread, options).unwrap();
                    first = Some(thread);
                }
                (thread, None)
            }
            WaitStatus::Stopped(thread, signal) => (thread, Some(signal)),
            WaitStatus::PtraceEvent(thread, ..) => (thread, None),
            WaitStatus::PtraceSyscall(thread) => {
                match entered(thread) {
                    Some((libc::SYS_getpgid, [MARK, ..])) => marks += 1,
                    Some((number, arguments)) if marks == 1 => {
                        *calls.entry((thread_name(thread), call_name(number, arguments))).or_default() += 1;
                    }
                    _ => {}
                }
                (thread, None)
            }
            _ => continue,
        };
        // It may have ended meanwhile, with its process.
        let _ = ptrace::syscall(thread, signal);
    }
}

/// The system call that a thread is about to make; none when it comes back from one.
fn entered(thread: Pid) -> Option<(libc::c_long, [u64; 6])> {
    let info = ptrace::syscall_info(thread).ok()?;
    // SAFETY: numbers, whichever member the kernel filled; it says whether it was this one.
    let entry = (info.op == libc::PTRACE_SYSCALL_INFO_ENTRY).then_some(unsafe { info.u.entry })?;
    Some((entry.nr as libc::c_long, entry.args))
}

fn thread_name(thread: Pid) -> String {
    std::fs::read_to_string(format!("/proc/{thread}/comm")).unwrap_or_default().trim().to_owned()
}

fn call_name(number: libc::c_long, arguments: [u64; 6]) -> String {
    match number {
        libc::SYS_futex if arguments[1] as i32 & 0x7f == libc::FUTEX_WAIT => "sleep".into(),
        libc::SYS_futex if arguments[1] as i32 & 0x7f == libc::FUTEX_WAKE => "wake".into(),
        libc::SYS_sendmsg => "send".into(),
        libc::SYS_recvmsg => "receive".into(),
        // A thread that is kept busy for long, as by being traced, pauses now and then.
        libc::SYS_clock_nanosleep => "pause".into(),
        // On a machine with a clock source that needs the kernel, each read of the clock is a call.
        libc::SYS_clock_gettime => "clock".into(),
        other => format!("system call {other}"),
    }
}

#[test]
fn a_package_costs_one_call_to_send_one_to_receive_and_those_to_sleep_and_wake() {
    repeated_on_stall(Watched::Ordinary, || {
        let mut child = Command::new(std::env::current_exe().unwrap());
        child.args(["--exact", "role", "--nocapture", "--test-threads=1"]).env(ROLE, "1");
        let child = child.stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        let calls = trace();
        drop(child);
        let of = |thread: &str, call: &str| calls.get(&(thread.to_owned(), call.to_owned())).copied().unwrap_or(0);
        // Each node now and then says that it is still there, and looks at what time has brought about.
        let spare = PACKAGES / 2;
        let both = |call: &str, thread: &str, least: u64| {
            let times = of(thread, call);
            assert!((least..=PACKAGES + spare).contains(&times), "{thread}, {call}: {times} times in {calls:?}");
        };
        both("send", "tx", PACKAGES);
        both("sleep", "tx", 1);
        both("receive", "rx", PACKAGES);
        // None, if the module was never quick enough to sleep before its package came.
        both("wake", "rx", 0);
        both("pause", "tx", 0);
        both("pause", "rx", 0);
        for ((thread, call), times) in &calls {
            let known = match thread.as_str() {
                "tx" => ["send", "sleep", "pause", "clock"].contains(&call.as_str()),
                "rx" => ["receive", "wake", "pause", "clock"].contains(&call.as_str()),
                _ => true,
            };
            assert!(known, "{thread}: {call}, {times} times");
        }
    });
}
