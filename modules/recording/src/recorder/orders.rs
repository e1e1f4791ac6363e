//! Orders to the thread that writes, carried out where they stand among the messages.

use super::Recorder;
use crate::current::Current;
use crate::error::DiskError;
use crate::order::{FileChange, Mark, Order, OrderKind};
use std::path::{Path, PathBuf};
use std::time::Instant;

impl Recorder {
    pub(super) fn carry_out(&mut self, order: Order, now: Instant) {
        let told = match &order.kind {
            OrderKind::Mark(mark) => self.mark(mark, now).map_err(|error| self.failed(error, now)),
            OrderKind::Rotate => self.rotate(now).map_err(|error| self.failed(error, now)),
            OrderKind::Move(folder) => self.move_to(folder, now),
        };
        let file = || self.current.as_ref().map(|current| current.file.path().to_owned()).unwrap_or_default();
        order.answer(told.map(|closed| FileChange { closed, file: file() }));
    }

    fn failed(&mut self, error: DiskError, now: Instant) -> DiskError {
        self.fail(error.clone(), now);
        error
    }

    /// Handed to the kernel with the answer, as a message that is written.
    fn mark(&mut self, mark: &Mark, now: Instant) -> Result<Option<PathBuf>, DiskError> {
        self.keep_free(0)?;
        self.opened(now)?;
        if let Some(current) = &mut self.current {
            current.mark(mark)?;
            self.shared.counts().bytes_now = current.file.bytes();
        }
        Ok(None)
    }

    /// A file without content stays: the next one would have no more.
    fn rotate(&mut self, now: Instant) -> Result<Option<PathBuf>, DiskError> {
        self.keep_free(0)?;
        let closed = self.current.as_ref().filter(|current| current.has_content());
        let closed = closed.map(|current| current.file.path().to_owned());
        if closed.is_some() {
            self.close("rotated")?;
        }
        self.opened(now)?;
        Ok(closed)
    }

    /// The present file stays until the new folder has taken one with its beginning: a mistaken folder ends nothing,
    /// nor does a full disk, which makes files and takes no byte. Numbers begin anew in each folder.
    fn move_to(&mut self, folder: &Path, now: Instant) -> Result<Option<PathBuf>, DiskError> {
        let folder = std::mem::replace(&mut self.options.folder, folder.to_owned());
        let number = std::mem::replace(&mut self.number, 1);
        let mut next = match self.introduced(now) {
            Ok(next) => next,
            Err(error) => {
                (self.options.folder, self.number) = (folder, number);
                return Err(error);
            }
        };
        let closed = match self.current.take_if(|current| !current.has_content()) {
            Some(empty) => {
                self.discard(empty.file);
                None
            }
            None => self.current.as_ref().map(|current| current.file.path().to_owned()),
        };
        if let Err(error) = self.close("rotated") {
            self.fail(error, now);
        }
        self.number += 1;
        next.follow(self.lost_told.clone());
        let mut counts = self.shared.counts();
        counts.told.file = Some(next.file.path().to_owned());
        counts.bytes_now = next.file.bytes();
        drop(counts);
        self.current = Some(next);
        Ok(closed)
    }

    /// A file with its beginning, beside the present one. Of one that does not take it, nothing is left.
    fn introduced(&mut self, now: Instant) -> Result<Current, DiskError> {
        self.check_free(0)?;
        let mut next = Current::new(self.create()?, &self.options, self.lost_told.clone(), now);
        let told = next.introduce(&self.session, &self.identity, self.number);
        match told {
            Ok(()) => Ok(next),
            Err(error) => {
                let path = next.file.path().to_owned();
                next.file.abandon();
                // If it cannot be removed either, it stays, as what is discarded does.
                let _ = self.disk.remove(&path);
                Err(error)
            }
        }
    }
}
