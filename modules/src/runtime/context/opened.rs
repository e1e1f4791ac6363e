//! Descriptors that a module has opened, told apart by their files.

use nix::libc;
use nix::sys::stat::{FileStat, fstat, stat};
use std::os::fd::{AsFd, AsRawFd, RawFd};

/// What is open.
const OPEN: &str = "/proc/self/fd";

/// A descriptor, and which file it is of.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct OpenedFile {
    pub(super) number: RawFd,
    device: libc::dev_t,
    inode: libc::ino_t,
}

impl OpenedFile {
    pub(super) fn of(descriptor: &impl AsFd) -> Option<Self> {
        let descriptor = descriptor.as_fd();
        let FileStat { st_dev: device, st_ino: inode, .. } = fstat(descriptor).ok()?;
        Some(Self { number: descriptor.as_raw_fd(), device, inode })
    }

    /// Whether the number is still that of the same file, as far as it can be told.
    pub(super) fn may_be_open(&self) -> bool {
        match stat(format!("{OPEN}/{}", self.number).as_str()) {
            Ok(found) => (found.st_dev, found.st_ino) == (self.device, self.inode),
            Err(_) => stat(OPEN).is_err(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;

    #[test]
    fn a_number_that_is_given_anew_is_of_another_file() {
        let first = File::open("/dev/null").unwrap();
        let opened = OpenedFile::of(&first).unwrap();
        assert!(opened.may_be_open() && OpenedFile::of(&first.try_clone().unwrap()) != Some(opened));
        let file = tempfile::tempfile().unwrap();
        let reused = OpenedFile { number: opened.number, ..OpenedFile::of(&file).unwrap() };
        assert!(reused != opened && !reused.may_be_open());
    }
}
