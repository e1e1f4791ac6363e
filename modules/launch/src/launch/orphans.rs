//! Orphans: a process that loses its parent gets launch as one, if launch is process 1 of a container, or a child
//! subreaper.

use nix::sys::prctl::get_child_subreaper;
use nix::sys::wait::{WaitPidFlag, waitpid};
use nix::unistd::Pid;
use rohrpost_mailbox::sys;

/// Asks for the end of all that have ended, so that no zombies are left. `is_own`: its starter waits for this one, and
/// does so now that it has ended.
pub fn reap_orphans(is_own: impl Fn(u32) -> bool) {
    if std::process::id() != 1 && !get_child_subreaper().unwrap_or(false) {
        return;
    }
    // One of our own stands in front of others until it is waited for; they are found at the next look then.
    while let Ok(Some(ended)) = sys::ended_child(None)
        && !is_own(ended)
    {
        // How it ended concerns nobody.
        let _ = waitpid(Pid::from_raw(ended.cast_signed()), Some(WaitPidFlag::WNOHANG));
    }
}
