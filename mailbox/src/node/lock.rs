//! Open-file-description locks: they tell which processes live.
//!
//! Not POSIX record locks, which vanish when any descriptor of the file closes. Files are opened close-on-exec, so a
//! started program does not keep them; a forked child without exec does, and then counts as alive. (fcntl(2),
//! F_OFD_SETLK)

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, fcntl};
use std::fs::File;
use std::io;
use std::ops::Range;

fn region(kind: i32, byte: u64) -> libc::flock {
    libc::flock {
        l_type: kind as libc::c_short,
        l_whence: libc::SEEK_SET as libc::c_short,
        l_start: byte as libc::off_t,
        l_len: 1,
        l_pid: 0,
    }
}

/// Locks one byte for this open file; false when another holds it.
pub(crate) fn try_lock(file: &File, byte: u64) -> io::Result<bool> {
    match fcntl(file, FcntlArg::F_OFD_SETLK(&region(libc::F_WRLCK, byte))) {
        Ok(_) => Ok(true),
        Err(Errno::EAGAIN | Errno::EACCES) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

/// Whether another open file holds the byte. `file` itself must hold none: a lock never stands in its own way.
pub(crate) fn is_locked(file: &File, byte: u64) -> io::Result<bool> {
    let mut answer = region(libc::F_WRLCK, byte);
    fcntl(file, FcntlArg::F_OFD_GETLK(&mut answer))?;
    Ok(i32::from(answer.l_type) != libc::F_UNLCK)
}

/// One byte of an open file, locked until this drops. Given back by name: closing the file alone would leave it locked
/// while a child that another thread is just starting still has a copy of the descriptor.
pub(crate) struct Held {
    pub(crate) file: File,
    byte: u64,
}

impl Held {
    /// None when another open file holds it.
    pub(crate) fn try_take(file: File, byte: u64) -> io::Result<Option<Self>> {
        Ok(try_lock(&file, byte)?.then_some(Self { file, byte }))
    }

    /// The first of these bytes that no other open file holds; none when others hold all.
    pub(crate) fn try_take_first(file: File, bytes: Range<u64>) -> io::Result<Option<Self>> {
        for byte in bytes {
            if try_lock(&file, byte)? {
                return Ok(Some(Self { file, byte }));
            }
        }
        Ok(None)
    }

    /// Which byte.
    pub(crate) fn byte(&self) -> u64 {
        self.byte
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        let _ = unlock(&self.file, self.byte);
    }
}

/// An open file, no lock of which outlives this; given back by name as those of [`Held`] are.
pub(crate) struct AllHeld(pub(crate) File);

impl Drop for AllHeld {
    fn drop(&mut self) {
        // From the first byte to wherever the last one is.
        let all = libc::flock { l_len: 0, ..region(libc::F_UNLCK, 0) };
        let _ = fcntl(&self.0, FcntlArg::F_OFD_SETLK(&all));
    }
}

/// Gives one byte back.
pub(crate) fn unlock(file: &File, byte: u64) -> io::Result<()> {
    fcntl(file, FcntlArg::F_OFD_SETLK(&region(libc::F_UNLCK, byte)))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A child that was forked meanwhile has a copy of the descriptor; it must not keep the locks.
    #[test]
    fn locks_are_given_back_although_a_copy_of_the_descriptor_is_open() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let open = || File::options().read(true).write(true).open(path.path()).unwrap();
        let other = open();
        let held = Held::try_take(open(), 3).unwrap().unwrap();
        let all = AllHeld(open());
        assert!([0, 255].map(|byte| try_lock(&all.0, byte).unwrap()).iter().all(|is_taken| *is_taken));
        let _copies = [held.file.try_clone().unwrap(), all.0.try_clone().unwrap()];
        let locked = || [0, 3, 255].map(|byte| is_locked(&other, byte).unwrap());
        assert_eq!(locked(), [true; 3]);
        drop(held);
        assert_eq!(locked(), [true, false, true]);
        drop(all);
        assert_eq!(locked(), [false; 3]);
    }
}
