//! Children end when their time is over, when they fail, and when their parent is gone. Without the test harness, since
//! its threads must not be forked.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, Shared, Zeroable};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Longer than anything here takes on a busy computer.
const PATIENCE: Duration = Duration::from_secs(20);

fn main() {
    a_child_that_hangs_is_killed_when_its_time_is_over();
    what_a_child_fails_with_is_told();
    a_child_dies_with_its_parent();
    the_exit_code_of_a_program_that_a_child_becomes_is_told();
    println!("test result: ok. 4 passed");
}

fn soon() -> Instant {
    Instant::now() + PATIENCE
}

fn hang() -> ! {
    loop {
        std::thread::sleep(PATIENCE);
    }
}

#[repr(C)]
struct ProcessId(AtomicU32);

// SAFETY: one atomic.
unsafe impl Zeroable for ProcessId {}

impl ProcessId {
    fn tell(&self) {
        self.0.store(std::process::id(), Ordering::Release);
    }

    fn wait(&self) -> u32 {
        wait_for("a child's process id", || self.0.load(Ordering::Acquire) != 0);
        self.0.load(Ordering::Acquire)
    }
}

fn wait_for(what: &str, is_so: impl Fn() -> bool) {
    let deadline = soon();
    while !is_so() {
        assert!(Instant::now() < deadline, "waited too long for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Gone, or a zombie that its parent has not reaped.
fn is_dead(pid: u32) -> bool {
    let stat = std::fs::read_to_string(Path::new("/proc").join(pid.to_string()).join("stat")).unwrap_or_default();
    stat.rsplit(") ").next().is_none_or(|state| state.is_empty() || state.starts_with('Z'))
}

fn a_child_that_hangs_is_killed_when_its_time_is_over() {
    let pid = Shared::<ProcessId>::new().unwrap();
    let child = Child::start(|| {
        pid.tell();
        hang()
    });
    let pid = pid.wait();
    assert!(!is_dead(pid));
    let error = child.unwrap().finish(Instant::now() + Duration::from_millis(50)).unwrap_err();
    assert!(error.to_string().contains("killed when its time was over"), "{error}");
    assert!(is_dead(pid));
}

fn what_a_child_fails_with_is_told() {
    let skipped = Failure::Skipped("no such thing here".into());
    assert_eq!(Child::start(|| Ok(())).unwrap().finish(soon()), Ok(()));
    assert_eq!(Child::start(|| Err(skipped.clone())).unwrap().finish(soon()), Err(skipped));
    let panicked = Child::start(|| panic!("this panic is part of the test")).unwrap().finish(soon());
    assert!(panicked.unwrap_err().to_string().contains("panicked"));
    let killed = Child::start(|| std::process::abort()).unwrap().finish(soon());
    assert!(killed.unwrap_err().to_string().contains("killed"));
}

fn a_child_dies_with_its_parent() {
    let pid = Shared::<ProcessId>::new().unwrap();
    let parent = Child::start(|| {
        let _child = Child::start(|| {
            pid.tell();
            hang()
        });
        pid.wait();
        // As with a kill from outside: nothing of this process is dropped.
        std::process::abort()
    });
    assert!(parent.unwrap().finish(soon()).is_err());
    wait_for("the end of the child", || is_dead(pid.wait()));
}

fn the_exit_code_of_a_program_that_a_child_becomes_is_told() {
    let run = |program: &str, script: &str| {
        let child = Child::start(|| Err(Failure::of("exec", Command::new(program).args(["-c", script]).exec())));
        child.unwrap().finish_program(soon())
    };
    assert_eq!(run("sh", "exit 0"), Ok(()));
    assert_eq!(run("sh", "exit 3"), Err(Failure::Failed("it ended with 3".into())));
    for (program, words) in [("sh", "SIGKILL"), ("/no/such/program", "exec: No such file")] {
        let failure = run(program, "kill -KILL $$").unwrap_err();
        assert!(failure.to_string().contains(words), "{failure}");
    }
}
