//! The crate `mcap` with a loop around it: the same chunks, compressed and checked alike, synced at the end.

use super::workload::{CHUNK_BYTES, NAME, Workload};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use rohrpost_bench_local::harness::{Failure, OrFail};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// As our recorder has it.
const ZSTD_LEVEL: u32 = 1;

/// Writes all, and closes the file.
pub(super) fn write(folder: &Path, workload: &Workload) -> Result<(), Failure> {
    try_write(folder, workload).or_fail("mcap")
}

fn try_write(folder: &Path, workload: &Workload) -> Result<(), Box<dyn std::error::Error>> {
    let options = WriteOptions::new()
        .compression(Some(Compression::Zstd))
        .compression_level(ZSTD_LEVEL)
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES))
        .disable_seeking(true);
    let mut writer = options.create(BufWriter::new(File::create(folder.join("bench.mcap"))?))?;
    let schema = writer.add_schema("bytes", "bytes", &[])?;
    let topic = format!("{}/{}", NAME.0, NAME.1);
    let channel_id = writer.add_channel(schema, &topic, "postcard", &BTreeMap::new())?;
    for (sequence, data) in workload.all() {
        let now_ns = u64::from(sequence) * 1000;
        writer.write_to_known_channel(
            &MessageHeader { channel_id, sequence, log_time: now_ns, publish_time: now_ns },
            data,
        )?;
    }
    writer.finish()?;
    writer.into_inner().into_inner()?.sync_all()?;
    Ok(())
}
