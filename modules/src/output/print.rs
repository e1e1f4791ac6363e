//! What this process writes to its standard error: its reader may be gone, or stopped, and neither is a reason to panic
//! or to wait.

use super::{SENT, TRACED};
use crate::common::OutputLevel;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use std::fmt::Display;
use std::fs::File;
use std::io::{Stderr, Write, stderr};
use std::os::fd::{AsFd, AsRawFd};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::sync::{Mutex, OnceLock};

/// A pipe takes so many bytes whole, or none of them (PIPE_BUF of Linux).
const WHOLE_BYTES: usize = 4096;

/// Which lines are printed as well.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Print {
    /// All: a person at the terminal started it.
    All,
    /// What launch repeats when the process ends: errors. Those that were sent are marked.
    Errors,
    /// None.
    Nothing,
}

impl Print {
    /// A line that begins its way.
    pub(super) fn said(self, level: OutputLevel, text: &str) {
        if self == Self::All {
            print(&format_args!("{:5} {text}", level.name()));
        }
    }

    /// A line that is in the collector's mailbox.
    pub(super) fn sent(self, level: OutputLevel, text: &str) {
        if self.repeats(level) {
            print(&marked(level, text));
        }
    }

    /// A line that never will be: launch passes it on.
    pub(super) fn lost(self, level: OutputLevel, text: &str) {
        if self.repeats(level) {
            print(&format_args!("{:5} {text}", level.name()));
        }
    }

    /// A line of where a panic came from: for the terminal, once, and no line of output.
    pub(super) fn traced(self, line: &str) {
        match self {
            Self::All => print(&line),
            Self::Errors => print(&format_args!("{TRACED}{line}")),
            Self::Nothing => {}
        }
    }

    fn repeats(self, level: OutputLevel) -> bool {
        self == Self::Errors && level == OutputLevel::Error
    }
}

/// Each line of it: launch reads line by line.
fn marked(level: OutputLevel, text: &str) -> String {
    format!("{SENT}{:5} {text}", level.name()).replace('\n', &format!("\n{SENT}"))
}

/// Prints a line to standard error, as far as that takes it at once; the rest is dropped.
pub(crate) fn print(line: &dyn Display) {
    static ERROR: OnceLock<WriteMode> = OnceLock::new();
    let (text, stderr) = (format!("{line}\n"), stderr());
    let way = ERROR.get_or_init(|| WriteMode::to(&stderr));
    let mut rest = text.as_bytes();
    while !rest.is_empty() {
        let (part, behind) = rest.split_at(whole(rest));
        if !way.take(part, &stderr) {
            return;
        }
        rest = behind;
    }
}

/// How much of it is written at a time: as many lines as a pipe takes whole.
fn whole(text: &[u8]) -> usize {
    let most = &text[..text.len().min(WHOLE_BYTES)];
    most.iter().rposition(|byte| *byte == b'\n').map_or(most.len(), |end| end + 1)
}

/// How to write without waiting.
enum WriteMode {
    /// A pipe or a terminal, opened anew: writes to this description never wait. The one that standard error has is
    /// shared with other processes, and with all that print with the standard library; those may expect that theirs do.
    Again(File),
    /// A file: it has room or an error, and nobody to wait for. Opened anew it would be written from another place.
    File,
    /// What cannot be opened anew, such as a socket: by one thread at a time, and only when there is room.
    InTurn(Mutex<()>),
}

impl WriteMode {
    fn to(stderr: &impl AsFd) -> Self {
        let kind = stderr.as_fd().try_clone_to_owned().and_then(|fd| File::from(fd).metadata());
        let Ok(kind) = kind.map(|metadata| metadata.file_type()) else { return Self::InTurn(Mutex::default()) };
        if kind.is_file() {
            return Self::File;
        }
        let path = format!("/proc/self/fd/{}", stderr.as_fd().as_raw_fd());
        let flags = nix::libc::O_NONBLOCK | nix::libc::O_NOCTTY;
        match File::options().write(true).custom_flags(flags).open(path) {
            Ok(file) if kind.is_fifo() || kind.is_char_device() => Self::Again(file),
            _ => Self::InTurn(Mutex::default()),
        }
    }

    /// Whether it took all of it.
    fn take(&self, bytes: &[u8], stderr: &Stderr) -> bool {
        // Not through the standard library's `Stderr`: its lock may be held by a thread that waits for room.
        let write = || nix::unistd::write(stderr.as_fd(), bytes).ok();
        let written = match self {
            Self::Again(file) => (&mut &*file).write(bytes).ok(),
            Self::File => write(),
            Self::InTurn(turn) => {
                let Ok(_turn) = turn.try_lock() else { return false };
                let mut room = [PollFd::new(stderr.as_fd(), PollFlags::POLLOUT)];
                poll(&mut room, PollTimeout::ZERO).is_ok_and(|ready| ready > 0).then(write).flatten()
            }
        };
        written == Some(bytes.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    #[test]
    fn each_line_of_a_text_is_marked() {
        assert_eq!(marked(OutputLevel::Error, "a\nb"), "\u{1e}error a\n\u{1e}b");
    }

    #[test]
    fn long_texts_are_written_in_whole_lines() {
        assert_eq!((whole(b"a\nb\n"), whole(&[b'x'; 5000])), (4, WHOLE_BYTES));
        let mut text = vec![b'x'; 5000];
        text[4000] = b'\n';
        assert_eq!(whole(&text), 4001);
    }

    /// The other end reads nothing: threads that write at the same time all return, and no line is torn.
    #[test]
    fn a_full_pipe_keeps_nobody() {
        let (mut pipe, writer) = std::io::pipe().unwrap();
        let way = WriteMode::to(&writer);
        assert!(matches!(way, WriteMode::Again(_)));
        let line = format!("{}\n", "x".repeat(99));
        let flood = || (0..10_000).filter(|_| way.take(line.as_bytes(), &stderr())).count();
        let taken: usize = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..3).map(|_| scope.spawn(flood)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).sum()
        });
        assert!((1..30_000).contains(&taken), "{taken} lines were taken by a pipe that nobody reads");
        drop((way, writer));
        let mut text = String::new();
        pipe.read_to_string(&mut text).unwrap();
        assert!(text.len() == taken * line.len() && text.lines().all(|read| read.len() == 99));
    }

    #[test]
    fn a_socket_that_cannot_be_opened_anew_is_written_when_it_has_room() {
        let (_reads, writes) = std::os::unix::net::UnixStream::pair().unwrap();
        assert!(matches!(WriteMode::to(&writes), WriteMode::InTurn(_)));
        let file = tempfile::tempfile().unwrap();
        assert!(matches!(WriteMode::to(&file), WriteMode::File));
    }
}
