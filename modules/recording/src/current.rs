//! The file that is written now, with what the recorder knows of it.

use crate::batch::{Batch, Message};
use crate::described::DescribedModule;
use crate::disk::Disk;
use crate::drawn::DrawingBeside;
use crate::error::DiskError;
use crate::format::{
    CHUNK_BYTES_MAX, MESSAGE_ENCODING, MESSAGE_OVERHEAD_BYTES, SCHEMA_ENCODING, VERSION, key, metadata, session_key,
};
use crate::loss::Losses;
use crate::newest::Newest;
use crate::options::{Options, Session};
use crate::order::Mark;
use crate::read::definitions::{Definition, SchemaText};
use crate::status::ChannelState;
use crate::write::file::OpenFile;
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// What is longer is not drawn while too much waits.
const DRAWN_PRESSED_BYTES_MAX: usize = 4 << 10;

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
    marks: u64,
    described: Vec<Described>,
    /// Of the present chunk, before compression.
    chunk_bytes: usize,
    drawing: Option<DrawingBeside>,
    /// It has what came before it.
    has_begun: bool,
    /// Modules that are described.
    modules: usize,
    /// Losses of each channel that earlier files tell.
    lost_before: Vec<Losses>,
    /// Losses that this one tells, too.
    lost_told: Vec<Losses>,
    epoch: Option<u64>,
}

impl Current {
    pub(crate) fn new(file: OpenFile, options: &Options, lost_before: Vec<Losses>, now: Instant) -> Self {
        Self {
            file,
            opened: now,
            synced: now,
            messages: 0,
            unsynced: 0,
            marks: 0,
            described: Vec::new(),
            chunk_bytes: 0,
            drawing: options.drawn.as_ref().map(DrawingBeside::new),
            has_begun: false,
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
        self.file.metadata(metadata::SESSION, &about)?;
        self.file.metadata(metadata::CONFIGURATION, &session.configuration)?;
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
            let id = self.channel(channel, schema, [(key::EPOCH, epoch.to_string())])?;
            self.described.push(Described { epoch, schema, id });
        }
        self.file.end_chunk()
    }

    /// Begins with the newest message of each channel that would be missing, before the first messages.
    pub(crate) fn begin(
        &mut self,
        newest: &Newest,
        batch: &Batch,
        channels: &[Arc<ChannelState>],
    ) -> Result<(), DiskError> {
        let Some((_, first)) = batch.messages().next().filter(|_| !self.has_begun) else { return Ok(()) };
        self.has_begun = true;
        let repeated = newest.before(batch);
        if repeated.is_empty() {
            return Ok(());
        }
        for (at, message) in repeated {
            let texts = [(key::EPOCH, message.epoch.to_string()), (key::REPEATED, "true".to_owned())];
            let id = self.channel(&channels[at], self.described[at].schema, texts)?;
            // So that the file's time begins with what is new in it.
            self.put(id, &Message { arrival_ns: first.arrival_ns, ..message }, true)?;
        }
        self.end_chunk()
    }

    /// Describes modules that are new here.
    pub(crate) fn describe_modules(&mut self, modules: &[Arc<DescribedModule>]) -> Result<(), DiskError> {
        if self.modules == modules.len() {
            return Ok(());
        }
        for module in &modules[self.modules..] {
            self.file.metadata(metadata::DESCRIPTION, &module.texts())?;
        }
        self.modules = modules.len();
        self.end_chunk()
    }

    /// Writes messages as a chunk; with what is drawn of them these may be several. Under pressure nothing long is
    /// drawn.
    pub(crate) fn write(
        &mut self,
        batch: &Batch,
        channels: &[Arc<ChannelState>],
        is_pressed: bool,
    ) -> Result<(), DiskError> {
        for (at, message) in batch.messages() {
            if self.epoch != Some(message.epoch) {
                self.tell_epoch(message.epoch, message.arrival_ns)?;
            }
            let mut known = self.described[at];
            if known.epoch != message.epoch {
                known.epoch = message.epoch;
                known.id = self.channel(&channels[at], known.schema, [(key::EPOCH, message.epoch.to_string())])?;
                self.described[at] = known;
            }
            self.put(known.id, &message, !is_pressed || message.data.len() <= DRAWN_PRESSED_BYTES_MAX)?;
        }
        self.end_chunk()?;
        self.messages += batch.len() as u64;
        self.unsynced += batch.len() as u64;
        Ok(())
    }

