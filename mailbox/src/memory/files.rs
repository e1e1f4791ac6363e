//! The files of a node's directory: all are opened, made, named and removed here, and nowhere else. What the system's
//! refusals mean.
//!
//! A name says nothing of what has it: another user may have made the directory, and a user that its mode lets in may
//! put a link or a pipe there. So the directory is opened first and its owner asked, then each file relative to it:
//! never through a link, never waiting for a pipe's other end, and used only if it is a file of a user that may write
//! there. A file that appears whole is made exclusively under another name before.

use crate::memory::layout::PAGE;
use crate::step::step;
use nix::errno::Errno;
use nix::fcntl::{OFlag, openat, renameat};
use nix::sys::stat::Mode;
use nix::unistd::{UnlinkatFlags, getuid, unlinkat};
use std::fs::{self, DirBuilder, File, Metadata, OpenOptions};
use std::io::{self, IoSlice, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

/// What is longer is nothing that a process reads whole.
const WHOLE_BYTES_MAX: u64 = 1 << 20;
/// Permission to write for others than the owner, which lets them leave files.
const OTHERS_WRITE: u32 = 0o022;

/// Why what stands somewhere is not used, though the system lets us.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Unfit {
    /// A pipe, say.
    #[error("it is {0}, not a file; end what uses the node, and remove it")]
    Kind(&'static str),
    /// Of a user that has nothing to say here: its path and that user.
    #[error("{0} belongs to user {1}, which may not write there; remove it")]
    Foreign(PathBuf, u32),
    /// A directory that is to go, and has files: they may be somebody's.
    #[error("it is a directory with files in it; see what they are, and remove it: rm -r {0}")]
    Full(PathBuf),
}

impl Unfit {
    /// What a function of this file said, if it was not the system.
    pub(crate) fn of(error: &io::Error) -> Option<&Self> {
        error.get_ref()?.downcast_ref()
    }

    /// What stands there, if it is no file at all, and nobody's loss.
    pub(crate) fn kind(error: &io::Error) -> Option<&'static str> {
        if let Some(Self::Kind(kind)) = Self::of(error) { Some(kind) } else { None }
    }

    /// Whether it is no file at all.
    pub(crate) fn is_kind(error: &io::Error) -> bool {
        Self::kind(error).is_some()
    }

    /// What the system says of what is no file, as what it is.
    fn told(error: io::Error) -> io::Error {
        match error.raw_os_error() {
            Some(libc::ELOOP) => Self::Kind("a link").into(),
            Some(libc::EISDIR) => Self::Kind("a directory").into(),
            Some(libc::ENXIO) => Self::Kind("a socket or a device").into(),
            _ => error,
        }
    }
}

impl From<Unfit> for io::Error {
    fn from(why: Unfit) -> Self {
        Self::new(io::ErrorKind::InvalidInput, why)
    }
}

/// A node's directory, held open.
pub(crate) struct Directory {
    path: PathBuf,
    /// Not to be read, only to find files by.
    opened: File,
}

impl AsFd for Directory {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.opened.as_fd()
    }
}

impl Directory {
    /// Makes it with this mode; one that is there must be this user's own, and gets the mode.
    pub(crate) fn make(path: &Path, mode: u32) -> io::Result<Self> {
        let mut builder = DirBuilder::new();
        builder.recursive(true).mode(mode);
        path.parent().map_or(Ok(()), |around| builder.create(around))?;
        // The owner of the folder around it could put another directory in its place.
        if let Some((around, its)) = around(path)?.filter(|(_, its)| !is_trusted(us(), its.uid())) {
            return Err(Unfit::Foreign(around.into(), its.uid()).into());
        }
        builder.create(path)?;
        let (directory, owner) = Self::enter(path)?;
        if owner != us() {
            return Err(Unfit::Foreign(path.into(), owner).into());
        }
        fs::set_permissions(path, fs::Permissions::from_mode(mode))?;
        Ok(directory)
    }

