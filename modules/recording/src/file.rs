//! One MCAP file that is being written: chunks go to it whole, and what fails is taken back to the last whole one.

use crate::disk::{Disk, DiskFile};
use crate::error::{DiskError, Shown};
use crate::format::{LIBRARY, PROFILE};
use crate::output::Output;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, McapError, McapResult, WriteOptions};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// Compresses about as fast as lz4 and as well as the default; measured on messages of 1 KiB.
const ZSTD_LEVEL: u32 = 1;

/// A file that is written.
pub(crate) struct OpenFile {
    path: PathBuf,
    mcap: mcap::Writer<Output>,
    output: Output,
    /// Up to here all records are whole.
    whole_bytes: u64,
    has_synced_name: bool,
}

impl OpenFile {
    /// Makes a new one.
    pub(crate) fn create(disk: &mut dyn Disk, path: &Path, mode: u32) -> Result<Self, DiskError> {
        let file = disk.create(path, mode).map_err(|error| DiskError::new("make the file", path, error))?;
        Self::begin(disk, path, file)
    }

    /// Begins a file that was just made there.
    pub(crate) fn begin(disk: &mut dyn Disk, path: &Path, file: Box<dyn DiskFile>) -> Result<Self, DiskError> {
        let output = Output::new(file);
        // A chunk is put together in memory and written with its length. While `mcap` seeks, an open chunk has none:
        // readers stop before it if the writer is killed.
        let options = WriteOptions::new()
            .profile(PROFILE)
            .library(format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_level(ZSTD_LEVEL)
            .compression_threads(0)
            .chunk_size(None)
            .disable_seeking(true);
        match options.create(output.clone()) {
            Ok(mcap) => Ok(Self { path: path.to_owned(), mcap, output, whole_bytes: 0, has_synced_name: false }),
            Err(error) => {
                let error = explain(&output, path, error);
                // Nothing is in it.
                let _ = disk.remove(path);
                Err(error)
            }
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Length so far.
    pub(crate) fn bytes(&self) -> u64 {
        self.output.sink().position()
    }

    /// Adds a record of metadata, behind the present chunk.
    pub(crate) fn metadata(&mut self, name: &str, texts: BTreeMap<String, String>) -> Result<(), DiskError> {
        let told = self.mcap.write_metadata(&Metadata { name: name.to_owned(), metadata: texts });
        self.explained(told)
    }

    /// Describes a type; the same one again has the same number.
    pub(crate) fn schema(&mut self, name: &str, encoding: &str, data: &[u8]) -> Result<u16, DiskError> {
        let told = self.mcap.add_schema(name, encoding, data);
        self.explained(told)
    }

    /// Describes a channel; the same one again has the same number.
    pub(crate) fn channel(
        &mut self,
        schema: u16,
        topic: &str,
        encoding: &str,
        texts: &BTreeMap<String, String>,
    ) -> Result<u16, DiskError> {
        let told = self.mcap.add_channel(schema, topic, encoding, texts);
        self.explained(told)
    }

    /// Adds a message to the present chunk.
    pub(crate) fn message(&mut self, header: &MessageHeader, data: &[u8]) -> Result<(), DiskError> {
        let told = self.mcap.write_to_known_channel(header, data);
        self.explained(told)
    }

    /// Compresses the present chunk and writes it: a killed process loses nothing before here.
    pub(crate) fn end_chunk(&mut self) -> Result<(), DiskError> {
        self.split_chunk()?;
        self.whole_bytes = self.bytes();
        Ok(())
    }

    /// Begins another chunk in the middle of what belongs together: after an error none of it stays.
    pub(crate) fn split_chunk(&mut self) -> Result<(), DiskError> {
        let told = self.mcap.flush();
        self.explained(told)
    }

    /// Has the disk keep what was written: a loss of power loses nothing before here.
    pub(crate) fn sync(&mut self, disk: &mut dyn Disk) -> Result<(), DiskError> {
        let mut sink = self.output.sink();
        let failed = |error: io::Error| DiskError::Sync { path: Shown(self.path.clone()), error: error.into() };
        sink.file().sync().map_err(failed)?;
        if !sink.file().has_name().map_err(failed)? {
            return Err(DiskError::Gone { path: Shown(self.path.clone()), error: None });
        }
        if !self.has_synced_name {
            disk.sync_folder(folder_of(&self.path)).map_err(failed)?;
            self.has_synced_name = true;
        }
        Ok(())
    }

    /// Writes index, statistics and end, and syncs; its length. Nothing is written behind that.
    pub(crate) fn close(&mut self, disk: &mut dyn Disk) -> Result<u64, DiskError> {
        let told = self.mcap.finish();
        self.explained(told)?;
        self.whole_bytes = self.bytes();
        self.sync(disk)?;
        Ok(self.whole_bytes)
    }

    /// Gives it up after an error: what is behind the last whole chunk is cut off. Its length then.
    ///
    /// If the disk does not do even that, messages of the last batch are in this file and in the next one.
    pub(crate) fn abandon(self) -> u64 {
        // Not dropped as it is: that would write a summary.
        drop(self.mcap.into_inner());
        let mut sink = self.output.sink();
        if sink.file().truncate(self.whole_bytes).is_ok() { self.whole_bytes } else { sink.position() }
    }

    fn explained<T>(&self, told: McapResult<T>) -> Result<T, DiskError> {
        told.map_err(|error| explain(&self.output, &self.path, error))
    }
}

/// Where a file is; of a bare name the present folder.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// `mcap` says that writing failed, the output knows why.
fn explain(output: &Output, path: &Path, error: McapError) -> DiskError {
    let cause = output.sink().take_error();
    DiskError::new("write", path, cause.unwrap_or_else(|| io::Error::other(error)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bare_name_is_in_the_present_folder() {
        let folders = ["part.mcap", "./part.mcap", "a/part.mcap", "/part.mcap"].map(|path| folder_of(Path::new(path)));
        assert_eq!(folders, [".", ".", "a", "/"].map(Path::new));
    }
}
