//! Network namespaces that are held by a descriptor alone.

use super::LabError;
use crate::netlink::Netlink;
use nix::errno::Errno;
use nix::sched::{CloneFlags, setns, unshare};
use nix::unistd::{getegid, geteuid};
use std::fs::File;
use std::io;
use std::marker::PhantomData;
use std::os::fd::{AsRawFd, RawFd};

/// A network namespace; it lives at least as long as this.
#[derive(Debug)]
pub(super) struct Namespace {
    file: File,
}

impl AsRawFd for Namespace {
    fn as_raw_fd(&self) -> RawFd {
        self.file.as_raw_fd()
    }
}

/// This thread is in the namespace of a node, until this is dropped.
#[derive(Debug)]
#[must_use = "the thread goes back at once when this is dropped"]
pub struct Inside {
    /// Where it comes from.
    outside: File,
    /// Belongs to this thread, and no other.
    _thread: PhantomData<*const ()>,
}

impl Drop for Inside {
    fn drop(&mut self) {
        // It was there before, and nothing that could forbid it has changed since: only a bug could make this fail, and
        // then all that this thread does from here on would go to the wrong network.
        setns(&self.outside, CloneFlags::CLONE_NEWNET)
            .expect("a thread goes back to the network namespace it came from");
    }
}

/// The namespace of this thread.
fn own() -> Result<File, LabError> {
    let path = "/proc/thread-self/ns/net";
    File::open(path).map_err(|error| LabError::Namespace(path, error))
}

impl Namespace {
    pub(super) fn new() -> Result<Self, LabError> {
        // A thread of its own makes it and ends: this one stays where it is.
        let make = || {
            unshare(CloneFlags::CLONE_NEWNET).map_err(|error| LabError::NotAllowed(error.into()))?;
            own()
        };
        let made = std::thread::scope(|scope| scope.spawn(make).join());
        let file = made.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        Ok(Self { file })
    }

    pub(super) fn enter(&self) -> Result<Inside, LabError> {
        let outside = own()?;
        setns(&self.file, CloneFlags::CLONE_NEWNET).map_err(|error| LabError::NotAllowed(error.into()))?;
        Ok(Inside { outside, _thread: PhantomData })
    }

    pub(super) fn netlink(&self) -> Result<Netlink, LabError> {
        let _inside = self.enter()?;
        Netlink::new().map_err(|error| LabError::Namespace("rtnetlink", error))
    }
}

/// Lets this process make labs: it does already as root; else it goes into a user namespace, in which it has the same
/// user and group and may make network namespaces. That is possible only before it has a second thread, so `main` calls
/// this first. Other groups of the user are lost in it, and so are rights of root that a program got by sudo later on.
///
/// # Errors
/// When users may make no namespaces here, or there is a second thread.
pub fn become_able() -> Result<(), LabError> {
    match Namespace::new() {
        Err(LabError::NotAllowed(error)) if error.kind() == io::ErrorKind::PermissionDenied => {}
        other => return other.map(drop),
    }
    let (user, group) = (geteuid(), getegid());
    // The network namespace, too: one may go back into one's own only if it belongs to one's own user namespace.
    unshare(CloneFlags::CLONE_NEWUSER | CloneFlags::CLONE_NEWNET).map_err(|error| match error {
        Errno::EINVAL => LabError::Threads,
        error => LabError::NotAllowed(error.into()),
    })?;
    let write =
        |path: &'static str, text: String| std::fs::write(path, text).map_err(|error| LabError::Namespace(path, error));
    write("/proc/self/setgroups", "deny".into())?;
    write("/proc/self/uid_map", format!("{user} {user} 1\n"))?;
    write("/proc/self/gid_map", format!("{group} {group} 1\n"))
}
