//! Records that journals name instead of their bytes: taken out of the recording, for the programs that are given them.

use super::journals::RecordedRun;
use crate::quota::UnpackedQuota;
use crate::terminal::Failure;
use rohrpost_modules::journal::{RecordSum, RecordWriter};
use rohrpost_recording::Reader;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The file in that folder that has all of them; none if there are none. What the recording lacks is told by the replay
/// that comes to it.
pub(super) fn collect(
    recording: &Path,
    runs: &[RecordedRun],
    folder: &Path,
    quota: &mut UnpackedQuota,
) -> Result<Option<PathBuf>, Failure> {
    let mut missing = BTreeSet::new();
    for run in runs.iter().filter(|run| run.begins_late.is_none()) {
        missing.extend(run.exact().named_records()?);
    }
    if missing.is_empty() {
        return Ok(None);
    }
    let lengths: BTreeSet<u64> = missing.iter().map(|sum| sum.len).collect();
    let path = folder.join("records");
    let mut records = RecordWriter::create(&path)?;
    let mut reader = Reader::open(recording)?;
    while let Ok(Some((channel, message))) = reader.next() {
        if channel.is_drawn() || !lengths.contains(&(message.data.len() as u64)) {
            continue;
        }
        let sum = RecordSum::of(message.data);
        if missing.remove(&sum) {
            quota.take(message.data.len())?;
            records.add(sum, message.data)?;
        }
    }
    records.finish()?;
    Ok(Some(path))
}
