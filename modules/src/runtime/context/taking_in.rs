//! What a module takes in past its interfaces.

use super::Context;
use crate::journal::{Blob, Tag};
use std::io;

/// Kinds of errors that come back as they are; all others as [`io::ErrorKind::Other`].
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

/// An error: its place among the kinds, and its text.
type NotedError = (u8, String);

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
    /// Those of `read`. With a journal, now and in the replay, only the commonest kinds of errors stay what they are.
    pub fn take_in(&self, read: impl FnOnce() -> io::Result<Vec<u8>>) -> io::Result<Vec<u8>> {
        if self.journal.is_none() {
            return read();
        }
        if let Some(given) = self.journal.given(Tag::TakenIn) {
            let taken: Result<Blob<'_>, NotedError> = given.read();
            return taken.map(|bytes| bytes.0.to_vec()).map_err(error);
        }
        let taken = self.journal.apart(read).map_err(|error| noted(&error));
        self.journal.note(Tag::TakenIn, &taken.as_ref().map(|bytes| Blob(bytes)));
        taken.map_err(error)
    }
}

fn noted(error: &io::Error) -> NotedError {
    let kind = KINDS.iter().position(|kind| *kind == error.kind()).unwrap_or(KINDS.len());
    (kind as u8, error.to_string())
}

fn error((kind, text): NotedError) -> io::Error {
    io::Error::new(KINDS.get(usize::from(kind)).copied().unwrap_or(io::ErrorKind::Other), text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_come_back_with_their_kind_and_text() {
        for (code, kind) in KINDS.iter().enumerate() {
            let there = error(noted(&io::Error::new(*kind, "no")));
            assert_eq!((there.kind(), there.to_string()), (*kind, "no".into()), "{code}");
        }
        assert_eq!(error(noted(&io::Error::new(io::ErrorKind::AddrInUse, "busy"))).kind(), io::ErrorKind::Other);
    }
}