    /// The same topic has a channel for each epoch, and for what is repeated: texts that it has besides.
    fn channel<const N: usize>(
        &mut self,
        channel: &ChannelState,
        schema: u16,
        further: [(&str, String); N],
    ) -> Result<u16, DiskError> {
        let ChannelState { topic, schema_name, schema: data, texts, .. } = channel;
        let mut texts = texts.clone();
        texts.extend(further.map(|(key, text)| (key.to_owned(), text)));
        let id = self.file.channel(schema, topic, MESSAGE_ENCODING, &texts)?;
        if let Some(drawing) = self.drawing.as_mut().filter(|drawing| !drawing.knows(id)) {
            let schema = Arc::new(SchemaText::new(schema_name.clone(), SCHEMA_ENCODING.into(), data.clone()));
            let (topic, message_encoding) = (topic.clone(), MESSAGE_ENCODING.into());
            drawing.add(id, Definition { topic, message_encoding, texts, schema, ..Definition::default() });
        }
        Ok(id)
    }

    /// Adds a message to the present chunk, and what is drawn of it, if it is.
    fn put(&mut self, channel_id: u16, message: &Message<'_>, is_drawn: bool) -> Result<(), DiskError> {
        let Message { arrival_ns: log_time, stamp_ns: publish_time, sequence, data, .. } = *message;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        self.add(&header, data)?;
        let Some(drawing) = self.drawing.as_mut().filter(|_| is_drawn) else { return Ok(()) };
        for drawn in drawing.draw(channel_id, publish_time, data) {
            let Definition { topic, message_encoding, texts, schema, .. } = &*drawn.channel;
            let schema = self.file.schema(&schema.name, &schema.encoding, &schema.data)?;
            let channel_id = self.file.channel(schema, topic, message_encoding, texts)?;
            self.add(&MessageHeader { channel_id, ..header }, &drawn.data)?;
        }
        Ok(())
    }

    fn add(&mut self, header: &MessageHeader, data: &[u8]) -> Result<(), DiskError> {
        let more = data.len() + MESSAGE_OVERHEAD_BYTES;
        if self.chunk_bytes > 0 && self.chunk_bytes + more > CHUNK_BYTES_MAX {
            self.file.split_chunk()?;
            self.chunk_bytes = 0;
        }
        self.chunk_bytes += more;
        self.file.message(header, data)
    }

    fn end_chunk(&mut self) -> Result<(), DiskError> {
        self.chunk_bytes = 0;
        self.file.end_chunk()
    }

    /// Sets a mark, behind what is written.
    pub(crate) fn mark(&mut self, mark: &Mark) -> Result<(), DiskError> {
        self.file.metadata(metadata::MARK, &mark.texts())?;
        self.end_chunk()?;
        self.marks += 1;
        Ok(())
    }

    /// Without, it is of no use to anybody.
    pub(crate) fn has_content(&self) -> bool {
        self.messages > 0 || self.marks > 0
    }

    /// System time has stepped. Only a later epoch is news: streams learn of a step one after the other.
    fn tell_epoch(&mut self, epoch: u64, arrival_ns: u64) -> Result<(), DiskError> {
        if self.epoch.is_some_and(|newest| newest > epoch) {
            return Ok(());
        }
        self.epoch = Some(epoch);
        let texts = [("epoch", epoch), ("arrival-ns", arrival_ns)];
        let texts = texts.into_iter().map(|(key, number)| (key.to_owned(), number.to_string()));
        self.file.metadata(metadata::EPOCH, &texts.collect())
    }

    /// Tells losses that are not told yet.
    pub(crate) fn tell_lost(&mut self, channels: &[Arc<ChannelState>]) -> Result<(), DiskError> {
        let lost: Vec<Losses> = channels.iter().map(|channel| channel.losses()).collect();
        if is_told(&lost, &self.lost_told) {
            return Ok(());
        }
        let (mut counts, mut causes) = (BTreeMap::new(), BTreeMap::new());
        for (at, channel) in channels.iter().enumerate() {
            let new = lost[at].since(&self.lost_before.get(at).copied().unwrap_or_default());
            if new != Losses::default() {
                counts.insert(channel.topic.clone(), new.all().to_string());
                causes.extend(new.texts(&channel.topic));
            }
        }
        self.file.metadata(metadata::LOST, &counts)?;
        self.file.metadata(metadata::LOST_BY, &causes)?;
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

    /// Earlier files tell these losses: the one before it was still open when it was made.
    pub(crate) fn follow(&mut self, lost_before: Vec<Losses>) {
        self.lost_told = lost_before.clone();
        self.lost_before = lost_before;
    }

    /// Losses that files tell, if this one is kept.
    pub(crate) fn lost_told(&self) -> &[Losses] {
        &self.lost_told
    }

    /// Losses that files tell without this one.
    pub(crate) fn lost_before(&self) -> &[Losses] {
        &self.lost_before
    }
}

/// Whether these losses of the channels are what was told. A channel that is new has none.
pub(crate) fn is_told(lost: &[Losses], told: &[Losses]) -> bool {
    let all = |losses: &[Losses]| losses.iter().map(Losses::all).fold(0, u64::saturating_add);
    all(lost) == all(told)
}
