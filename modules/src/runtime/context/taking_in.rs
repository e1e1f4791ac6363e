//! What a module takes in and gives out past its interfaces.

use super::Context;
use crate::journal::{Blob, NotedValue, Question, Tag};
use serde::{Deserialize, Serialize};
use std::io;

/// Kinds of errors, besides those of the system, that come back as they are; all others as [`io::ErrorKind::Other`].
const KINDS: [io::ErrorKind; 12] = [
    io::ErrorKind::NotFound,
    io::ErrorKind::PermissionDenied,
    io::ErrorKind::ConnectionRefused,
    io::ErrorKind::ConnectionReset,
    io::ErrorKind::BrokenPipe,
    io::ErrorKind::WouldBlock,
    io::ErrorKind::InvalidInput,
    io::ErrorKind::InvalidData,
    io::ErrorKind::TimedOut,
    io::ErrorKind::Interrupted,
    io::ErrorKind::UnexpectedEof,
    io::ErrorKind::OutOfMemory,
];

/// An error, as a journal has it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) enum NotedError {
    /// The system's number of it.
    System(i32),
    /// Its place among the kinds, and its text.
    Other(u8, String),
}

impl Context {
    /// Takes in something from outside that comes by none of the module's interfaces: bytes of a device, of a file that
    /// changes, of chance. They are noted in the module's journal, if it has one. In an exact replay `read` is not
    /// called, and this returns what it returned then; so let nothing else of it get out, and ask
    /// nothing of the context in it.
    ///
    /// ```
    /// # use rohrpost_modules::{ModuleError, runtime::Context};
    /// fn temperature_mc(context: &Context) -> Result<i32, ModuleError> {
    ///     let path = "/sys/class/thermal/thermal_zone0/temp";
    ///     let text = context.take_in(|| std::fs::read(path))?;
    ///     Ok(String::from_utf8_lossy(&text).trim().parse()?)
    /// }
    /// ```
    ///
    /// # Errors
    /// Those of `read`. With a journal, now and in the replay, of errors that are not the system's own only the
    /// commonest kinds stay what they are.
    pub fn take_in(&self, read: impl FnOnce() -> io::Result<Vec<u8>>) -> io::Result<Vec<u8>> {
        if self.journal.is_none() {
            return read();
        }
        if let Some(given) = self.journal.given(Tag::TakenIn, Question::Plain) {
            let taken: Result<Blob<'_>, NotedError> = given.read();
            return Ok(taken?.0.to_vec());
        }
        let taken = self.journal.apart(read).map_err(|error| NotedError::of(&error));
        self.journal.note(Tag::TakenIn, Question::Plain, &taken.as_ref().map(|bytes| Blob(bytes)));
        Ok(taken?)
    }

    /// The same into memory that the module has, as `read` of a descriptor has it: how many bytes came. Takes nothing
    /// from the heap. With a journal, the room behind these bytes is zeroed, now and in the replay; all of it when it
    /// fails.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// # use std::io::Read;
    /// fn come(context: &Context, port: &mut std::fs::File, bytes: &mut [u8; 64]) -> std::io::Result<usize> {
    ///     context.take_in_to(bytes, |bytes| port.read(bytes))
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Context::take_in`].
    pub fn take_in_to(&self, room: &mut [u8], read: impl FnOnce(&mut [u8]) -> io::Result<usize>) -> io::Result<usize> {
        if self.journal.is_none() {
            return read(room);
        }
        let question = Question::Room(room.len() as u64);
        if let Some(given) = self.journal.given(Tag::TakenIn, question) {
            let taken: Result<Blob<'_>, NotedError> = given.read();
            let bytes = taken.as_ref().map_or(&[][..], |blob| blob.0);
            let count = bytes.len().min(room.len());
            room[..count].copy_from_slice(&bytes[..count]);
            room[count..].fill(0);
            return Ok(taken.map(|_| count)?);
        }
        let taken = self.journal.apart(|| read(&mut *room)).map_err(|error| NotedError::of(&error));
        // More than there is room for has come into no memory of the module.
        let taken = taken.map(|count| count.min(room.len()));
        room[*taken.as_ref().unwrap_or(&0)..].fill(0);
        self.journal.note(Tag::TakenIn, question, &taken.as_ref().map(|count| Blob(&room[..*count])));
        Ok(taken?)
    }

    /// Gives something out past the module's interfaces: writes to a device. In an exact replay `write` is not called;
    /// the bytes are compared, and this returns what it returned then.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// # use std::io::Write;
    /// fn ask(context: &Context, port: &mut std::fs::File) -> std::io::Result<usize> {
    ///     context.give_out(b"*IDN?\n", |bytes| port.write(bytes))
    /// }
    /// ```
    ///
    /// # Errors
    /// As for [`Context::take_in`].
    pub fn give_out(&self, bytes: &[u8], write: impl FnOnce(&[u8]) -> io::Result<usize>) -> io::Result<usize> {
        if self.journal.is_none() {
            return write(bytes);
        }
        self.journal.output(Tag::GaveOut, &NotedValue::of(bytes));
        let write = || self.journal.apart(|| write(bytes)).map_err(|error| NotedError::of(&error));
        let written: Result<usize, NotedError> = self.journal.answer(Tag::Accepted, Question::Plain, write);
        Ok(written?)
    }
}

impl NotedError {
    pub(super) fn of(error: &io::Error) -> Self {
        if let Some(number) = error.raw_os_error() {
            return Self::System(number);
        }
        let kind = KINDS.iter().position(|kind| *kind == error.kind()).unwrap_or(KINDS.len());
        Self::Other(kind as u8, error.to_string())
    }
}

impl From<NotedError> for io::Error {
    fn from(error: NotedError) -> Self {
        match error {
            NotedError::System(number) => Self::from_raw_os_error(number),
            NotedError::Other(kind, text) => {
                Self::new(KINDS.get(usize::from(kind)).copied().unwrap_or(io::ErrorKind::Other), text)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_come_back_with_their_kind_and_text() {
        let there = |error: &io::Error| io::Error::from(NotedError::of(error));
        for kind in KINDS {
            let error = there(&io::Error::new(kind, "no"));
            assert_eq!((error.kind(), error.to_string()), (kind, "no".into()));
        }
        let busy = io::Error::new(io::ErrorKind::AddrInUse, "busy");
        assert_eq!(there(&busy).kind(), io::ErrorKind::Other);
        let system = io::Error::from_raw_os_error(nix::libc::EADDRINUSE);
        let error = there(&system);
        assert_eq!((error.raw_os_error(), error.to_string()), (system.raw_os_error(), system.to_string()));
    }
}
