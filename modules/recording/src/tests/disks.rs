//! A disk that fails when it is told to.

use crate::disk::{Disk, DiskFile, RealDisk};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex};

/// Of a thousand operations of a kind, how many fail.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Faults {
    pub(super) create: u32,
    pub(super) write: u32,
    pub(super) sync: u32,
    pub(super) free: u32,
}

/// Chance, shared by a disk and its files.
#[derive(Clone)]
pub(super) struct Chance(Arc<Mutex<ChaCha8Rng>>);

impl Chance {
    fn fails(&self, of_thousand: u32) -> bool {
        self.0.lock().unwrap().random_range(0..1000) < of_thousand
    }

    fn below(&self, most: usize) -> usize {
        self.0.lock().unwrap().random_range(0..=most)
    }
}

/// Real files behind faults.
pub(super) struct FailingDisk {
    faults: Faults,
    chance: Chance,
}

impl FailingDisk {
    pub(super) fn new(seed: u64, faults: Faults) -> Self {
        Self { faults, chance: Chance(Arc::new(Mutex::new(ChaCha8Rng::seed_from_u64(seed)))) }
    }
}

struct FailingFile {
    file: Box<dyn DiskFile>,
    faults: Faults,
    chance: Chance,
}

fn full() -> io::Error {
    io::Error::from(io::ErrorKind::StorageFull)
}

impl Disk for FailingDisk {
    fn create(&mut self, path: &Path, mode: u32) -> io::Result<Box<dyn DiskFile>> {
        if self.chance.fails(self.faults.create) {
            return Err(io::Error::from(io::ErrorKind::ReadOnlyFilesystem));
        }
        let file = RealDisk.create(path, mode)?;
        Ok(Box::new(FailingFile { file, faults: self.faults, chance: self.chance.clone() }))
    }

    fn free_bytes(&mut self, _: &Path) -> io::Result<u64> {
        if self.chance.fails(self.faults.free) {
            return Err(io::Error::from(io::ErrorKind::NotFound));
        }
        Ok(u64::MAX)
    }

    fn sync_folder(&mut self, _: &Path) -> io::Result<()> {
        Ok(())
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        RealDisk.remove(path)
    }
}

impl DiskFile for FailingFile {
    /// A failing write leaves a part of it.
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        if !self.chance.fails(self.faults.write) {
            return self.file.write_all(bytes);
        }
        self.file.write_all(&bytes[..self.chance.below(bytes.len())])?;
        Err(full())
    }

    fn sync(&mut self) -> io::Result<()> {
        if self.chance.fails(self.faults.sync) { Err(io::Error::from_raw_os_error(5)) } else { Ok(()) }
    }

    fn truncate(&mut self, len: u64) -> io::Result<()> {
        self.file.truncate(len)
    }

    fn has_name(&mut self) -> io::Result<bool> {
        self.file.has_name()
    }
}
