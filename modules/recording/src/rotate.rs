//! When a file has enough, and how files are called.

use std::path::{Path, PathBuf};
use std::time::Duration;

/// When the next file begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rotation {
    /// A file gets no longer, but for its index.
    pub bytes_max: u64,
    /// Nor older.
    pub age_max: Duration,
}

impl Default for Rotation {
    /// A gigabyte, an hour.
    fn default() -> Self {
        Self { bytes_max: 1 << 30, age_max: Duration::from_secs(3600) }
    }
}

impl Rotation {
    /// Whether a file of this length and age takes no more, or not so many bytes more.
    pub(crate) fn is_due(self, bytes: u64, more: u64, age: Duration) -> bool {
        bytes.saturating_add(more) > self.bytes_max || age >= self.age_max
    }
}

/// The path of a recording's file.
pub(crate) fn path(folder: &Path, stem: &str, number: u32) -> PathBuf {
    folder.join(format!("{stem}-{number:04}.mcap"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_file_begins_before_one_is_too_long_or_too_old() {
        let rotation = Rotation { bytes_max: 1000, age_max: Duration::from_secs(60) };
        for (bytes, more, age_s, due, why) in [
            (0, 1000, 0, false, "what just fits"),
            (1, 1000, 0, true, "a byte too many"),
            (1, 0, 59, false, "not old yet"),
            (1, 0, 60, true, "old, whatever comes"),
            (u64::MAX, 1, 0, true, "no overflow"),
        ] {
            assert_eq!(rotation.is_due(bytes, more, Duration::from_secs(age_s)), due, "{why}");
        }
    }

    #[test]
    fn names_sort_as_their_numbers() {
        assert_eq!(path(Path::new("/var"), "base", 7), Path::new("/var/base-0007.mcap"));
        assert_eq!(path(Path::new("/var"), "base", 12_345), Path::new("/var/base-12345.mcap"));
    }
}
