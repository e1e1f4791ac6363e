//! The file that is written now, with what the recorder knows of it.

use crate::batch::Batch;
use crate::described::DescribedModule;
use crate::disk::Disk;
use crate::error::DiskError;
use crate::file::OpenFile;
use crate::format::{MESSAGE_ENCODING, SCHEMA_ENCODING, VERSION, key, metadata, session_key};
use crate::options::Session;
use crate::status::ChannelState;
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// A channel as this file has it.
#[derive(Clone, Copy)]
struct Described {
    epoch: u64,
    schema: u16,
    id: u16,
}

/// The file that is written now.
pub(crate) struct Current {
    pub(crate) file: OpenFile,
    pub(crate) opened: Instant,
    pub(crate) synced: Instant,
    /// Messages in its whole chunks.
    pub(crate) messages: u64,
    /// Of those, how many came behind the last sync.
    pub(crate) unsynced: u64,
    described: Vec<Described>,
    /// Modules that are described.
    modules: usize,
    /// Losses of each channel that earlier files tell.
    lost_before: Vec<u64>,
    /// Losses that this one tells, too.
    lost_told: Vec<u64>,
    epoch: Option<u64>,
}

impl Current {
    pub(crate) fn new(file: OpenFile, lost_before: Vec<u64>, now: Instant) -> Self {
        Self {
            file,
            opened: now,
            synced: now,
            messages: 0,
            unsynced: 0,
            described: Vec::new(),
            modules: 0,
            lost_told: lost_before.clone(),
            lost_before,
            epoch: None,
        }
    }

    /// Says what each file of a recording says of it, so that it stands alone.
    pub(crate) fn introduce(&mut self, session: &Session, recording: &str, number: u32) -> Result<(), DiskError> {
        let mut about = session.versions.clone();
        about.insert(session_key::RECORDING.into(), recording.into());
        about.insert("format".into(), VERSION.to_string());
        about.insert("node".into(), session.node.clone());
        about.insert("file".into(), number.to_string());
        self.file.metadata(metadata::SESSION, about)?;
        self.file.metadata(metadata::CONFIGURATION, session.configuration.clone())?;
        self.file.end_chunk()
    }

    /// Describes modules and channels that are new here; channels in a chunk of their own: they are found though
    /// another chunk is damaged.
    pub(crate) fn describe(
        &mut self,
        modules: &[Arc<DescribedModule>],
        channels: &[Arc<ChannelState>],
        epoch: u64,
    ) -> Result<(), DiskError> {
        self.describe_modules(modules)?;
        if self.described.len() == channels.len() {
            return Ok(());
        }
        for channel in &channels[self.described.len()..] {
            let schema = self.file.schema(&channel.schema_name, SCHEMA_ENCODING, &channel.schema)?;
            let id = channel_of_epoch(&mut self.file, channel, schema, epoch)?;
            self.described.push(Described { epoch, schema, id });
        }
        self.file.end_chunk()
    }

    /// Describes modules that are new here.
    pub(crate) fn describe_modules(&mut self, modules: &[Arc<DescribedModule>]) -> Result<(), DiskError> {
        if self.modules == modules.len() {
            return Ok(());
        }
        for module in &modules[self.modules..] {
            self.file.metadata(metadata::DESCRIPTION, module.texts())?;
        }
        self.modules = modules.len();
        self.file.end_chunk()
    }

    /// Writes messages as a chunk.
    pub(crate) fn write(&mut self, batch: &Batch, channels: &[Arc<ChannelState>]) -> Result<(), DiskError> {
        for (at, message) in batch.messages() {
            if self.epoch != Some(message.epoch) {
                self.tell_epoch(message.epoch, message.arrival_ns)?;
            }
            let known = &mut self.described[at];
            if known.epoch != message.epoch {
                known.id = channel_of_epoch(&mut self.file, &channels[at], known.schema, message.epoch)?;
                known.epoch = message.epoch;
            }
            let header = MessageHeader {
                channel_id: known.id,
                sequence: message.sequence,
                log_time: message.arrival_ns,
                publish_time: message.stamp_ns,
            };
            self.file.message(&header, message.data)?;
        }
        self.file.end_chunk()?;
        self.messages += batch.len() as u64;
        self.unsynced += batch.len() as u64;
        Ok(())
    }

    /// System time has stepped. Only a later epoch is news: streams learn of a step one after the other.
    fn tell_epoch(&mut self, epoch: u64, arrival_ns: u64) -> Result<(), DiskError> {
        if self.epoch.is_some_and(|newest| newest > epoch) {
            return Ok(());
        }
        self.epoch = Some(epoch);
        let texts = [("epoch", epoch), ("arrival-ns", arrival_ns)];
        let texts = texts.into_iter().map(|(key, number)| (key.to_owned(), number.to_string()));
        self.file.metadata(metadata::EPOCH, texts.collect())
    }

    /// Tells losses that are not told yet.
    pub(crate) fn tell_lost(&mut self, channels: &[Arc<ChannelState>]) -> Result<(), DiskError> {
        let lost: Vec<u64> = channels.iter().map(|channel| channel.lost()).collect();
        if lost.iter().sum::<u64>() == self.lost_told.iter().sum() {
            return Ok(());
        }
        let before = self.lost_before.iter().chain(std::iter::repeat(&0));
        let counts = lost.iter().zip(before).map(|(lost, before)| lost - before);
        let texts: BTreeMap<String, String> = channels
            .iter()
            .zip(counts)
            .filter(|(_, count)| *count > 0)
            .map(|(channel, count)| (channel.topic.clone(), count.to_string()))
            .collect();
        self.file.metadata(metadata::LOST, texts)?;
        self.file.end_chunk()?;
        self.lost_told = lost;
        Ok(())
    }

    pub(crate) fn sync(&mut self, disk: &mut dyn Disk, now: Instant) -> Result<(), DiskError> {
        self.file.sync(disk)?;
        self.unsynced = 0;
        self.synced = now;
        Ok(())
    }

    /// Losses that files tell, if this one is kept.
    pub(crate) fn lost_told(&self) -> &[u64] {
        &self.lost_told
    }

    /// Losses that files tell without this one.
    pub(crate) fn lost_before(&self) -> &[u64] {
        &self.lost_before
    }
}

/// The same topic has a channel for each epoch.
fn channel_of_epoch(file: &mut OpenFile, channel: &ChannelState, schema: u16, epoch: u64) -> Result<u16, DiskError> {
    let mut texts = channel.texts.clone();
    texts.insert(key::EPOCH.into(), epoch.to_string());
    file.channel(schema, &channel.topic, MESSAGE_ENCODING, &texts)
}
