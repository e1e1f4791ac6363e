//! System calls and heap uses of a send to a receiver that is awake: none. Counted, not timed.
//!
//! One thread sends some packages and then receives them, so its receiver never sleeps. A tracer counts system calls
//! between two marks, which are system calls themselves. Beside it stands a contender that is known to use what is
//! counted.

use crate::counting::heap_uses;
use crate::floors::{Queue, QueueSink};
use crate::one_way::{OwnNode, Retry, Sink, Source};
use nix::sys::ptrace;
use nix::sys::signal::{Signal, kill, raise};
use nix::sys::wait::{WaitStatus, waitpid};
use nix::unistd::{ForkResult, Pid, fork};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{Failure, OrFail, sample_in_child};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::OverflowPolicy;
use std::hint::black_box;
use std::sync::mpsc;
use std::time::Duration;

const BYTES: usize = 64;
/// Packages sent in a row, then received.
const BATCH: usize = 32;
const PATIENCE: Duration = Duration::from_secs(60);
/// A system call that nobody here uses otherwise; what happens between two of them counts.
const MARK: libc::c_long = libc::SYS_getpgrp;

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    let system_calls = |batches| {
        [
            counted("rohrpost", move || traced(|| mailbox_under(batches, mark))),
            counted("posix-mq", move || traced(|| queue_under(batches))),
        ]
    };
    let heap_uses = |batches| {
        [
            counted("rohrpost", move || mailbox_heap_uses(batches)),
            counted("channel of vectors", move || channel_heap_uses(batches)),
        ]
    };
    vec![case("system-calls-per-send", system_calls), case("heap-uses-per-send", heap_uses)]
}

