//! How a recording goes: counted by the thread that writes, read by anything.

use crate::error::DiskError;
use crate::loss::{LossCause, LossCounters, Losses};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Instant;

/// How a recording goes.
///
/// Nothing goes uncounted: while no message comes and none is written, `written + lost + waiting` are all that were to
/// be recorded.
#[derive(Clone, Debug, Default)]
pub struct Status {
    /// The file that is written now.
    pub file: Option<PathBuf>,
    /// Files that were closed whole.
    pub files_closed: u64,
    /// Files that were given up after an error; `recover` makes them whole.
    pub files_torn: u64,
    /// Length of all of them.
    pub bytes: u64,
    /// Messages that are in files: if the recorder is killed, they are not lost.
    pub written: u64,
    /// Of those, how many the disk has for certain, also after a loss of power.
    pub synced: u64,
    /// Of those written, how many may be lost: their file was removed, or its sync failed.
    pub unsure: u64,
    /// Messages that are in no file and will not be, with those lost before they came here.
    pub lost: u64,
    /// Why they are.
    pub losses: Losses,
    /// Messages in memory.
    pub waiting: u64,
    /// What is wrong now. Nothing is written until it is over, and messages wait in memory.
    pub problem: Option<Problem>,
    /// What has gone wrong so far.
    pub failures: Failures,
    /// False if the thread that writes has ended.
    pub is_running: bool,
    /// By channel, in the order in which they were added.
    pub channels: Vec<ChannelStatus>,
}

/// A channel of one writer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ChannelId(pub(crate) usize);

/// How one channel goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelStatus {
    /// Name and item.
    pub topic: String,
    /// In files.
    pub written: u64,
    /// In no file.
    pub lost: u64,
    /// Why they are in none.
    pub losses: Losses,
}

/// Why nothing is written.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The newest error.
    pub error: DiskError,
    /// When the first one came.
    pub since: Instant,
    /// How often writing was tried since.
    pub tries: u64,
}

/// Errors of the disk, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Failures {
    /// [`DiskError::Full`].
    pub full: u64,
    /// [`DiskError::Low`].
    pub low: u64,
    /// [`DiskError::ReadOnly`].
    pub read_only: u64,
    /// [`DiskError::Denied`].
    pub denied: u64,
    /// [`DiskError::Gone`].
    pub gone: u64,
    /// [`DiskError::Sync`].
    pub sync: u64,
    /// [`DiskError::Outside`] and [`DiskError::Other`].
    pub other: u64,
}

impl Failures {
    fn count(&mut self, error: &DiskError) {
        let counter = match error {
            DiskError::Full { .. } => &mut self.full,
            DiskError::Low { .. } => &mut self.low,
            DiskError::ReadOnly { .. } => &mut self.read_only,
            DiskError::Denied { .. } => &mut self.denied,
            DiskError::Gone { .. } => &mut self.gone,
            DiskError::Sync { .. } => &mut self.sync,
            DiskError::Outside { .. } | DiskError::Other { .. } => &mut self.other,
        };
        *counter += 1;
    }
}

/// What the thread counts.
#[derive(Clone, Default)]
pub(crate) struct Counts {
    /// What is told of it as it is.
    pub(crate) told: Status,
    /// Of files that are written no more.
    pub(crate) bytes_before: u64,
    /// Of the file that is.
    pub(crate) bytes_now: u64,
    /// Messages that the thread has taken and not written.
    pub(crate) held: u64,
}

impl Counts {
    pub(crate) fn fail(&mut self, error: DiskError, now: Instant) {
        self.told.failures.count(&error);
        let (since, tries) = self.told.problem.as_ref().map_or((now, 0), |problem| (problem.since, problem.tries));
        self.told.problem = Some(Problem { error, since, tries: tries + 1 });
    }
}

/// A channel, as the thread writes it, and what is counted of it. Counters are read for display and order nothing.
pub(crate) struct ChannelState {
    pub(crate) topic: String,
    pub(crate) schema_name: String,
    pub(crate) schema: Vec<u8>,
    /// Tells types apart.
    pub(crate) type_hash: u32,
    pub(crate) texts: BTreeMap<String, String>,
    written: AtomicU64,
    lost: LossCounters,
}

impl ChannelState {
    pub(crate) fn new(
        topic: String,
        (schema_name, schema, type_hash): (String, Vec<u8>, u32),
        texts: BTreeMap<String, String>,
    ) -> Self {
        let (written, lost) = (AtomicU64::default(), LossCounters::default());
        Self { topic, schema_name, schema, type_hash, texts, written, lost }
    }

    pub(crate) fn count_written(&self) {
        self.written.fetch_add(1, Relaxed);
    }

    pub(crate) fn count_lost(&self, cause: LossCause, count: u64) {
        self.lost.count(cause, count);
    }

    pub(crate) fn losses(&self) -> Losses {
        self.lost.read()
    }

    pub(crate) fn status(&self) -> ChannelStatus {
        let losses = self.losses();
        ChannelStatus { topic: self.topic.clone(), written: self.written.load(Relaxed), lost: losses.all(), losses }
    }
}