    /// Opens one that is there: this user's or root's; another user's only if `$ROHRPOST_DIR` leads there.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let (directory, owner) = Self::enter(path)?;
        let around = around(path)?;
        let named = std::env::var_os("ROHRPOST_DIR");
        let folder = around.as_ref().map(|(around, its)| Folder {
            owner: its.uid(),
            mode: its.mode(),
            is_named: named.is_some_and(|named| Path::new(&named) == *around),
        });
        match (stranger(us(), owner, folder), around) {
            (None, _) => Ok(directory),
            (Some(Stranger::OfFolder), Some((around, its))) => Err(Unfit::Foreign(around.into(), its.uid()).into()),
            (Some(_), _) => Err(Unfit::Foreign(path.into(), owner).into()),
        }
    }

    /// Opens it, and says which user owns it.
    fn enter(path: &Path) -> io::Result<(Self, u32)> {
        let flags = libc::O_PATH | libc::O_DIRECTORY | libc::O_NOFOLLOW | libc::O_CLOEXEC;
        let opened = OpenOptions::new().read(true).custom_flags(flags).open(path)?;
        let owner = opened.metadata()?.uid();
        Ok((Self { path: path.into(), opened }, owner))
    }

    /// Where it was when it was opened.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Opens a file to read and write.
    pub(crate) fn open_file(&self, name: &str) -> io::Result<File> {
        self.open_checked(name, OFlag::O_RDWR)
    }

    /// Opens a file to look at it.
    pub(crate) fn open_to_read(&self, name: &str) -> io::Result<File> {
        self.open_checked(name, OFlag::O_RDONLY)
    }

    /// Opens a file to read and write; makes it, empty, if it is not there.
    pub(crate) fn open_or_make(&self, name: &str) -> io::Result<File> {
        match self.make_file(name) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => self.open_file(name),
            made => made,
        }
    }

    /// Makes a file that is to be renamed when it is whole. What a dead maker left under this name goes; a link goes
    /// itself, and what it leads to stays.
    pub(crate) fn make_anew(&self, temporary: &str) -> io::Result<File> {
        let _ = self.remove(temporary);
        self.make_file(temporary)
    }

    /// Gives a file its name, in place of what has it.
    pub(crate) fn rename(&self, temporary: &str, name: &str) -> io::Result<()> {
        match renameat(self, temporary, self, name) {
            Err(Errno::EISDIR) => {
                self.remove(name)?;
                Ok(renameat(self, temporary, self, name)?)
            }
            renamed => Ok(renamed?),
        }
    }

    /// Takes the name of a file away, or of an empty directory that somebody has put in its place.
    pub(crate) fn remove(&self, name: &str) -> io::Result<()> {
        match unlinkat(self, name, UnlinkatFlags::NoRemoveDir) {
            Err(Errno::EISDIR) => match unlinkat(self, name, UnlinkatFlags::RemoveDir) {
                Err(Errno::ENOTEMPTY | Errno::EEXIST) => Err(Unfit::Full(self.path.join(name)).into()),
                removed => Ok(removed?),
            },
            removed => Ok(removed?),
        }
    }

    /// Writes a file that appears whole, in place of what has its name. Two that write at once need two temporary
    /// names.
    pub(crate) fn put(&self, name: &str, temporary: &str, bytes: &[u8]) -> io::Result<()> {
        let write = || {
            self.make_anew(temporary)?.write_all(bytes)?;
            step!("file: written");
            self.rename(temporary, name)
        };
        write().inspect_err(|_| _ = self.remove(temporary))
    }

    /// Reads a file whole, if it is not too long for one that [`put`](Self::put) wrote.
    pub(crate) fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.open_to_read(name)?.take(WHOLE_BYTES_MAX + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > WHOLE_BYTES_MAX { Err(io::ErrorKind::FileTooLarge.into()) } else { Ok(bytes) }
    }

    /// Names of all files, in no order.
    pub(crate) fn names(&self) -> io::Result<impl Iterator<Item = PathBuf> + use<>> {
        Ok(fs::read_dir(&self.path)?.filter_map(|entry| Some(entry.ok()?.file_name().into())))
    }

    /// Removes it, with all that is in it.
    pub(crate) fn remove_all(&self) -> io::Result<()> {
        fs::remove_dir_all(&self.path)
    }

    /// A new file, for the users that the directory's mode lets in.
    fn make_file(&self, name: &str) -> io::Result<File> {
        let file = self.open_at(name, OFlag::O_RDWR | OFlag::O_CREAT | OFlag::O_EXCL)?;
        let around = self.opened.metadata()?.mode();
        // By the file, not by its name: neither the umask nor anybody else has a say.
        file.set_permissions(fs::Permissions::from_mode(around & 0o666))?;
        Ok(file)
    }

    fn open_checked(&self, name: &str, access: OFlag) -> io::Result<File> {
        let file = self.open_at(name, access).map_err(Unfit::told)?;
        let there = file.metadata()?;
        if !there.is_file() {
            let kind = there.file_type();
            let fifo = if kind.is_fifo() { "a named pipe" } else { "a device" };
            return Err(Unfit::Kind(if kind.is_dir() { "a directory" } else { fifo }).into());
        }
        if !is_trusted(us(), there.uid()) {
            let around = self.opened.metadata()?;
            if there.uid() != around.uid() && around.mode() & OTHERS_WRITE == 0 {
                return Err(Unfit::Foreign(self.path.join(name), there.uid()).into());
            }
        }
        Ok(file)
    }

    fn open_at(&self, name: &str, access: OFlag) -> io::Result<File> {
        let flags = access | OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK | OFlag::O_CLOEXEC;
        Ok(openat(self, name, flags, Mode::S_IRUSR | Mode::S_IWUSR)?.into())
    }
}

