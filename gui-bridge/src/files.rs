//! The files that a drawing is written to: one that is full, or was there before, becomes `NAME.old.rrd`.

use crate::sink::OpenError;
use std::cell::Cell;
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// A file that was torn, because the disk was full, is put aside if it is larger than this, in place of the older one.
/// A smaller one holds little but what the next begins with, and is written over: one attempt after the other must not
/// push out what is worth something.
pub(crate) const WORTH: u64 = 8 * 1024 * 1024;

/// Where it is put aside.
fn old(path: &Path) -> PathBuf {
    path.with_extension("old.rrd")
}

/// Makes an empty file; one that is there is put aside if it has so many bytes.
pub(crate) fn begin(path: &Path, aside_from: u64) -> Result<(), OpenError> {
    if path.metadata().is_ok_and(|file| file.is_file() && file.len() >= aside_from) {
        let old = old(path);
        if let Err(cause) = fs::rename(path, &old) {
            return Err(OpenError::PutAside { path: path.into(), old, cause });
        }
        tracing::info!("what was in {} is in {} now; a new drawing begins", path.display(), old.display());
    }
    // Rerun makes it, too, but does not tell errors of the system apart.
    let made = File::create(path);
    made.map(drop).map_err(|cause| OpenError::File { path: path.into(), cause })
}

/// Whether it has its last mark, which Rerun writes at the very end. It tells nobody when that fails.
pub(crate) fn is_whole(path: &Path) -> bool {
    const TAIL: i64 = 32;
    let tail = || -> io::Result<Vec<u8>> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::End(-TAIL))?;
        let mut tail = Vec::new();
        file.read_to_end(&mut tail)?;
        Ok(tail)
    };
    // What is no file, such as a pipe, is not asked.
    let is_file = path.metadata().is_ok_and(|file| file.is_file());
    !is_file || tail().is_ok_and(|tail| tail.windows(4).any(|mark| mark == b"FOOT"))
}

/// How large a file may become.
pub(crate) struct Room<'a> {
    path: &'a Path,
    bytes_max: u64,
    /// What it had when all was in it that was known at its beginning.
    first: Cell<Option<u64>>,
}

impl<'a> Room<'a> {
    pub(crate) fn new(path: &'a Path, bytes_max: u64) -> Self {
        Self { path, bytes_max, first: Cell::new(None) }
    }

    /// Whether it is full. One that holds little but what each begins with is not, or the next one would be full at
    /// once, and the one after that: it has to become twice as large first.
    pub(crate) fn is_full(&self, has_repeated: bool) -> bool {
        let Ok(bytes) = self.path.metadata().map(|file| file.len()) else { return false };
        if self.first.get().is_none() && has_repeated {
            self.first.set(Some(bytes));
        }
        self.first.get().is_some_and(|first| bytes >= self.bytes_max.max(first.saturating_mul(2)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_full_when_more_is_in_it_than_it_began_with() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.rrd");
        let write = |bytes: usize| fs::write(&path, vec![0; bytes]).unwrap();
        let room = Room::new(&path, 100);
        assert!(!room.is_full(false), "there is none");
        write(400);
        assert!(!room.is_full(false), "what is known is still being written");
        assert!(!room.is_full(true) && !room.is_full(true), "now it is, and nothing else yet");
        write(799);
        assert!(!room.is_full(true));
        write(800);
        assert!(room.is_full(true));
        write(10);
        let room = Room::new(&path, 100);
        assert!(!room.is_full(true));
        write(100);
        assert!(room.is_full(true));
    }

    #[test]
    fn what_was_there_is_put_aside_if_it_is_worth_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.rrd");
        let old = || fs::read_to_string(folder.path().join("a.old.rrd")).ok();
        begin(&path, 1).unwrap();
        begin(&path, 1).unwrap();
        assert_eq!(old(), None, "an empty one is worth nothing");
        fs::write(&path, "yesterday").unwrap();
        begin(&path, 1).unwrap();
        assert_eq!(old().as_deref(), Some("yesterday"));
        assert_eq!(path.metadata().unwrap().len(), 0);
        fs::write(&path, "torn").unwrap();
        begin(&path, 5).unwrap();
        assert_eq!(old().as_deref(), Some("yesterday"));
        assert_eq!(path.metadata().unwrap().len(), 0);
    }

    #[test]
    fn a_file_without_its_end_is_not_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.rrd");
        fs::write(&path, "RRF2 and so on, but not to the end of it all").unwrap();
        assert!(!is_whole(&path));
        fs::write(&path, "short").unwrap();
        assert!(!is_whole(&path));
        assert!(is_whole(Path::new("/dev/null")), "what is no file has no end");
    }
}
