//! A push, a repair and a way back, killed at each system call: the node has the old bundle or the new one, whole, and
//! the next push completes what was begun.

use crate::bundle::{Workshop, current};
use nix::libc;
use nix::sys::ptrace;
use nix::sys::signal::{Signal, kill};
use nix::sys::wait::{WaitStatus, waitpid};
use nix::unistd::Pid;
use rohrpost_bundle::{Bundle, NodeFolder};
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};

/// System calls that change nothing outside of the process: a kill before one leaves what a kill before the next does.
const UNCHANGING: [libc::c_long; 13] = [
    libc::SYS_read,
    libc::SYS_lseek,
    libc::SYS_fstat,
    libc::SYS_newfstatat,
    libc::SYS_statx,
    libc::SYS_close,
    libc::SYS_fcntl,
    libc::SYS_getdents64,
    libc::SYS_readlinkat,
    libc::SYS_mmap,
    libc::SYS_munmap,
    libc::SYS_mremap,
    libc::SYS_brk,
];

/// Runs a command, and kills it when it enters its system call of this number, of those that may change something,
/// counted from the first lock that it takes. False if it has ended before, and well.
fn killed_at(mut command: Command, number: usize) -> bool {
    let trace = || ptrace::traceme().map_err(std::io::Error::from);
    // SAFETY: one system call between fork and exec, which touches no memory.
    unsafe { command.pre_exec(trace) };
    #[expect(clippy::zombie_processes, reason = "it is waited for by its number")]
    let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let pid = Pid::from_raw(child.id() as i32);
    assert_eq!(waitpid(pid, None).unwrap(), WaitStatus::Stopped(pid, Signal::SIGTRAP));
    ptrace::setoptions(pid, ptrace::Options::PTRACE_O_TRACESYSGOOD | ptrace::Options::PTRACE_O_EXITKILL).unwrap();
    let mut entered = None;
    loop {
        ptrace::syscall(pid, None).unwrap();
        match waitpid(pid, None).unwrap() {
            WaitStatus::PtraceSyscall(_) => {}
            WaitStatus::Exited(_, 0) => return false,
            end => panic!("{end:?}"),
        }
        let info = ptrace::syscall_info(pid).unwrap();
        if info.op != libc::PTRACE_SYSCALL_INFO_ENTRY {
            continue;
        }
        // SAFETY: `op` says which field of the union is valid.
        let call = unsafe { info.u.entry }.nr;
        entered = match entered {
            None if call == libc::SYS_flock as u64 => Some(0),
            entered if UNCHANGING.iter().any(|unchanging| *unchanging as u64 == call) => entered,
            entered => entered.map(|entered| entered + 1),
        };
        if entered == Some(number) {
            kill(pid, Signal::SIGKILL).unwrap();
            assert_eq!(waitpid(pid, None).unwrap(), WaitStatus::Signaled(pid, Signal::SIGKILL, false));
            return true;
        }
    }
}

/// All bundles of a node are whole, but one that may be damaged, wherever it is.
#[track_caller]
fn assert_whole(node: &Path, damaged: Option<&str>) {
    for entry in fs::read_dir(node.join("bundles")).unwrap() {
        let bundle = Bundle::open(&entry.unwrap().path()).unwrap();
        let differences: Vec<String> = bundle.differences().unwrap().iter().map(ToString::to_string).collect();
        assert!(
            differences.is_empty() || differences.iter().all(|found| Some(found.as_str()) == damaged),
            "{differences:?}"
        );
    }
}

/// Kills a command at each of its system calls, each time from the same state, and looks at what it leaves.
fn torture(workshop: &Workshop, start: &Path, arguments: &[&str], look: impl Fn(&Path, usize)) {
    let node = workshop.place.path("node");
    for number in 0.. {
        let _ = fs::remove_dir_all(&node);
        let copied = Command::new("cp").arg("-a").args([start, &node]).status().unwrap();
        assert!(copied.success());
        let is_killed = killed_at(workshop.place.command(arguments), number);
        look(&node, number);
        if !is_killed {
            println!("{arguments:?}: killed at {number} system calls");
            // The shortest, a way back, changes one link.
            assert!(number > 8, "{number}");
            return;
        }
    }
}

#[test]
fn a_push_that_is_killed_at_any_system_call_leaves_the_old_bundle_or_the_new_one() {
    let workshop = Workshop::new();
    let start = workshop.node("start");
    // As many as are kept: the push also takes one away.
    for number in 0..4 {
        workshop.write_program(&format!("# {number}"));
        workshop.make("30 s");
        if number < 3 {
            workshop.push(&start).ok();
        }
    }
    let push = ["bundle", "push", "source/config/bundles", "--to", "node"];
    let newest = Bundle::newest(&workshop.place.path("source/config/bundles")).unwrap().unwrap();
    let seen = std::cell::RefCell::new(Vec::new());
    torture(&workshop, Path::new(&start), &push, |node, number| {
        let version = current(node.to_str().unwrap());
        assert!(version == 3 || version == 4, "version {version} after {number}");
        seen.borrow_mut().push(version);
        assert_whole(node, None);
        // The next one, which is not killed; each twentieth by the command itself.
        if number % 20 == 0 {
            workshop.place.say(&push).ok();
        } else {
            NodeFolder::new(node).receive(&mut rohrpost_bundle::FolderSource(&newest)).unwrap();
        }
        assert_eq!(current(node.to_str().unwrap()), 4);
        assert_whole(node, None);
        let names = |folder: &str| fs::read_dir(node.join(folder)).unwrap().count();
        assert_eq!((names("bundles"), names("staging")), (3, 0), "after {number}");
    });
    let seen = seen.into_inner();
    assert!(seen.is_sorted() && seen[0] == 3 && seen.last() == Some(&4), "{seen:?}");
}

#[test]
fn a_repair_that_is_killed_at_any_system_call_makes_nothing_worse() {
    let workshop = Workshop::new();
    let start = workshop.node("start");
    workshop.make("30 s");
    workshop.push(&start).ok();
    fs::write(Path::new(&start).join("current/maps/house.map"), "").unwrap();
    let damaged = Some("maps/house.map was changed: its content is not that of the manifest");
    let push = ["bundle", "push", "source/config/bundles", "--to", "node"];
    torture(&workshop, Path::new(&start), &push, |node, _| {
        assert_eq!(NodeFolder::new(node).bundle().unwrap().manifest().version(), 1);
        assert_whole(node, damaged);
    });
    assert_eq!(current(workshop.place.path("node").to_str().unwrap()), 1);
}

#[test]
fn a_way_back_that_is_killed_at_any_system_call_is_gone_or_not() {
    let workshop = Workshop::new();
    let start = workshop.node("start");
    for number in 0..2 {
        workshop.write_program(&format!("# {number}"));
        workshop.make("30 s");
        workshop.push(&start).ok();
    }
    torture(&workshop, Path::new(&start), &["bundle", "back", "node"], |node, number| {
        let version = current(node.to_str().unwrap());
        assert!(version == 1 || version == 2, "version {version} after {number}");
        if version == 2 {
            assert_eq!(NodeFolder::new(node).back().unwrap(), (2, 1));
        }
        assert_whole(node, None);
    });
}
