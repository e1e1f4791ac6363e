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
use rohrpost_testbed::lan::role as role_of_process;
use std::collections::BTreeMap;
use std::time::Instant;

const PACKAGES: u64 = 200;
/// Marks are system calls too: questions about a process that cannot be. Between the first and the second it is
/// counted.
const MARK: u64 = 0x4000_0000;
const ROLE: &str = "ROHRPOST_TEST_TRACED";
/// What is not done for a package: hellos, and looking every tenth of a second at what time has brought about.
const OTHERS_PER_SECOND: f64 = 40.0;
/// So many more may fall into the shortest run. One call more for each package would be 200.
const OTHERS_ALWAYS: u64 = PACKAGES / 10;

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

/// What was traced between the two marks.
struct Traced {
    calls: Calls,
    seconds: f64,
}

/// Follows all threads of the process that this one has started, from the first stop of the first to the end of all.
fn trace() -> Traced {
    let options = ptrace::Options::PTRACE_O_TRACESYSGOOD
        | ptrace::Options::PTRACE_O_EXITKILL
        | ptrace::Options::PTRACE_O_TRACECLONE;
    let (mut calls, mut marks, mut first, mut exit_code) = (Calls::new(), Vec::new(), None, None);
    loop {
        let status = match waitpid(None, Some(WaitPidFlag::__WALL)) {
            Ok(status) => status,
            Err(Errno::ECHILD) => break,
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
                    Some((libc::SYS_getpgid, [MARK, ..])) => marks.push(Instant::now()),
                    Some((number, arguments)) if marks.len() == 1 => {
                        *calls.entry((thread_name(thread), call_name(number, arguments))).or_default() += 1;
                    }
                    _ => {}
                }
                (thread, None)
            }
            WaitStatus::Exited(thread, code) => {
                exit_code = if Some(thread) == first { Some(code) } else { exit_code };
                continue;
            }
            _ => continue,
        };
        // It may have ended meanwhile, with its process.
        let _ = ptrace::syscall(thread, signal);
    }
    assert_eq!(exit_code, Some(0), "the traced process failed; calls until then: {calls:?}");
    assert_eq!(marks.len(), 2, "no call was counted");
    Traced { calls, seconds: (marks[1] - marks[0]).as_secs_f64() }
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
        // A datagram in one piece is sent without a list of its pieces.
        libc::SYS_sendmsg | libc::SYS_sendto => "send".into(),
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
    let child = role_of_process("role", ROLE, "1").spawn().unwrap();
    let Traced { calls, seconds } = trace();
    drop(child);
    let others = OTHERS_ALWAYS + (OTHERS_PER_SECOND * seconds) as u64;
    let of = |thread: &str, call: &str| calls.get(&(thread.to_owned(), call.to_owned())).copied().unwrap_or(0);
    let both = |call: &str, thread: &str, least: u64| {
        let times = of(thread, call);
        let most = PACKAGES + others;
        assert!((least..=most).contains(&times), "{thread}, {call}: not {least} to {most} times: {calls:?}");
    };
    both("send", "tx", PACKAGES);
    both("sleep", "tx", 1);
    // The first package is received by a call that waits already when counting begins, and the call after the last one
    // may come when counting is over.
    both("receive", "rx", PACKAGES - 1);
    // None, if the module was never quick enough to sleep before its package came.
    both("wake", "rx", 0);
    both("pause", "tx", 0);
    both("pause", "rx", 0);
    let known = |thread: &str, call: &str| match thread {
        "tx" => ["send", "sleep", "pause", "clock"].contains(&call),
        "rx" => ["receive", "wake", "pause", "clock"].contains(&call),
        _ => true,
    };
    // With a hello the two threads hand over to each other by a channel, where one may wait for the other.
    let unknown: u64 = calls.iter().filter(|((thread, call), _)| !known(thread, call)).map(|(_, times)| times).sum();
    assert!(unknown <= others, "{unknown} calls that no package needs, at most {others} are right: {calls:?}");
}
