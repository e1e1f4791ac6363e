//! What ends a module's process from outside of its loop: a signal, the death of its launch, the end of its lease. And
//! what a module waits for that stands by: the beginning of its lease.

use super::error::StartError;
use crate::output;
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::prctl::set_pdeathsig;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_mailbox::{Participant, sys};
use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Priority (FIFO) of the thread that ends a process with its lease: above all modules, where the user has the right.
const LEASE_PRIORITY: u8 = 99;
/// For a process that is ended by force to say so.
const LAST_WORDS: Duration = Duration::from_millis(20);

/// Ends this process when launch dies, whatever killed it: no orphan drives a robot.
pub(super) fn die_with_launch(launcher: Option<u32>) -> Result<(), StartError> {
    let Some(launcher) = launcher else { return Ok(()) };
    set_pdeathsig(Some(Signal::SIGTERM)).map_err(|error| StartError::System("prctl", error.into()))?;
    // It may have died before the call above.
    if nix::unistd::getppid().as_raw().unsigned_abs() == launcher {
        return Ok(());
    }
    // A program that launch started runs this one, and the kernel tells of that program's end alone.
    let found = sys::Ancestor::find(launcher).map_err(|error| StartError::System("pidfd_open", error))?;
    let launch = found.ok_or(StartError::Orphan(launcher))?;
    let watch = move || {
        launch.wait_end();
        // Of ourselves: it cannot fail.
        let _ = kill(Pid::this(), Signal::SIGTERM);
    };
    let spawned = std::thread::Builder::new().name("launch".into()).spawn(watch);
    spawned.map(drop).map_err(|error| StartError::System("a thread that watches launch", error))
}

/// Ends this process when launch's timer says that its node does not hold the module's lease any more. Launch sets the
/// timer anew as long as the node does. The result becomes true, and the participant is rung, when the node begins to
/// hold it.
pub(super) fn end_with_lease(participant: &Arc<Participant>, off: Duration) -> Result<Arc<AtomicBool>, StartError> {
    let failed = |error| StartError::System("the event and the timer of its lease", error);
    let mut kept = sys::handed_on();
    let (timer, event) = (kept.pop(), kept.pop());
    let (event, timer) = event.zip(timer).ok_or_else(|| failed(std::io::ErrorKind::NotFound.into()))?;
    let holds = Arc::new(AtomicBool::new(is_there(&event, PollTimeout::ZERO)));
    let (begun, participant) = (holds.clone(), participant.clone());
    let wait = move || {
        // Without the right the thread is an ordinary one, and launch kills what is late.
        let _ = sys::schedule(sys::Scheduling::Fifo(LEASE_PRIORITY));
        while !is_there(&event, PollTimeout::NONE) {}
        begun.store(true, Ordering::Release);
        participant.ring();
        let mut expirations = [0; 8];
        while let Err(Errno::EINTR) = nix::unistd::read(&timer, &mut expirations) {}
        // To the safe state, if the module's own code lets it.
        let _ = kill(Pid::this(), Signal::SIGTERM);
        std::thread::sleep(off);
        signal_hook::low_level::exit(1);
    };
    std::thread::Builder::new().name("lease".into()).spawn(wait).map_err(failed)?;
    Ok(holds)
}

/// Whether launch's event is there, at the latest after this time.
fn is_there(event: &OwnedFd, within: PollTimeout) -> bool {
    let mut events = [PollFd::new(event.as_fd(), PollFlags::POLLIN)];
    poll(&mut events, within).is_ok_and(|ready| ready > 0)
}

/// Signals that ask a process to end: SIGTERM, SIGINT, and SIGHUP unless it was started to ignore that, as by `nohup`.
pub fn stop_signals() -> impl Iterator<Item = i32> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    [SIGTERM, SIGINT, SIGHUP].into_iter().filter(|signal| *signal != SIGHUP || !sys::ignores(SIGHUP))
}

/// On a signal to stop: ask the loop to end; if it does not within the time, end the process. SIGHUP is how the kernel
/// wakes a stopped module after its launch has died.
pub(super) fn stop_on_signals(participant: &Arc<Participant>, within: Duration) -> Result<Arc<AtomicBool>, StartError> {
    let mut signals = signal_hook::iterator::Signals::new(stop_signals())
        .map_err(|error| StartError::System("signal handlers", error))?;
    let stop = Arc::new(AtomicBool::new(false));
    let (flag, participant) = (stop.clone(), participant.clone());
    let wait = move || {
        if signals.forever().next().is_some() {
            flag.store(true, Ordering::Release);
            participant.ring();
            std::thread::sleep(within);
            // A module that hangs may hang while it prints; then nobody else can, and the end must not wait for that.
            let say = move || output::print(&format_args!("does not stop within {within:?}; ended"));
            let _ = std::thread::Builder::new().spawn(say);
            std::thread::sleep(LAST_WORDS);
            // At once: destructors and `atexit` of C would run beside the module, which still works.
            signal_hook::low_level::exit(1);
        }
    };
    std::thread::Builder::new()
        .name("signals".into())
        .spawn(wait)
        .map_err(|error| StartError::System("a thread for signals", error))?;
    Ok(stop)
}
