//! The thread that writes: batches become chunks of files. What the disk does not take is tried again with a new file.
//!
//! ```text
//!            ┌── batch written ──┐
//!            ▼                   │
//!  ──▶ file open ──▶ size, age ──┴─▶ close ──▶ file open
//!            │
//!            └── error ──▶ give the file up ──▶ wait ──▶ file open, with the same batch again
//! ```
//!
//! After an error the file is cut back to its last whole chunk, so the batch is not in it and comes to the next one.
//! Meanwhile messages wait in the inbox, and are counted as lost once it is full.

mod orders;

use crate::batch::Batch;
use crate::current::{Current, is_told};
use crate::described::DescribedModule;
use crate::disk::Disk;
use crate::error::{DiskError, Shown};
use crate::format::metadata;
use crate::inbox::Taken;
use crate::loss::{LossCause, Losses};
use crate::newest::{Earlier, Newest};
use crate::options::{Options, Session};
use crate::rotate;
use crate::shared::Shared;
use crate::status::ChannelState;
use crate::write::file::OpenFile;
use std::collections::BTreeMap;
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Files of one name: no folder has so many.
const NUMBER_MAX: u32 = 1_000_000;

/// The state of the thread.
pub(crate) struct Recorder {
    disk: Box<dyn Disk>,
    options: Options,
    session: Session,
    /// Tells this recording from all others.
    identity: String,
    shared: Arc<Shared>,
    channels: Vec<Arc<ChannelState>>,
    described: Vec<Arc<DescribedModule>>,
    current: Option<Current>,
    /// What the next file begins with.
    newest: Newest,
    /// Of the next file.
    number: u32,
    /// Taken, but not written, as the disk fails.
    held: Option<Batch>,
    /// Not before then is the disk tried again.
    retry_at: Option<Instant>,
    /// Losses of each channel that files tell.
    lost_told: Vec<Losses>,
    /// The newest that was seen: channels without a message yet are described with it.
    epoch: u64,
}

impl Recorder {
    pub(crate) fn new(
        disk: Box<dyn Disk>,
        newest: Newest,
        options: Options,
        session: Session,
        shared: Arc<Shared>,
    ) -> Self {
        Self {
            disk,
            options,
            session,
            identity: format!("{:016x}", RandomState::new().hash_one(std::process::id())),
            shared,
            channels: Vec::new(),
            described: Vec::new(),
            current: None,
            newest,
            number: 1,
            held: None,
            retry_at: None,
            lost_told: Vec::new(),
            epoch: 0,
        }
    }

    /// Until the end of the inbox.
    pub(crate) fn run(mut self) {
        // Not only with the first message: what is wrong with the disk is told at once.
        if let Err(error) = self.opened(Instant::now()) {
            self.fail(error, Instant::now());
        }
        loop {
            if let Some(at) = self.retry_at.take() {
                match self.shared.inbox.wait_while_failing(at.saturating_duration_since(Instant::now())) {
                    Taken::End => break,
                    Taken::Order(order) => self.carry_out(order, Instant::now()),
                    Taken::Batch(_) | Taken::Nothing => {}
                }
                self.resume(Instant::now());
                continue;
            }
            if !self.shared.inbox.is_late() {
                self.shared.begin_pace();
            }
            match self.shared.inbox.take(self.options.flush) {
                Taken::Batch(batch) => self.write(batch),
                Taken::Order(order) => self.carry_out(order, Instant::now()),
                Taken::Nothing => {}
                Taken::End => break,
            }
            if let Err(error) = self.tick(Instant::now()) {
                self.fail(error, Instant::now());
            }
        }
        self.end();
    }

    /// After an error: what is held, or at least an open file.
    fn resume(&mut self, now: Instant) {
        if self.held.is_some() {
            return self.write_held(now);
        }
        match self.keep_free(0).and_then(|()| self.opened(now)) {
            Ok(()) => self.shared.counts().told.problem = None,
            Err(error) => drop(self.fail(error, now)),
        }
    }

    fn write(&mut self, batch: Batch) {
        self.epoch = batch.messages().map(|(_, message)| message.epoch).fold(self.epoch, u64::max);
        self.shared.counts().held = batch.len() as u64;
        self.held = Some(batch);
        self.write_held(Instant::now());
    }

    /// Tries what is held; once more at once if the error may be one of the file alone.
    fn write_held(&mut self, now: Instant) {
        let Some(batch) = self.held.take() else { return };
        loop {
            match self.try_write(&batch, now) {
                Ok(()) => break,
                Err(error) => {
                    if !self.fail(error, now) {
                        self.held = Some(batch);
                        return;
                    }
                }
            }
        }
        self.retry_at = None;
        batch.messages().for_each(|(at, _)| self.channels[at].count_written());
        self.newest.note(&batch, &self.channels);
        let mut counts = self.shared.counts();
        counts.told.written += batch.len() as u64;
        counts.held = 0;
        counts.told.problem = None;
        drop(counts);
        self.shared.inbox.give_back(batch);
    }

