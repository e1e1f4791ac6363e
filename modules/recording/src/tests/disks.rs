//! A disk that does what a test says of each step with it.

use crate::disk::{Disk, DiskFile, RealDisk};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

/// What a disk is asked for.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum DiskStep {
    Create,
    Free,
    SyncFolder,
    Remove,
    /// So many bytes.
    Write(usize),
    Sync,
    Truncate,
}

/// An error, and how many bytes of a write are done before it.
pub(super) type StepError = (io::Error, usize);

type Rule = dyn Fn(DiskStep, &Path) -> Result<(), StepError> + Send + Sync;

/// Real files, behind what a test says of each step.
#[derive(Clone)]
pub(super) struct TestDisk {
    rule: Arc<Rule>,
    pub(super) free_bytes: Arc<AtomicU64>,
}

struct TestFile {
    file: Box<dyn DiskFile>,
    path: PathBuf,
    disk: TestDisk,
}

impl TestDisk {
    pub(super) fn new(rule: impl Fn(DiskStep, &Path) -> Result<(), StepError> + Send + Sync + 'static) -> Self {
        Self { rule: Arc::new(rule), free_bytes: Arc::new(AtomicU64::new(u64::MAX)) }
    }

    fn ask(&self, step: DiskStep, path: &Path) -> io::Result<()> {
        (self.rule)(step, path).map_err(|(error, _)| error)
    }
}

impl Disk for TestDisk {
    fn create(&mut self, path: &Path, mode: u32) -> io::Result<Box<dyn DiskFile>> {
        self.ask(DiskStep::Create, path)?;
        let file = RealDisk.create(path, mode)?;
        Ok(Box::new(TestFile { file, path: path.to_owned(), disk: self.clone() }))
    }

    fn free_bytes(&mut self, folder: &Path) -> io::Result<u64> {
        self.ask(DiskStep::Free, folder)?;
        Ok(self.free_bytes.load(Relaxed))
    }

    fn sync_folder(&mut self, folder: &Path) -> io::Result<()> {
        self.ask(DiskStep::SyncFolder, folder)?;
        RealDisk.sync_folder(folder)
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        self.ask(DiskStep::Remove, path)?;
        RealDisk.remove(path)
    }
}

impl DiskFile for TestFile {
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        match (self.disk.rule)(DiskStep::Write(bytes.len()), &self.path) {
            Ok(()) => self.file.write_all(bytes),
            Err((error, done)) => self.file.write_all(&bytes[..done]).and(Err(error)),
        }
    }

    fn sync(&mut self) -> io::Result<()> {
        self.disk.ask(DiskStep::Sync, &self.path)?;
        self.file.sync()
    }

    fn truncate(&mut self, len: u64) -> io::Result<()> {
        self.disk.ask(DiskStep::Truncate, &self.path)?;
        self.file.truncate(len)
    }

    fn has_name(&mut self) -> io::Result<bool> {
        self.file.has_name()
    }
}

/// The disk does not answer any more.
pub(super) fn broken() -> io::Error {
    io::Error::from_raw_os_error(5)
}

/// Of a thousand steps of a kind, how many fail.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Faults {
    pub(super) create: u32,
    pub(super) write: u32,
    pub(super) sync: u32,
    pub(super) free: u32,
}

impl Faults {
    /// A disk with these faults. A failing write leaves a part of it.
    pub(super) fn disk(self, seed: u64) -> Box<TestDisk> {
        let chance = Mutex::new(ChaCha8Rng::seed_from_u64(seed));
        Box::new(TestDisk::new(move |step, _| {
            let (of_thousand, error, bytes) = match step {
                DiskStep::Create => (self.create, io::ErrorKind::ReadOnlyFilesystem.into(), 0),
                DiskStep::Free => (self.free, io::ErrorKind::NotFound.into(), 0),
                DiskStep::Write(bytes) => (self.write, io::ErrorKind::StorageFull.into(), bytes),
                DiskStep::Sync => (self.sync, broken(), 0),
                DiskStep::SyncFolder | DiskStep::Remove | DiskStep::Truncate => return Ok(()),
            };
            let mut chance = chance.lock().unwrap();
            if chance.random_range(0..1000) < of_thousand {
                return Err((error, chance.random_range(0..=bytes)));
            }
            Ok(())
        }))
    }
}