/// What is counted of so many batches: ours, and another of which something is known to be counted.
fn case(name: &str, contenders: fn(usize) -> [Contender<'static>; 2]) -> Case {
    Case::new(name, BYTES, "a send", move |settings, subject| {
        let [ours, other] = contenders(settings.count(1_600) / BATCH + 1);
        let once = Settings { rounds: 1, ..settings.clone() };
        Ok(compare(&once, subject, &[ours, other.beside(at_most(0.0), None)]))
    })
}

/// A contender with its figure counted in a process of its own.
fn counted<'a>(name: &'static str, count: impl Fn() -> Result<f64, Failure> + 'a) -> Contender<'a> {
    Contender::single(name, move || {
        let counts = sample_in_child(PATIENCE, |samples| {
            samples.push(count()?);
            Ok(())
        })?;
        counts.first().copied().ok_or_else(|| Failure::Failed("nothing counted".into()))
    })
}

/// Sends batch after batch into a mailbox of this process, with `mark` before and after each, and receives it again.
fn mailbox_under(batches: usize, mut mark: impl FnMut()) -> Result<usize, Failure> {
    let ground = OwnNode::new(2 * BATCH, BYTES, OverflowPolicy::Displace)?;
    let mut source = ground.source(false)?;
    let mut sink = ground.sink(100, Retry::Never)?;
    let mut message = [0; BYTES];
    for batch in 0..=batches {
        // The first send makes the row of its traffic table, and is not counted.
        let counts = batch > 0;
        if counts {
            mark();
        }
        for _ in 0..BATCH {
            sink.send(&[7; BYTES])?;
        }
        if counts {
            mark();
        }
        for _ in 0..BATCH {
            source.receive(&mut message)?;
        }
    }
    Ok(batches * BATCH)
}

fn mailbox_heap_uses(batches: usize) -> Result<f64, Failure> {
    let before = heap_uses();
    drop(black_box(Box::new(7)));
    if heap_uses() == before {
        return Err(Failure::Skipped("this program does not count its heap's uses".into()));
    }
    let (mut uses, mut sending) = (0, None);
    let sent = mailbox_under(batches, || match sending.take() {
        None => sending = Some(heap_uses()),
        Some(before) => uses += heap_uses() - before,
    })?;
    Ok(uses as f64 / sent as f64)
}

fn channel_heap_uses(batches: usize) -> Result<f64, Failure> {
    let (sender, receiver) = mpsc::channel();
    let before = heap_uses();
    for _ in 0..batches * BATCH {
        sender.send(black_box(vec![7u8; BYTES])).or_fail("channel")?;
    }
    let uses = heap_uses() - before;
    drop(receiver);
    Ok(uses as f64 / (batches * BATCH) as f64)
}

fn queue_under(batches: usize) -> Result<usize, Failure> {
    let queue = Queue::new(BATCH, BYTES)?;
    let (mut sink, mut source) = (QueueSink::new(&queue, 0), &queue);
    let mut message = [0; BYTES];
    for _ in 0..batches {
        mark();
        for _ in 0..BATCH {
            sink.send(&[7; BYTES])?;
        }
        mark();
        for _ in 0..BATCH {
            source.receive(&mut message)?;
        }
    }
    Ok(batches * BATCH)
}

fn mark() {
    // SAFETY: takes nothing and changes nothing.
    unsafe { libc::syscall(MARK) };
}

/// Runs `body`, which returns the number of its sends, in a traced child. Returns system calls per send between its
/// marks.
fn traced(body: impl FnOnce() -> Result<usize, Failure>) -> Result<f64, Failure> {
    // SAFETY: this process has one thread.
    match unsafe { fork() }.or_fail("fork")? {
        ForkResult::Child => {
            let sent = ptrace::traceme()
                .and_then(|()| raise(Signal::SIGSTOP))
                .map_err(|_| ())
                .and_then(|()| body().map_err(|_| ()));
            // The last mark has the number of sends as its argument.
            // SAFETY: as above, then the end of this process.
            unsafe {
                if let Ok(sent) = sent {
                    libc::syscall(MARK, sent);
                }
                libc::_exit(i32::from(sent.is_err()))
            }
        }
        ForkResult::Parent { child } => {
            let counted = count_calls(child);
            if counted.is_err() {
                let _ = kill(child, Signal::SIGKILL);
                let _ = waitpid(child, None);
            }
            counted
        }
    }
}

/// Follows the child from one system call to the next until it ends.
fn count_calls(child: Pid) -> Result<f64, Failure> {
    let failed = |error| match error {
        nix::Error::EPERM => Failure::Skipped("no process may be traced here".into()),
        error => Failure::of("ptrace", error),
    };
    // System calls after an opening mark count only once the closing one has come.
    let (mut window, mut calls, mut sent) = (None, 0u64, 0u64);
    let mut first = true;
    loop {
        match waitpid(child, None).map_err(failed)? {
            WaitStatus::Exited(_, 0) if sent > 0 => return Ok(calls as f64 / sent as f64),
            WaitStatus::Exited(..) | WaitStatus::Signaled(..) => {
                return Err(Failure::Failed("the traced process failed".into()));
            }
            WaitStatus::Stopped(..) if first => {
                first = false;
                ptrace::setoptions(child, ptrace::Options::PTRACE_O_TRACESYSGOOD | ptrace::Options::PTRACE_O_EXITKILL)
                    .map_err(failed)?;
            }
            WaitStatus::PtraceSyscall(_) => {
                let info = ptrace::syscall_info(child).map_err(failed)?;
                if info.op == libc::PTRACE_SYSCALL_INFO_ENTRY {
                    // SAFETY: `op` says which field of the union is valid.
                    let entry = unsafe { info.u.entry };
                    if entry.nr == MARK as u64 {
                        window = match window.take() {
                            None => Some(0),
                            Some(inside) => {
                                calls += inside;
                                None
                            }
                        };
                        sent = entry.args[0];
                    } else if let Some(inside) = &mut window {
                        *inside += 1;
                    }
                }
            }
            _ => {}
        }
        ptrace::syscall(child, None).map_err(failed)?;
    }
}
