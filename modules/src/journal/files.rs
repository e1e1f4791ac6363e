//! What is in a file that a module was given.

use super::bytes::digest;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Read at a time; a multiple of what a sum takes at a time.
const PART_BYTES: usize = 64 << 10;

/// Length and sum of a regular file; none for anything else, and for what cannot be read.
pub(super) fn digest_of(path: &Path) -> Option<(u64, u64)> {
    // Opening a pipe or a device would wait, or do something.
    let mut file = File::open(path.metadata().ok().filter(|about| about.is_file()).map(|_| path)?).ok()?;
    let mut part = vec![0; PART_BYTES];
    let (mut len, mut sum) = (0, 0);
    loop {
        let mut filled = 0;
        while filled < part.len() {
            match file.read(&mut part[filled..]).ok()? {
                0 => break,
                more => filled += more,
            }
        }
        sum = digest(sum, &part[..filled]);
        len += filled as u64;
        if filled < part.len() {
            return Some((len, sum));
        }
    }
}