/// The folder around a node's directory.
#[derive(Clone, Copy)]
struct Folder {
    owner: u32,
    mode: u32,
    /// By `$ROHRPOST_DIR`: the user means this one.
    is_named: bool,
}

/// What belongs to a user that may have put something there.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stranger {
    OfDirectory,
    OfFolder,
}

/// Whether a directory of this owner is none to be used by `us`.
fn stranger(us: u32, owner: u32, around: Option<Folder>) -> Option<Stranger> {
    let is_trusted = |owner| is_trusted(us, owner);
    match around {
        // Where any user may leave a directory, that the folder is meant says nothing of what is in it.
        Some(Folder { owner: its, mode, is_named: true })
            if its == owner || is_trusted(its) && mode & OTHERS_WRITE == 0 =>
        {
            None
        }
        _ if !is_trusted(owner) => Some(Stranger::OfDirectory),
        Some(Folder { owner: its, .. }) if !is_trusted(its) => Some(Stranger::OfFolder),
        _ => None,
    }
}

/// Whether `us` may use what this user owns: its own, and what is root's, which may do anything anyway.
fn is_trusted(us: u32, owner: u32) -> bool {
    owner == 0 || owner == us
}

fn us() -> u32 {
    getuid().as_raw()
}

/// The folder around a path; none of a bare name.
fn around(path: &Path) -> io::Result<Option<(&Path, Metadata)>> {
    let around = path.parent().filter(|around| !around.as_os_str().is_empty());
    // The folder itself counts, also behind a link.
    around.map(|around| Ok((around, fs::metadata(around)?))).transpose()
}

/// Removes a directory around nodes, if it is empty.
pub(crate) fn remove_if_empty(around: &Path) {
    // Refused when something is in it, as it should be.
    let _ = fs::remove_dir(around);
}

/// The folder of this path, or the nearest around it that is there: what a person can look at when a node could not be
/// made.
pub(crate) fn existing(path: &Path) -> &Path {
    path.ancestors().find(|folder| folder.exists()).unwrap_or(path)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directories_of_other_users_are_used_only_where_they_are_meant() {
        const US: u32 = 1000;
        const THEM: u32 = 1001;
        const ROOT: u32 = 0;
        let folder = |owner, mode, is_named| Some(Folder { owner, mode, is_named });
        for (owner, around, found, why) in [
            (US, folder(US, 0o700, false), None, "the usual one"),
            (US, folder(ROOT, 0o1777, false), None, "in /dev/shm itself"),
            (ROOT, folder(ROOT, 0o755, false), None, "root may do anything"),
            (US, None, None, "in the present folder"),
            (THEM, None, Some(Stranger::OfDirectory), "the same of another user"),
            (THEM, folder(THEM, 0o755, false), Some(Stranger::OfDirectory), "made under this user's name"),
            (THEM, folder(US, 0o777, false), Some(Stranger::OfDirectory), "this user's folder is open"),
            (US, folder(THEM, 0o755, false), Some(Stranger::OfFolder), "another one may come in its place"),
            (THEM, folder(THEM, 0o750, true), None, "a node of theirs is meant"),
            (THEM, folder(ROOT, 0o755, true), None, "root put it there"),
            (THEM, folder(ROOT, 0o1777, true), Some(Stranger::OfDirectory), "anybody may have put it there"),
            (US, folder(ROOT, 0o1777, true), None, "this user itself did"),
        ] {
            assert_eq!(stranger(US, owner, around), found, "{why}");
        }
    }
}