    fn try_write(&mut self, batch: &Batch, now: Instant) -> Result<(), DiskError> {
        let more = batch.bytes() as u64;
        self.keep_free(more)?;
        let rotation = self.options.rotation;
        let is_full = |current: &Current| {
            current.has_content() && rotation.is_due(current.file.bytes(), more, now.duration_since(current.opened))
        };
        if self.current.as_ref().is_some_and(is_full) {
            self.close("rotated")?;
        }
        self.opened(now)?;
        self.learn_channels();
        if let Some(current) = &mut self.current {
            current.describe(&self.described, &self.channels, self.epoch)?;
            current.begin(&self.newest, batch, &self.channels)?;
            // Before the messages behind the gap: whatever is read of them, the file tells what is missing.
            current.tell_lost(&self.channels)?;
            current.write(batch, &self.channels, self.shared.inbox.is_pressed())?;
            self.shared.counts().bytes_now = current.file.bytes();
        }
        Ok(())
    }

    fn learn_channels(&mut self) {
        let known = self.channels.len();
        self.channels.extend(self.shared.channels_from(known));
        self.newest.learn(&self.channels);
        let known = self.described.len();
        self.described.extend(self.shared.described_from(known));
    }

    /// What is due by time.
    fn tick(&mut self, now: Instant) -> Result<(), DiskError> {
        self.learn_channels();
        let Some(current) = &mut self.current else { return Ok(()) };
        current.describe_modules(&self.described)?;
        if now.duration_since(current.synced) >= self.options.sync {
            current.tell_lost(&self.channels)?;
            current.sync(&mut *self.disk, now)?;
            let mut counts = self.shared.counts();
            counts.told.synced = counts.told.written - counts.told.unsure;
        }
        if current.has_content() && self.options.rotation.is_due(0, 0, now.duration_since(current.opened)) {
            self.close("rotated")?;
        }
        Ok(())
    }

    /// Leaves to others what was promised. A file is closed in time, while there is room for its index.
    fn keep_free(&mut self, more: u64) -> Result<(), DiskError> {
        let told = self.check_free(more);
        if matches!(told, Err(DiskError::Low { .. })) {
            self.close("low space")?;
        }
        told
    }

    fn check_free(&mut self, more: u64) -> Result<(), DiskError> {
        let folder = self.options.folder.clone();
        let free = self.disk.free_bytes(&folder);
        let free_bytes = free.map_err(|error| DiskError::new("look for free space", &folder, error))?;
        let leave_bytes = self.options.leave_bytes;
        if leave_bytes == 0 || free_bytes >= leave_bytes.saturating_add(more) {
            return Ok(());
        }
        Err(DiskError::Low { folder: Shown(folder), free_bytes, leave_bytes })
    }

    /// Makes sure that a file is open.
    fn opened(&mut self, now: Instant) -> Result<(), DiskError> {
        if self.current.is_some() {
            return Ok(());
        }
        let file = self.create()?;
        self.begin(file, now)
    }

    /// Says in a new file what each says first.
    fn begin(&mut self, file: OpenFile, now: Instant) -> Result<(), DiskError> {
        self.shared.counts().told.file = Some(file.path().to_owned());
        let current = self.current.insert(Current::new(file, &self.options, self.lost_told.clone(), now));
        let number = self.number;
        self.number += 1;
        current.introduce(&self.session, &self.identity, number)
    }

    /// A file of the next name that is not taken.
    fn create(&mut self) -> Result<OpenFile, DiskError> {
        loop {
            let path = rotate::path(&self.options.folder, &self.options.stem, self.number);
            self.check_root(&path)?;
            match OpenFile::create(&mut *self.disk, &path, self.options.mode) {
                Err(DiskError::Other { error, .. })
                    if error.kind() == io::ErrorKind::AlreadyExists && self.number < NUMBER_MAX =>
                {
                    self.number += 1;
                }
                told => return told,
            }
        }
    }

    /// Whether a file is where files may be. A folder may be a link by now.
    fn check_root(&self, path: &Path) -> Result<(), DiskError> {
        let Options { folder, root: Some(root), .. } = &self.options else { return Ok(()) };
        let found =
            |folder: &Path| folder.canonicalize().map_err(|error| DiskError::new("find the folder", path, error));
        if found(folder)?.starts_with(found(root)?) {
            return Ok(());
        }
        Err(DiskError::Outside { folder: Shown(folder.clone()), root: Shown(root.clone()) })
    }

