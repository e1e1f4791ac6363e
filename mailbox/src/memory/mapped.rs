//! Mailboxes that this process has mapped to send to them: each once. Without this table a process would map the
//! router's mailbox once for each remote mailbox that it sends to.

use crate::memory::mapping::{Mapping, Region, Use};
use std::fs::File;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::sync::{Mutex, PoisonError, Weak};

/// All segments that this process has mapped. Not on any hot path: read when a sender is made, or enters another
/// mailbox.
static MAPPED: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

struct Kept {
    /// Device and number of the file, which nothing else has while it is mapped.
    identity: (u64, u64),
    bytes: usize,
    region: Weak<Region>,
}

/// The first `bytes` of a file, to read and write.
pub(crate) fn mapping(file: &File, bytes: usize) -> io::Result<Mapping> {
    let there = file.metadata()?;
    let identity = (there.dev(), there.ino());
    let mut all = MAPPED.lock().unwrap_or_else(PoisonError::into_inner);
    let same = all.iter().find(|kept| kept.identity == identity && kept.bytes == bytes);
    if let Some(region) = same.and_then(|kept| kept.region.upgrade()) {
        return Ok(Mapping::of(region));
    }
    let mapping = Mapping::new(file, bytes, Use::Share)?;
    all.retain(|kept| kept.region.strong_count() > 0);
    all.push(Kept { identity, bytes, region: mapping.downgrade() });
    Ok(mapping)
}
