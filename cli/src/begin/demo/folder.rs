//! The folder of a demo's files, and removal of folders that killed demos left.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const PREFIX: &str = "rohrpost-demo-";
/// The file in it that is locked while the demo runs; the kernel releases the lock in any case.
const IN_USE: &str = "in-use";

/// The name of that file until it is locked.
const NOT_LOCKED: &str = "not-locked-yet";

/// A demo's folder; removed on drop.
pub(crate) struct Folder {
    folder: TempDir,
    _in_use: File,
}

impl Folder {
    /// Creates a folder among temporary files. Removes the folders of killed demos.
    pub(crate) fn new() -> io::Result<Self> {
        Self::within(&std::env::temp_dir())
    }

    /// The same in another folder.
    pub(crate) fn within(base: &Path) -> io::Result<Self> {
        remove_abandoned(base);
        Self::new_in(base)
    }

    fn new_in(temp: &Path) -> io::Result<Self> {
        let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(temp)?;
        // The final name appears only with the lock: without a lock, another demo would take the folder for an
        // abandoned one.
        let in_use = File::create(folder.path().join(NOT_LOCKED))?;
        in_use.lock()?;
        fs::rename(folder.path().join(NOT_LOCKED), folder.path().join(IN_USE))?;
        Ok(Self { folder, _in_use: in_use })
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes the folders of this user's demos that no longer run; returns their paths. Another process may have removed
/// one meanwhile.
pub(crate) fn remove_abandoned(temp: &Path) -> Vec<PathBuf> {
    let mut folders = abandoned(temp);
    folders.retain(|folder| fs::remove_dir_all(folder).is_ok());
    folders
}

fn abandoned(temp: &Path) -> Vec<PathBuf> {
    let Ok(us) = fs::metadata("/proc/self").map(|own| own.uid()) else { return Vec::new() };
    let entries = fs::read_dir(temp).into_iter().flatten().flatten();
    let ours = entries.filter(|entry| {
        let is_named_so = entry.file_name().to_str().is_some_and(|name| name.starts_with(PREFIX));
        // Not through a link, which this does not follow.
        is_named_so && entry.metadata().is_ok_and(|found| found.is_dir() && found.uid() == us)
    });
    // A folder that has just been made has no such file yet, and stays.
    let is_over = |folder: &PathBuf| File::open(folder.join(IN_USE)).is_ok_and(|file| file.try_lock().is_ok());
    ours.map(|entry| entry.path()).filter(is_over).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_folders_of_killed_demos_are_abandoned() {
        let temp = tempfile::tempdir().unwrap();
        fs::create_dir(temp.path().join("rohrpost-demo-begun")).unwrap();
        fs::create_dir(temp.path().join("another")).unwrap();
        fs::write(temp.path().join("another").join(IN_USE), "").unwrap();
        let runs = Folder::new_in(temp.path()).unwrap();
        assert_eq!(abandoned(temp.path()), Vec::<PathBuf>::new());
        // The state after a kill: the folder is there, the lock is not.
        let Folder { folder, _in_use } = Folder::new_in(temp.path()).unwrap();
        let left = folder.keep();
        assert_eq!(abandoned(temp.path()), Vec::<PathBuf>::new(), "it runs still");
        drop(_in_use);
        assert_eq!(abandoned(temp.path()), [left]);
        drop(runs);
    }
}
