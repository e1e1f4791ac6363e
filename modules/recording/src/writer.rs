//! The end of a recording that programs hold: channels, messages, counts. It never waits for the disk.

use crate::batch::Message;
use crate::described::DescribedModule;
use crate::disk::{Disk, RealDisk};
use crate::error::DiskError;
use crate::format::{MESSAGE_BYTES_MAX, key, topic};
use crate::inbox::Inbox;
use crate::loss::LossCause;
use crate::newest::{Earlier, Newest};
use crate::options::{Options, Session};
use crate::order::{Mark, Order, OrderError, OrderKind, PendingOrder};
use crate::recorder::Recorder;
use crate::shared::Shared;
use crate::status::{ChannelId, ChannelState, Status};
use rohrpost_schema::{Description, Type, describe_type};
use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use thiserror::Error;

/// Channels that a file can have.
const CHANNELS_MAX: usize = 10_000;

/// What is recorded on a channel.
#[derive(Clone, Debug)]
pub struct ChannelSpec<'a> {
    /// What publishes: `laser.0`.
    pub name: &'a str,
    /// What it publishes: `scan`.
    pub item: &'a str,
    /// How its bytes are to be read.
    pub ty: &'a Type,
    /// Anything else that replay should know.
    pub texts: BTreeMap<String, String>,
}

/// Why recording does not begin.
#[derive(Debug, Error)]
pub enum StartError {
    /// It would lead to another folder, or be hidden.
    #[error("`{0}` cannot begin a file name; use letters, digits, `-` and `_`")]
    Stem(String),
    /// No thread.
    #[error("cannot start the thread that writes: {0}")]
    Thread(io::Error),
}

/// Why a channel is not added.
#[derive(Debug, PartialEq, Eq, Error)]
pub enum ChannelError {
    /// One name has one type.
    #[error("{topic} is recorded with type {recorded} already, not {offered}; end the recording and begin another")]
    OtherType {
        /// Name and item.
        topic: String,
        /// The type so far.
        recorded: String,
        /// The other one.
        offered: String,
    },
    /// There is an end to everything.
    #[error("a recording has at most {CHANNELS_MAX} channels; record fewer items")]
    TooMany,
}

/// A module's description is not recorded, since one name has one interface.
#[derive(Debug, PartialEq, Eq, Error)]
#[error(
    "{name} is recorded with interface {recorded:08x} already, not {offered:08x}; end the recording and begin another"
)]
pub struct OtherInterface {
    /// The module.
    pub name: String,
    /// Hash of the interface so far.
    pub recorded: u32,
    /// Of the other one.
    pub offered: u32,
}

/// Why a message is not recorded. It is counted as lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum WriteError {
    /// What comes is not written as fast, and its channel has its share of the queue.
    #[error("no room in the queue: {} (see the status)", .0.text())]
    Full(LossCause),
    /// Longer than a message can be.
    #[error("a message of {0} bytes; a recording takes up to {MESSAGE_BYTES_MAX}")]
    Long(usize),
    /// The id is of another writer. Not counted.
    #[error("no such channel in this recording; use the id that `Writer::channel` of this writer gave")]
    NoChannel,
}

/// Writes a recording. Files are written by a thread of its own, which ends with this.
pub struct Writer {
    shared: Arc<Shared>,
    channels: Vec<Arc<ChannelState>>,
    /// Names of described modules, and hashes of their interfaces.
    described: BTreeMap<String, u32>,
    /// Most bytes of a file.
    file_bytes: u64,
    thread: Option<JoinHandle<()>>,
}

impl Writer {
    /// Begins. Errors of the disk are told by [`Writer::status`].
    ///
    /// # Errors
    /// When the stem is no name, or there is no thread.
    pub fn start(options: Options, session: Session) -> Result<Self, StartError> {
        Self::start_on(Box::new(RealDisk), options, session)
    }

    /// Begins behind another recording: the first file begins with the newest messages of that, and of what came since,
    /// as each further file does with those of the file before.
    ///
    /// # Errors
    /// As of [`Self::start`].
    pub fn start_behind(earlier: Option<Earlier>, options: Options, session: Session) -> Result<Self, StartError> {
        Self::begin(Box::new(RealDisk), earlier, options, session)
    }

    /// The same as [`Self::start`] on another disk.
    pub(crate) fn start_on(disk: Box<dyn Disk>, options: Options, session: Session) -> Result<Self, StartError> {
        Self::begin(disk, None, options, session)
    }

    fn begin(
        disk: Box<dyn Disk>,
        earlier: Option<Earlier>,
        options: Options,
        session: Session,
    ) -> Result<Self, StartError> {
        let stem = &options.stem;
        if stem.is_empty() || stem.starts_with('.') || stem.contains(['/', '\0', '\n']) {
            return Err(StartError::Stem(stem.clone()));
        }
        let shared = Arc::new(Shared::new(Inbox::new(options.queue_chunks)));
        let file_bytes = options.rotation.bytes_max;
        let recorder = Recorder::new(disk, Newest::behind(earlier, file_bytes), options, session, shared.clone());
        let thread = std::thread::Builder::new().name("recording".into()).spawn(|| recorder.run());
        let thread = Some(thread.map_err(StartError::Thread)?);
        Ok(Self { shared, channels: Vec::new(), described: BTreeMap::new(), file_bytes, thread })
    }

