//! The incarnation, which rises with each start without a clock: a note of it that survives this process.
//!
//! A robot that has lost its note hears from teammates which incarnation it had, and goes above it.

use rohrpost_mailbox::{Node, node_directory};
use rohrpost_modules::runtime::Context;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::PathBuf;

/// Where the note is.
enum Place {
    /// A file of the node's directory, which is memory: it lasts as long as the node runs.
    Node(PathBuf, String),
    /// A file that survives a restart of the computer.
    File(PathBuf),
}

pub(crate) struct Store {
    place: Place,
    kept: Option<u32>,
    /// Whether it was told that nothing can be kept.
    has_failed: bool,
}

impl Store {
    /// The note, and the incarnation that begins now.
    pub(crate) fn open(file: Option<&str>, context: &Context) -> (Self, u32) {
        let installation = context.installation();
        let name = installation.classes.format(context.me());
        let place = match file {
            Some(file) => Place::File(installation.resolve(file)),
            None => {
                let on = installation.module(context.me()).map(|module| module.node.as_str()).unwrap_or_default();
                Place::Node(node_directory(&installation.name, on), format!("incarnation-{name}"))
            }
        };
        let kept = match context.take_in(|| place.read()) {
            Ok(bytes) => read(&bytes).unwrap_or_else(|| {
                tracing::warn!("the note of the incarnation, {place}, is none; teammates tell which it was");
                0
            }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => 0,
            Err(error) => {
                tracing::warn!("the note of the incarnation, {place}, cannot be read ({error}); teammates tell it");
                0
            }
        };
        let (mut store, incarnation) = (Self { place, kept: None, has_failed: false }, kept.saturating_add(1));
        store.keep(context, incarnation);
        (store, incarnation)
    }

    /// Notes an incarnation, if it is another one.
    pub(crate) fn keep(&mut self, context: &Context, incarnation: u32) {
        if self.kept == Some(incarnation) {
            return;
        }
        let write = |bytes: &[u8]| self.place.write(bytes).map(|()| bytes.len());
        match context.give_out(format!("{incarnation}\n").as_bytes(), write) {
            Ok(_) => (self.kept, self.has_failed) = (Some(incarnation), false),
            Err(error) if !self.has_failed => {
                self.has_failed = true;
                tracing::error!("the incarnation would not survive this process: {}: {error}", self.place);
            }
            Err(_) => {}
        }
    }
}

/// A number in decimal digits, and the end of the line.
fn read(bytes: &[u8]) -> Option<u32> {
    str::from_utf8(bytes).ok()?.strip_suffix('\n')?.parse().ok()
}

impl Place {
    fn read(&self) -> io::Result<Vec<u8>> {
        match self {
            Self::Node(directory, file) => {
                let read = Node::open(directory).and_then(|node| node.read_file(file));
                read.map_err(io::Error::other)?.ok_or_else(|| io::ErrorKind::NotFound.into())
            }
            Self::File(path) => fs::read(path),
        }
    }

    /// The note appears whole, and is on the disk then.
    fn write(&self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Node(directory, file) => {
                Node::open(directory).and_then(|node| node.put_file(file, bytes)).map_err(io::Error::other)
            }
            Self::File(path) => {
                let unfinished = path.with_added_extension("new");
                let mut file = File::create(&unfinished)?;
                file.write_all(bytes)?;
                file.sync_all()?;
                fs::rename(unfinished, path)
            }
        }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Node(directory, file) => directory.join(file).display().fmt(f),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_note_is_read_whole_or_not_at_all() {
        for (bytes, note) in
            [(&b"7\n"[..], Some(7)), (b"7", None), (b"-1\n", None), (b"4294967296\n", None), (b"\xff\n", None)]
        {
            assert_eq!(read(bytes), note);
        }
    }

    #[test]
    fn a_file_keeps_the_newest_incarnation() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::File(folder.path().join("team.incarnation"));
        assert_eq!(place.read().unwrap_err().kind(), io::ErrorKind::NotFound);
        place.write(b"1\n").unwrap();
        place.write(b"2\n").unwrap();
        assert_eq!(read(&place.read().unwrap()), Some(2));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
