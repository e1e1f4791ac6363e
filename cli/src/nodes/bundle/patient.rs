//! The standard input of `rohrpost bundle receive`, which a lost connection may leave open without an end.

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::os::fd::AsFd;

/// A push that sends nothing for so long has failed, and lets others push.
const SILENCE_MAX_MS: u16 = 60_000;

/// Reads a pipe or a socket as long as something comes in time.
pub(super) struct Patient {
    from: File,
    silence_max: PollTimeout,
}

impl Patient {
    /// The standard input.
    pub(super) fn stdin() -> io::Result<Self> {
        Ok(Self { from: io::stdin().as_fd().try_clone_to_owned()?.into(), silence_max: SILENCE_MAX_MS.into() })
    }
}

impl Read for Patient {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match poll(&mut [PollFd::new(self.from.as_fd(), PollFlags::POLLIN)], self.silence_max)? {
            0 => Err(io::Error::new(ErrorKind::TimedOut, "the other end has sent nothing for a minute")),
            _ => self.from.read(bytes),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::os::fd::OwnedFd;

    #[test]
    fn it_reads_what_comes_and_gives_up_when_nothing_does() {
        let (reader, mut writer) = io::pipe().unwrap();
        let mut patient = Patient { from: OwnedFd::from(reader).into(), silence_max: PollTimeout::from(10_u16) };
        let mut bytes = [0; 8];
        writer.write_all(b"bundle").unwrap();
        assert_eq!(patient.read(&mut bytes).unwrap(), 6);
        assert_eq!(patient.read(&mut bytes).unwrap_err().kind(), ErrorKind::TimedOut);
        drop(writer);
        assert_eq!(patient.read(&mut bytes).unwrap(), 0);
    }
}
