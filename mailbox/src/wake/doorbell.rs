//! Sleeping and waking: what the kernel is asked for a participant's bell.
//!
//! ```text
//! receiver: seen = bell │ sleeping = 1 │ (F) │ look at the hints │ sleep while bell == seen │ sleeping = 0
//! sender:   publish, hint │ (E) │ sleeping? ──▶ bell += 1, wake
//! ```
//! The receiver reads the bell before it says that it sleeps; so a ring after its last look changes the word it would
//! sleep on. One bell serves all mailboxes of a participant, so waiting on several is waiting on one.
//!
//! A participant that waits for file descriptors too sleeps in `poll` and has a named pipe `bell.N` in the node's
//! directory; N is its place in the table. Ringers open it only while it sleeps there (see `bell`).

use crate::node::directory::Node;
use crate::node::entry::PARTICIPANTS_MAX;
use crate::step::step;
use nix::errno::Errno;
use nix::fcntl::{OFlag, openat};
use nix::sys::stat::{Mode, fchmod, fstat};
use nix::unistd::{UnlinkatFlags, mkfifoat, unlinkat, write};
use std::ffi::CStr;
use std::io::{self, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// Whether a sleep was one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Slept {
    /// Perhaps.
    Perhaps,
    /// The bell had been rung before.
    NotAtAll,
}

/// Sleeps while `bell` still is `seen`, at most for `timeout`. May return early, for no reason or for a signal.
pub(crate) fn sleep(bell: &AtomicU32, seen: u32, timeout: Option<Duration>) -> Slept {
    let timeout = timeout.map(timespec);
    let timeout = timeout.as_ref().map_or(std::ptr::null(), std::ptr::from_ref);
    // SAFETY: the word and the timeout outlive the call; FUTEX_WAIT reads both and writes neither.
    let result = unsafe { libc::syscall(libc::SYS_futex, bell.as_ptr(), libc::FUTEX_WAIT, seen, timeout) };
    if result < 0 && Errno::last() == Errno::EAGAIN { Slept::NotAtAll } else { Slept::Perhaps }
}

/// A time too long to be told is as good as for ever.
pub(crate) fn timespec(time: Duration) -> libc::timespec {
    libc::timespec {
        tv_sec: libc::time_t::try_from(time.as_secs()).unwrap_or(libc::time_t::MAX),
        tv_nsec: time.subsec_nanos() as _,
    }
}

/// Wakes all participants.
pub(crate) fn ring_all(node: &Node) {
    let there = |index: &u16| node.entry(*index).pid.load(Ordering::Relaxed) != 0;
    (0..PARTICIPANTS_MAX as u16).filter(there).for_each(|index| _ = ring(node, index));
}

/// Wakes the threads that sleep on this participant's bell, and keeps those from sleeping that are about to. Says
/// whether one slept there.
pub(crate) fn ring(node: &Node, participant: u16) -> bool {
    let bell = node.entry(participant).bell();
    // The word changes before the wake, else a sleeper that is just about to sleep would miss both.
    let polling = bell.ring();
    // SAFETY: FUTEX_WAKE only uses the address of the word, which is mapped.
    let woken = unsafe { libc::syscall(libc::SYS_futex, bell.rings.as_ptr(), libc::FUTEX_WAKE, i32::MAX) };
    if polling {
        write_to_pipe(node, participant);
    }
    woken > 0
}

/// What can go wrong does no harm: the sleeper is dead, its pipe gone, or so full that it will not sleep. Or we, or the
/// system, have no descriptor or memory left to open it with: then the sleeper sees the ring a little later by itself
/// (`PIPE_TRUSTED` in `watch`).
#[cold]
fn write_to_pipe(node: &Node, participant: u16) {
    step!("ring: before pipe");
    if let Ok(pipe) = open_pipe(node, participant) {
        let _ = write(&pipe, &[1]);
    }
    step!("ring: piped");
}

/// For reading and writing, both sides: so the sleeper is never told that the last writer has gone, and a ringer gets
/// no SIGPIPE for a sleeper that has.
fn open_pipe(node: &Node, participant: u16) -> nix::Result<OwnedFd> {
    let flags = OFlag::O_RDWR | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC | OFlag::O_NOFOLLOW;
    // By the directory's descriptor and on the stack: ringing takes nothing from the heap. What it is, is not asked: a
    // byte harms nothing that a user may leave there.
    with_name(participant, |name| openat(node.directory(), name, flags, Mode::empty()))
}

/// Makes the pipe of this participant, which is the caller.
pub(crate) fn make_pipe(node: &Node, participant: u16) -> io::Result<OwnedFd> {
    remove_pipe(node, participant);
    with_name(participant, |name| mkfifoat(node.directory(), name, Mode::S_IRUSR | Mode::S_IWUSR))?;
    step!("pipe: made");
    let pipe = open_pipe(node, participant)?;
    // The users that the directory lets in may ring.
    let around = Mode::from_bits_truncate(fstat(node.directory())?.st_mode & 0o666);
    fchmod(&pipe, around)?;
    Ok(pipe)
}

/// Removes it, if there is one.
pub(crate) fn remove_pipe(node: &Node, participant: u16) {
    // If it stays, the next participant at this place of the table removes it, or it goes with the directory.
    let _ = with_name(participant, |name| unlinkat(node.directory(), name, UnlinkatFlags::NoRemoveDir));
}

fn with_name<T>(participant: u16, then: impl FnOnce(&CStr) -> T) -> T {
    // Room for `bell.65535` and the end.
    let mut name = [0; 11];
    let written = write!(&mut name[..10], "bell.{participant}");
    debug_assert!(written.is_ok());
    then(CStr::from_bytes_until_nul(&name).unwrap_or_default())
}

/// Takes the bytes out that woke the sleeper, for a poller that was stopped under load up to a pipe full, 64 KiB. What
/// does not fit wakes it once more.
pub(crate) fn drain(pipe: &impl AsFd) {
    let _ = nix::unistd::read(pipe, &mut [0; 4096]);
}
