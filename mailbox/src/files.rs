//! The files of a node's directory: opening them, giving them memory, and what the system's refusals mean.

use crate::layout::PAGE;
use std::fs::{self, File, OpenOptions};
use std::io::{self, IoSlice, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;

/// Opens a file of the node's directory, never through a link. A new file may be used by the users that the directory's
/// mode lets in.
pub(crate) fn open_shared(path: &Path, create: bool) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).mode(0o600).custom_flags(libc::O_CLOEXEC | libc::O_NOFOLLOW);
    if !create {
        return options.open(path);
    }
    match options.clone().create_new(true).open(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => options.open(path),
        Err(error) => Err(error),
        Ok(file) => {
            let around = path.parent().map_or(Ok(0o700), |folder| fs::metadata(folder).map(|found| found.mode()))?;
            // By the file, not by its name: neither the umask nor anybody else has a say.
            file.set_permissions(fs::Permissions::from_mode(around & 0o666))?;
            Ok(file)
        }
    }
}

/// The folder of this path, or the nearest around it that is there: what a person can look at when a node could not be
/// made.
pub(crate) fn existing(path: &Path) -> &Path {
    path.ancestors().find(|folder| folder.exists()).unwrap_or(path)
}

/// Opens a file of the node's directory to look at it: never through a link, never waiting for a pipe's other end.
pub(crate) fn open_to_read(path: &Path) -> io::Result<File> {
    let flags = libc::O_CLOEXEC | libc::O_NOFOLLOW | libc::O_NONBLOCK;
    OpenOptions::new().read(true).custom_flags(flags).open(path)
}

/// Gives a file its memory now: a full /dev/shm is an error here, not a bus error later. Written, since memory that is
/// only reserved (fallocate) is cleared page by page when it is mapped, which takes half as long again. Its position is
/// its beginning.
pub(crate) fn allocate(mut file: &File, bytes: usize) -> io::Result<()> {
    /// Pages that one call writes.
    const AT_ONCE: usize = 64;
    static ZEROES: [u8; PAGE] = [0; PAGE];
    let mut left = bytes;
    while left > 0 {
        let pages: [IoSlice<'_>; AT_ONCE] =
            std::array::from_fn(|at| IoSlice::new(&ZEROES[..left.saturating_sub(at * PAGE).min(PAGE)]));
        match file.write_vectored(&pages) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(written) => left -= written,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Whether it is about memory, and not about names, rights or descriptors. A limit of file sizes looks like a full file
/// system.
pub(crate) fn is_lack_of_memory(error: &io::Error) -> bool {
    use io::ErrorKind::{FileTooLarge, OutOfMemory, QuotaExceeded, StorageFull};
    matches!(error.kind(), FileTooLarge | OutOfMemory | QuotaExceeded | StorageFull)
}

/// Whether this process, or the computer, has as many files open as it may.
pub(crate) fn is_lack_of_descriptors(error: &io::Error) -> bool {
    matches!(error.raw_os_error(), Some(libc::EMFILE | libc::ENFILE))
}