    /// Adds a channel. The same one again is the same.
    ///
    /// # Errors
    /// When there is one of the same name with another type.
    pub fn channel(&mut self, spec: &ChannelSpec<'_>) -> Result<ChannelId, ChannelError> {
        let topic = topic(spec.name, spec.item);
        let channels = &self.channels;
        if let Some(at) = channels.iter().position(|channel| channel.topic == topic) {
            if channels[at].type_hash == spec.ty.hash() {
                return Ok(ChannelId(at));
            }
            let recorded =
                Type::from_bytes(&channels[at].schema).map_or_else(|e| e.to_string(), |ty| describe_type(&ty));
            return Err(ChannelError::OtherType { topic, recorded, offered: describe_type(spec.ty) });
        }
        if channels.len() >= CHANNELS_MAX {
            return Err(ChannelError::TooMany);
        }
        let mut texts = spec.texts.clone();
        texts.insert(key::NAME.into(), spec.name.into());
        texts.insert(key::ITEM.into(), spec.item.into());
        let schema = (type_name(spec.ty), spec.ty.to_bytes(), spec.ty.hash());
        let channel = Arc::new(ChannelState::new(topic, schema, texts));
        self.shared.add(channel.clone());
        self.channels.push(channel);
        Ok(ChannelId(self.channels.len() - 1))
    }

    /// Describes a module in each file, so that replay can stand in for it. The same again is no news.
    ///
    /// # Errors
    /// When it is described with another interface already.
    pub fn describe(&mut self, name: &str, description: &Description) -> Result<(), OtherInterface> {
        let offered = description.hash();
        if let Some(recorded) = self.described.get(name).copied() {
            let is_same = recorded == offered;
            return if is_same { Ok(()) } else { Err(OtherInterface { name: name.into(), recorded, offered }) };
        }
        self.described.insert(name.into(), offered);
        self.shared.describe(Arc::new(DescribedModule { name: name.into(), description: description.clone() }));
        Ok(())
    }

    /// Records a message. Takes as long as copying it.
    ///
    /// # Errors
    /// When it is not recorded; then it is counted as lost.
    pub fn write(&mut self, channel: ChannelId, message: &Message<'_>) -> Result<(), WriteError> {
        let len = message.data.len();
        if channel.0 >= self.channels.len() {
            return Err(WriteError::NoChannel);
        }
        let (cause, refused) = if len > MESSAGE_BYTES_MAX {
            (LossCause::Long, WriteError::Long(len))
        } else if self.shared.inbox.put(channel.0, message) {
            return Ok(());
        } else {
            let cause = self.shared.why_full();
            (cause, WriteError::Full(cause))
        };
        self.count_lost(channel, cause, 1);
        Err(refused)
    }

    /// Messages that were lost before they came here, as a slow reader of a stream is told.
    pub fn count_lost(&mut self, channel: ChannelId, cause: LossCause, count: u64) {
        if let Some(channel) = self.channels.get(channel.0) {
            channel.count_lost(cause, count);
        }
    }

    /// Sets a mark behind all messages so far.
    ///
    /// # Errors
    /// When its text is none, or the queue is full.
    pub fn mark(&mut self, mark: Mark) -> Result<PendingOrder, OrderError> {
        mark.check()?;
        self.order(OrderKind::Mark(mark))
    }

    /// Closes the file behind all messages so far, and begins the next. One that has nothing in it stays.
    ///
    /// # Errors
    /// When the queue is full.
    pub fn rotate(&mut self) -> Result<PendingOrder, OrderError> {
        self.order(OrderKind::Rotate)
    }

    /// Goes on in another folder, which must exist. If no file can be made there, the present one goes on. Also while
    /// the disk fails: what waits comes to the new folder.
    ///
    /// # Errors
    /// When the queue is full.
    pub fn move_to(&mut self, folder: PathBuf) -> Result<PendingOrder, OrderError> {
        self.order(OrderKind::Move(folder))
    }

    fn order(&mut self, kind: OrderKind) -> Result<PendingOrder, OrderError> {
        let (order, pending) = Order::new(kind);
        self.shared.inbox.put_order(order)?;
        Ok(pending)
    }

    /// Takes no more. What waits is written, and the file closed, without waiting for it: then
    /// [`Status::is_running`] is false, and [`Writer::finish`] tells at once how it ended.
    pub fn begin_end(&mut self) {
        self.shared.inbox.end();
    }

    /// For what comes from now on, as this recording ends.
    pub fn passed_over(&self) -> Earlier {
        Earlier::new(self.channels.clone(), Newest::new(self.file_bytes))
    }

    /// Writes what waits, closes the file, and hands out the newest messages, also those that it began with; none the
    /// second time.
    pub fn take_newest(&mut self) -> Option<Earlier> {
        self.end();
        self.shared.take_newest()
    }

    /// How it goes.
    pub fn status(&self) -> Status {
        self.shared.status(self.thread.as_ref().is_some_and(|thread| !thread.is_finished()))
    }

    /// Writes what waits, and closes the file.
    ///
    /// # Errors
    /// When the disk fails; the status is told all the same.
    pub fn finish(mut self) -> (Status, Result<(), DiskError>) {
        self.end();
        let status = self.status();
        let told = status.problem.clone().map_or(Ok(()), |problem| Err(problem.error));
        (status, told)
    }

    fn end(&mut self) {
        self.shared.inbox.end();
        if let Some(thread) = self.thread.take() {
            // What it had to say is in the status.
            let _ = thread.join();
        }
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.end();
    }
}

/// The name that its author gave, or what it is made of.
fn type_name(ty: &Type) -> String {
    match ty {
        Type::Struct(named) => named.name.clone(),
        Type::Enum { name, .. } => name.clone(),
        other => describe_type(other),
    }
}
