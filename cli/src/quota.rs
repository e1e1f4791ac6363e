//! What a recording may ask of this computer when it is replayed. It may be of strangers, and a small file may unpack
//! to anything, or have a configuration that asks for all memory.

use crate::terminal::units::size;
use std::path::Path;
use thiserror::Error;

/// Shared memory that a recorded configuration may ask for where it is not known what this computer has.
const SHARED_BYTES_MAX: u64 = 2 << 30;
/// Disk for what is unpacked of a recording: so much, and so many bytes for each of its own. Pictures that are drawn by
/// a simulation compress a hundredfold, those of cameras and journals tenfold.
const UNPACKED_BYTES: u64 = 256 << 20;
const UNPACKED_FACTOR: u64 = 256;

/// More than a recording may ask for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
pub(crate) enum QuotaError {
    #[error(
        "what is to be unpacked of it takes more than {} on the disk, which is the limit for a recording of its \
         length; cut a part that takes less: `rohrpost record cut`",
        size(*.0)
    )]
    Unpacked(u64),
    #[error(
        "the recorded configuration asks for {} of shared memory, and a recording gets at most {}, half of what this \
         computer has free",
        size(*asked),
        size(*most)
    )]
    Shared {
        /// Bytes.
        asked: u64,
        /// Bytes, too.
        most: u64,
    },
}

/// Disk for what is unpacked of recordings.
pub(crate) struct UnpackedQuota {
    most: u64,
    left: u64,
}

impl UnpackedQuota {
    /// For these files together.
    pub(crate) fn of_files(files: &[&Path]) -> Self {
        let len = |file: &&Path| std::fs::metadata(file).map_or(0, |its| its.len());
        let bytes = files.iter().map(len).fold(0, u64::saturating_add);
        Self::new(UNPACKED_BYTES.saturating_add(bytes.saturating_mul(UNPACKED_FACTOR)))
    }

    /// Of so many bytes.
    pub(crate) const fn new(most: u64) -> Self {
        Self { most, left: most }
    }

    /// So many bytes are to be written.
    pub(crate) fn take(&mut self, bytes: usize) -> Result<(), QuotaError> {
        self.left = self.left.checked_sub(bytes as u64).ok_or(QuotaError::Unpacked(self.most))?;
        Ok(())
    }
}

/// Whether a recorded configuration may ask for so much shared memory: mailboxes, streams and journals of a node.
pub(crate) fn check_shared(bytes: u64) -> Result<(), QuotaError> {
    let memory = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    within(bytes, available_bytes(&memory).map_or(SHARED_BYTES_MAX, |bytes| bytes / 2))
}

fn within(asked: u64, most: u64) -> Result<(), QuotaError> {
    if asked > most { Err(QuotaError::Shared { asked, most }) } else { Ok(()) }
}

/// What `/proc/meminfo` says that programs may still use.
fn available_bytes(memory: &str) -> Option<u64> {
    let line = memory.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_told_as_such() {
        let mut quota = UnpackedQuota::new(10 << 20);
        assert_eq!([6 << 20, 4 << 20, 1].map(|bytes| quota.take(bytes).is_ok()), [true, true, false]);
        let told = quota.take(1).unwrap_err().to_string();
        assert!(told.starts_with("what is to be unpacked of it takes more than 10 MiB on the disk"), "{told}");
        let told = within(6 << 30, 2 << 30).unwrap_err().to_string();
        assert!(told.contains("asks for 6 GiB of shared memory, and a recording gets at most 2 GiB, half"), "{told}");
        assert_eq!(within(2 << 30, 2 << 30), Ok(()));
        assert_eq!(available_bytes("MemTotal: 8 kB\nMemAvailable:    2097152 kB\n"), Some(2 << 30));
        assert_eq!(available_bytes(""), None);
        check_shared(1 << 40).unwrap_err();
    }

    #[test]
    fn a_longer_recording_may_take_more() {
        let file = tempfile::NamedTempFile::new().unwrap();
        file.as_file().set_len(1 << 20).unwrap();
        let quota = |files: &[&Path]| UnpackedQuota::of_files(files).most;
        assert_eq!((quota(&[]), quota(&[file.path()])), (256 << 20, 512 << 20));
        assert_eq!(quota(&[Path::new("/nowhere")]), 256 << 20);
    }
}
