//! What the writer and its thread have in common.

use crate::described::DescribedModule;
use crate::inbox::Inbox;
use crate::loss::{LossCause, Losses};
use crate::newest::Earlier;
use crate::pace::Pace;
use crate::status::{ChannelState, Counts, Status};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The queue, the channels, the modules and the counts.
pub(crate) struct Shared {
    pub(crate) inbox: Inbox,
    channels: Mutex<Vec<Arc<ChannelState>>>,
    described: Mutex<Vec<Arc<DescribedModule>>>,
    counts: Mutex<Counts>,
    /// Of the thread, since nothing waited for it.
    pace: Mutex<Option<Pace>>,
    /// Of a recording that has ended.
    newest: Mutex<Option<Earlier>>,
}

impl Shared {
    pub(crate) fn new(inbox: Inbox) -> Self {
        let (channels, described) = (Mutex::default(), Mutex::default());
        Self { inbox, channels, described, counts: Mutex::default(), pace: Mutex::default(), newest: Mutex::default() }
    }

    pub(crate) fn add(&self, channel: Arc<ChannelState>) {
        self.channels.lock().unwrap_or_else(PoisonError::into_inner).push(channel);
    }

    /// Those behind the first `known`.
    pub(crate) fn channels_from(&self, known: usize) -> Vec<Arc<ChannelState>> {
        self.channels.lock().unwrap_or_else(PoisonError::into_inner)[known..].to_vec()
    }

    pub(crate) fn describe(&self, module: Arc<DescribedModule>) {
        self.described.lock().unwrap_or_else(PoisonError::into_inner).push(module);
    }

    /// Those behind the first `known`.
    pub(crate) fn described_from(&self, known: usize) -> Vec<Arc<DescribedModule>> {
        self.described.lock().unwrap_or_else(PoisonError::into_inner)[known..].to_vec()
    }

    pub(crate) fn put_newest(&self, newest: Earlier) {
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(newest);
    }

    pub(crate) fn take_newest(&self) -> Option<Earlier> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    pub(crate) fn counts(&self) -> MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The thread has nothing to do just now.
    pub(crate) fn begin_pace(&self) {
        let mut pace = self.pace.lock().unwrap_or_else(PoisonError::into_inner);
        pace.get_or_insert_with(Pace::of_this_thread).begin();
    }

    /// Why there is no room for what comes.
    pub(crate) fn why_full(&self) -> LossCause {
        if self.counts().told.problem.is_some() {
            return LossCause::Disk;
        }
        let pace = self.pace.lock().unwrap_or_else(PoisonError::into_inner);
        pace.as_ref().map_or(LossCause::Processor, Pace::cause_beside_disk)
    }

    pub(crate) fn status(&self, is_running: bool) -> Status {
        let channels: Vec<_> = self.channels_from(0).iter().map(|channel| channel.status()).collect();
        let mut losses = Losses::default();
        channels.iter().for_each(|channel| losses += channel.losses);
        let Counts { told, bytes_before, bytes_now, held } = self.counts().clone();
        let (bytes, waiting) = (bytes_before + bytes_now, self.inbox.waiting() + held);
        Status { bytes, lost: losses.all(), losses, waiting, is_running, channels, ..told }
    }
}