    /// Closes the file, if there is one.
    fn close(&mut self, reason: &str) -> Result<(), DiskError> {
        let Some(current) = &mut self.current else { return Ok(()) };
        current.describe_modules(&self.described)?;
        let texts = BTreeMap::from([("reason".to_owned(), reason.to_owned())]);
        current.tell_lost(&self.channels)?;
        current.file.metadata(metadata::CLOSED, &texts)?;
        let bytes = current.file.close(&mut *self.disk)?;
        self.lost_told = current.lost_told().to_vec();
        self.current = None;
        let mut counts = self.shared.counts();
        counts.told.file = None;
        counts.told.files_closed += 1;
        counts.bytes_before += bytes;
        counts.bytes_now = 0;
        counts.told.synced = counts.told.written - counts.told.unsure;
        Ok(())
    }

    /// Counts an error, gives the file up, and says when to try again: at once if this file had been good so far, for
    /// then the error may be one of this file.
    fn fail(&mut self, error: DiskError, now: Instant) -> bool {
        self.retry_at = Some(now + self.options.retry);
        let had_messages = match self.current.take() {
            Some(current) if current.has_content() => {
                self.lost_told = current.lost_told().to_vec();
                self.give_up(current.file, current.messages, current.unsynced, &error);
                true
            }
            Some(current) => {
                self.lost_told = current.lost_before().to_vec();
                self.number -= 1;
                self.discard(current.file);
                false
            }
            None => false,
        };
        self.shared.counts().fail(error, now);
        had_messages
    }

    /// A file with messages, torn behind them.
    fn give_up(&mut self, mut file: OpenFile, messages: u64, unsynced: u64, error: &DiskError) {
        let is_synced = file.sync(&mut *self.disk).is_ok();
        let unsure = match error {
            DiskError::Gone { .. } => messages,
            // The kernel tells of a failed sync once; another one finds nothing wrong.
            DiskError::Sync { .. } => unsynced,
            _ if is_synced => 0,
            _ => unsynced,
        };
        let bytes = file.abandon();
        let mut counts = self.shared.counts();
        counts.told.file = None;
        counts.told.files_torn += 1;
        counts.bytes_before += bytes;
        counts.bytes_now = 0;
        counts.told.unsure += unsure;
        counts.told.synced = counts.told.written - counts.told.unsure;
    }

    /// A file without messages is of no use to anybody.
    fn discard(&mut self, file: OpenFile) {
        let path = file.path().to_owned();
        file.abandon();
        // If it cannot be removed either, it stays: empty, and readable by `recover`.
        let _ = self.disk.remove(&path);
        let mut counts = self.shared.counts();
        counts.told.file = None;
        counts.bytes_now = 0;
    }

    /// Writes what waits, or counts it as lost.
    fn end(mut self) {
        let mut is_failing = false;
        if self.held.is_some() {
            self.write_held(Instant::now());
            is_failing = self.held.is_some();
        }
        while !is_failing {
            match self.shared.inbox.take(Duration::ZERO) {
                Taken::Batch(batch) => self.write(batch),
                Taken::Order(order) => self.carry_out(order, Instant::now()),
                Taken::Nothing | Taken::End => break,
            }
            is_failing = self.held.is_some();
        }
        if let Some(batch) = self.held.take() {
            self.lose(&batch);
        }
        loop {
            match self.shared.inbox.take(Duration::ZERO) {
                Taken::Batch(batch) => self.lose(&batch),
                // Unanswered: the recording ends before it.
                Taken::Order(_) => {}
                Taken::Nothing | Taken::End => break,
            }
        }
        self.shared.counts().held = 0;
        let told = self.opened_to_tell(is_failing).and_then(|()| self.close("ended"));
        if let Err(error) = told {
            self.fail(error, Instant::now());
        }
        self.shared.put_newest(Earlier::new(self.channels, self.newest));
    }

    /// Losses that no file tells, as the last one was closed before, have one more.
    fn opened_to_tell(&mut self, is_failing: bool) -> Result<(), DiskError> {
        self.learn_channels();
        let lost: Vec<Losses> = self.channels.iter().map(|channel| channel.losses()).collect();
        if is_failing || is_told(&lost, &self.lost_told) { Ok(()) } else { self.opened(Instant::now()) }
    }

    fn lose(&mut self, batch: &Batch) {
        self.learn_channels();
        batch.messages().for_each(|(at, _)| self.channels[at].count_lost(LossCause::Disk, 1));
        // It is newer than what was written: the next recording does not begin with an older value.
        self.newest.note(batch, &self.channels);
    }
}
