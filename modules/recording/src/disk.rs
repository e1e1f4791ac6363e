//! The few things that recording asks of a disk. Tests put one in its place that fails.

use nix::sys::statvfs::statvfs;
use std::fs::{File, OpenOptions, Permissions, TryLockError};
use std::io::{self, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;
use std::time::Duration;

/// So often a lock is tried, and so far apart.
const LOCK_TRIES: usize = 20;
const LOCK_RETRY: Duration = Duration::from_millis(1);

/// Permissions of a recording that is for its user alone.
pub(crate) const FILE_MODE: u32 = 0o600;

/// Where files are made.
pub(crate) trait Disk: Send {
    /// A new file with these permissions; never one that is there.
    fn create(&mut self, path: &Path, mode: u32) -> io::Result<Box<dyn DiskFile>>;

    /// What this user may still write.
    fn free_bytes(&mut self, folder: &Path) -> io::Result<u64>;

    /// Makes names of files survive a loss of power.
    fn sync_folder(&mut self, folder: &Path) -> io::Result<()>;

    fn remove(&mut self, path: &Path) -> io::Result<()>;
}

/// An open file.
pub(crate) trait DiskFile: Send {
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Makes what was written survive a loss of power.
    fn sync(&mut self) -> io::Result<()>;

    fn truncate(&mut self, len: u64) -> io::Result<()>;

    /// Whether it still has a name: a removed file takes what is written, and nobody ever sees it.
    fn has_name(&mut self) -> io::Result<bool>;
}

/// Whether a recorder writes this file just now. It holds a lock, which ends with its process; on a disk without locks
/// nobody can tell.
pub fn is_being_written(path: &Path) -> bool {
    // A shared one: network file systems give no other for a file that is read.
    open_to_read(path).is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// Opens a regular file, of which a recording consists. A pipe of its name would be waited for, for ever.
pub(crate) fn open_to_read(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().read(true).custom_flags(nix::libc::O_NONBLOCK).open(path)?;
    if file.metadata()?.is_file() {
        return Ok(file);
    }
    Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file; name a file of a recording (*.mcap)"))
}

/// Permissions of a new file made of these: what each of them lets others do. Settings stand in them.
pub(crate) fn mode_of<'a>(sources: impl IntoIterator<Item = &'a Path>) -> u32 {
    let mode = |path: &Path| path.metadata().map_or(FILE_MODE, |there| there.mode());
    sources.into_iter().fold(0o666, |all, path| all & mode(path)) | FILE_MODE
}

/// Takes the lock by which others see that the file is being written, as long as it is open. A reader that looks just
/// then has it for a moment: it is tried again behind a `rest`. Where there are no locks, it is written all the same.
fn lock(file: &File, mut rest: impl FnMut()) {
    for _ in 0..LOCK_TRIES {
        if !matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            break;
        }
        rest();
    }
}

/// That of the operating system.
pub(crate) struct RealDisk;

impl Disk for RealDisk {
    fn create(&mut self, path: &Path, mode: u32) -> io::Result<Box<dyn DiskFile>> {
        let file = OpenOptions::new().write(true).create_new(true).mode(FILE_MODE).open(path)?;
        // By the file, so the umask has no say. A disk without permissions gives each file the same.
        let _ = file.set_permissions(Permissions::from_mode(mode));
        lock(&file, || std::thread::sleep(LOCK_RETRY));
        Ok(Box::new(file))
    }

    fn free_bytes(&mut self, folder: &Path) -> io::Result<u64> {
        let told = statvfs(folder)?;
        Ok(told.blocks_available().saturating_mul(told.fragment_size()))
    }

    fn sync_folder(&mut self, folder: &Path) -> io::Result<()> {
        File::open(folder)?.sync_all()
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        std::fs::remove_file(path)
    }
}

impl DiskFile for File {
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        Write::write_all(self, bytes)
    }

    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }

    fn truncate(&mut self, len: u64) -> io::Result<()> {
        self.set_len(len)
    }

    fn has_name(&mut self) -> io::Result<bool> {
        Ok(self.metadata()?.nlink() > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_writer_has_its_lock_though_a_reader_looks_just_then() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("base-0001.mcap");
        let file = File::create(&path).unwrap();
        let looks = || {
            let reader = File::open(&path).unwrap();
            reader.try_lock_shared().unwrap();
            Some(reader)
        };
        let (mut reader, mut rests) = (looks(), 0);
        lock(&file, || {
            rests += 1;
            reader = reader.take().filter(|_| rests < 3);
        });
        assert_eq!(rests, 3);
        assert!(is_being_written(&path));
        file.unlock().unwrap();
        let _reader = looks();
        let mut rests = 0;
        lock(&file, || rests += 1);
        assert_eq!(rests, LOCK_TRIES, "one that does not let go of it is not waited for");
    }
}
