//! Files in shared memory. They are removed at the end of a turn, or by the next run when their maker is dead.

use super::{Failure, OrFail};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// Where shared memory is.
const SHARED_MEMORY: &str = "/dev/shm";

/// Prefix of all names; the process id of the maker follows, then a number.
const PREFIX: &str = "rohrpost-bench-";

/// A unique name, and a directory of that name. On drop, everything in shared memory with that prefix is
/// removed.
pub struct Scratch {
    name: String,
}

impl Scratch {
    /// Makes the directory.
    ///
    /// # Errors
    /// When there is no shared memory to make it in.
    pub fn new() -> Result<Self, Failure> {
        static MADE: AtomicU32 = AtomicU32::new(0);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let scratch = Self { name: format!("{PREFIX}{}-{number}-", std::process::id()) };
        fs::create_dir(scratch.directory()).or_fail(SHARED_MEMORY)?;
        Ok(scratch)
    }

    /// The directory.
    pub fn directory(&self) -> PathBuf {
        Path::new(SHARED_MEMORY).join(&self.name)
    }

    /// Prefix of names in shared memory that are removed with it.
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        remove(|name| name.starts_with(&self.name));
    }
}

/// Removes the files of killed runs. Files of a living process stay.
pub fn sweep() {
    remove(|name| {
        let maker = name.strip_prefix(PREFIX).and_then(|rest| rest.split('-').next()?.parse::<u32>().ok());
        maker.is_some_and(|pid| !Path::new("/proc").join(pid.to_string()).exists())
    });
}

/// Removes everything with such a name. What cannot be removed stays for the next run.
fn remove(is_ours: impl Fn(&str) -> bool) {
    for entry in fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten() {
        if entry.file_name().to_str().is_some_and(&is_ours) {
            let path = entry.path();
            let _ = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_dead_maker_left_is_swept_and_what_a_living_one_has_stays() {
        let mine = Scratch::new().unwrap();
        // Process ids end at 4 194 304.
        let dead = Path::new(SHARED_MEMORY).join(format!("{PREFIX}4194305-0-left"));
        fs::write(&dead, "").unwrap();
        sweep();
        assert!(!dead.exists());
        assert!(mine.directory().exists());
        let beside = Path::new(SHARED_MEMORY).join(format!("{}segment", mine.name()));
        fs::write(&beside, "").unwrap();
        let directory = mine.directory();
        drop(mine);
        assert!(!directory.exists() && !beside.exists());
    }
}
