//! Files that are written durably, and files of others that are opened with care.

use crate::digest::{Sha256, copy_hashed};
use nix::libc::{O_NOFOLLOW, O_NONBLOCK};
use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};

/// Permissions of a program and of any other file.
const MODES: [u32; 2] = [0o755, 0o644];

/// What the system says of a file.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be {doing} ({error})", path.display())]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// What was tried: "read", "written" …
    pub doing: &'static str,
    /// What the system says.
    pub error: io::Error,
}

/// Says of which file an error is.
pub(crate) trait At<T> {
    fn at(self, doing: &'static str, path: &Path) -> Result<T, FileError>;
}

impl<T> At<T> for io::Result<T> {
    fn at(self, doing: &'static str, path: &Path) -> Result<T, FileError> {
        self.map_err(|error| FileError { path: path.to_owned(), doing, error })
    }
}

/// Opens a regular file. A link is not followed, a pipe is not waited for.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().read(true).custom_flags(O_NOFOLLOW | O_NONBLOCK).open(path)?;
    let is_file = file.metadata()?.is_file();
    is_file.then_some(file).ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "it is no regular file"))
}

/// Reads a small regular file, up to one byte more than `most`.
pub(crate) fn read(path: &Path, most: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(most as u64 + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Digest and length of a regular file.
pub(crate) fn hash(path: &Path) -> io::Result<(u64, Sha256)> {
    copy_hashed(&mut open(path)?, &mut io::sink())
}

/// Writes a new file durably, all that a reader gives, and the folders above it; length and digest of what was written.
pub(crate) fn write(from: &mut (impl Read + ?Sized), to: &Path, executable: bool) -> Result<(u64, Sha256), FileError> {
    if let Some(folder) = to.parent() {
        make_folder(folder)?;
    }
    let written = File::create_new(to).and_then(|mut file| {
        let written = copy_hashed(from, &mut file)?;
        // The umask may have removed permissions.
        file.set_permissions(Permissions::from_mode(MODES[usize::from(!executable)]))?;
        file.sync_all()?;
        Ok(written)
    });
    written.at("written", to)
}

/// Replaces a file in one durable step: a reader gets the old one or the new one.
pub(crate) fn replace(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let beside = path.with_extension("new");
    remove(&beside)?;
    write(&mut &bytes[..], &beside, false)?;
    rename(&beside, path)
}

/// Makes a symbolic link, or leads it elsewhere, in one durable step.
pub(crate) fn link(target: &str, path: &Path) -> Result<(), FileError> {
    let beside = path.with_extension("new");
    remove(&beside)?;
    symlink(target, &beside).at("made", &beside)?;
    rename(&beside, path)
}

/// Renames a file or a folder; durable in both folders.
pub(crate) fn rename(from: &Path, to: &Path) -> Result<(), FileError> {
    fs::rename(from, to).at("renamed", from)?;
    [to, from].into_iter().filter_map(Path::parent).try_for_each(sync_folder)
}

/// Makes a folder, and those above it.
pub(crate) fn make_folder(path: &Path) -> Result<(), FileError> {
    DirBuilder::new().recursive(true).mode(0o755).create(path).at("made", path)
}

/// Names in a folder survive a power cut from now on.
pub(crate) fn sync_folder(path: &Path) -> Result<(), FileError> {
    File::open(path).and_then(|folder| folder.sync_all()).at("written", path)
}

/// Makes a folder durable with all in it. Also files: one that is complete may be so in memory only, if the process
/// that wrote it was killed.
pub(crate) fn sync_tree(folder: &Path) -> Result<(), FileError> {
    for entry in entries(folder)? {
        let there = fs::symlink_metadata(&entry).at("read", &entry)?;
        if there.is_dir() {
            sync_tree(&entry)?;
        } else if there.is_file() {
            open(&entry).and_then(|file| file.sync_all()).at("written", &entry)?;
        }
    }
    sync_folder(folder)
}

/// Removes whatever is there, without following links.
pub(crate) fn remove(path: &Path) -> Result<(), FileError> {
    let removed = match fs::symlink_metadata(path) {
        Ok(there) if there.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(error) => Err(error),
    };
    match removed {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error).at("removed", path),
        _ => Ok(()),
    }
}

/// What is in a folder, in the order of names; nothing if there is no such folder.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let read = match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        read => read.and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()),
    };
    let mut found = read.at("read", folder)?;
    found.sort();
    Ok(found)
}
