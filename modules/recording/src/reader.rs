//! Messages of a file, one after the other, as replay needs them.

use crate::batch::Message;
use crate::error::ReadError;
use crate::format::{is_of_others, key};
use crate::read::contents::{Contents, Ending, Found, Item};
use crate::read::definitions::Definition;
use crate::read::frames::Frames;
use crate::read::index::Index;
use crate::read::ordered::{OrderedBatch, TimePlan};
use crate::read::selected::Selected;
use crate::selection::{SelectError, Selection};
use rohrpost_schema::Type;
use rohrpost_schema::plain::ForeignText;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Receiver;

/// A channel, as a file describes it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedChannel {
    /// Name and item.
    pub topic: ForeignText,
    /// What published: `laser.0`; empty in files of other programs.
    pub name: ForeignText,
    /// What it published: `scan`.
    pub item: ForeignText,
    /// Its type, if it is one of ours.
    pub ty: Option<Arc<Type>>,
    /// `postcard` in our files.
    pub message_encoding: ForeignText,
    /// How its type is described: `rohrpost-schema` in our files; empty: not at all.
    pub schema_encoding: ForeignText,
    /// What else was said when it was recorded. In files of other programs without what they say under keys of ours,
    /// where it means something else.
    pub texts: BTreeMap<String, String>,
}

impl RecordedChannel {
    /// Whether it was drawn of another channel, for other programs: replay leaves it out.
    pub fn is_drawn(&self) -> bool {
        self.texts.contains_key(key::DRAWN)
    }

    /// Whether its messages came before this file, which begins with them so that it stands alone. They are in an
    /// earlier file, too.
    pub fn is_repeated(&self) -> bool {
        self.texts.contains_key(key::REPEATED)
    }
}

/// Reads a file, or a part of it, with one chunk in memory.
///
/// ```
/// # use rohrpost_recording::{ChannelSpec, Message, Options, Session, Writer};
/// # use rohrpost_schema::Type;
/// use rohrpost_recording::Reader;
///
/// # let folder = tempfile::tempdir()?;
/// # let mut writer = Writer::start(Options::new(folder.path(), "base"), Session::default())?;
/// # let spec = ChannelSpec { name: "motor.0", item: "speed", ty: &Type::U8, texts: Default::default() };
/// # let speed = writer.channel(&spec)?;
/// # writer.write(speed, &Message { arrival_ns: 12, stamp_ns: 10, epoch: 1, sequence: 0, data: &[7] })?;
/// # writer.finish().1?;
/// let mut reader = Reader::open(&folder.path().join("base-0001.mcap"))?;
/// while let Some((channel, message)) = reader.next()? {
///     assert_eq!((channel.name.as_str(), message.data), ("motor.0", &[7][..]));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Reader {
    source: ReaderSource,
    channels: BTreeMap<u16, Arc<RecordedChannel>>,
    found: Option<Found>,
    /// The message that was found is still to be read.
    is_ahead: bool,
}

/// What is read.
enum ReaderSource {
    /// From its beginning on.
    Whole(Contents),
    Part(Selected),
    /// In the order of time.
    InTime(ReaderInTime),
}

/// Messages that a thread puts in the order of time.
struct ReaderInTime {
    path: PathBuf,
    plan: TimePlan,
    batches: Receiver<Result<OrderedBatch, ReadError>>,
    batch: OrderedBatch,
    file_bytes: u64,
}

impl ReaderInTime {
    fn next(&mut self) -> Result<Option<Found>, ReadError> {
        if self.batch.found.is_empty() {
            // Its thread has ended behind the last one.
            let Ok(told) = self.batches.recv() else { return Ok(None) };
            self.batch = told?;
        }
        Ok(self.batch.found.pop_front())
    }
}

impl Reader {
    /// At the first message. The file need not be closed, but undamaged so far.
    ///
    /// # Errors
    /// When it is no MCAP file.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Ok(Self::of(ReaderSource::Whole(Contents::open(path)?)))
    }

    /// At the first message of those that are selected of a closed file. Chunks without any of them are not read.
    ///
    /// # Errors
    /// When it is no MCAP file, was not closed, or has no such name.
    pub fn select(path: &Path, selection: &Selection) -> Result<Self, SelectError> {
        Ok(Self::of(ReaderSource::Part(Selected::open(path, selection)?)))
    }

    /// As [`Self::open`], to be played: messages of another program's file come in the order of time, which need not be
    /// that of the file. In ours, time steps where it stepped while it was recorded.
    pub(crate) fn to_play(path: &Path) -> Result<Self, ReadError> {
        if !Contents::header_of(path)?.is_some_and(|header| is_of_others(&header)) {
            return Self::open(path);
        }
        let plan = TimePlan::of(path)?;
        let batches = plan.read(path, 0)?;
        let file_bytes = Frames::open(path)?.len();
        let (path, batch) = (path.to_owned(), OrderedBatch::default());
        Ok(Self::of(ReaderSource::InTime(ReaderInTime { path, plan, batches, batch, file_bytes })))
    }

    fn of(source: ReaderSource) -> Self {
        Self { source, channels: BTreeMap::new(), found: None, is_ahead: false }
    }

    /// The next message; none at the end.
    ///
    /// # Errors
    /// When the file is damaged here. A file that was not closed ends with an error if it ends inside of a record.
    #[expect(clippy::should_implement_trait, reason = "a message is borrowed from the reader")]
    pub fn next(&mut self) -> Result<Option<(Arc<RecordedChannel>, Message<'_>)>, ReadError> {
        self.advance()?;
        Ok(self.present())
    }

    /// Goes on behind the messages that arrived before this time: the next one arrived at it or later. Where time
    /// stepped back, that is the first such message in the order of the file. False if there is none. What is
    /// [selected](Reader::select) goes forward only.
    ///
    /// # Errors
    /// As of [`Self::next`].
    pub fn seek(&mut self, arrival_ns: u64) -> Result<bool, ReadError> {
        match &mut self.source {
            ReaderSource::Whole(contents) => {
                *contents = contents.at_first_chunk(|chunk| chunk.message_end_time >= arrival_ns)?;
                self.is_ahead = false;
            }
            ReaderSource::InTime(its) => {
                (its.batches, its.batch) = (its.plan.read(&its.path, arrival_ns)?, OrderedBatch::default());
                self.is_ahead = false;
            }
            ReaderSource::Part(_) => {}
        }
        loop {
            self.advance()?;
            match &self.found {
                Some(found) if found.header.log_time < arrival_ns => {}
                found => {
                    self.is_ahead = found.is_some();
                    return Ok(self.is_ahead);
                }
            }
        }
    }

    /// From here on a thread reads the file and unpacks its chunks before they are asked for. What is
    /// [selected](Reader::select) is read when it is asked for.
    pub(crate) fn read_ahead(&mut self) -> Result<(), ReadError> {
        match &mut self.source {
            ReaderSource::Whole(contents) => contents.read_ahead(),
            ReaderSource::Part(_) | ReaderSource::InTime(_) => Ok(()),
        }
    }

    /// Goes to the next message, unless a search has gone there already.
    pub(crate) fn advance(&mut self) -> Result<(), ReadError> {
        if !std::mem::take(&mut self.is_ahead) {
            self.found = None;
            self.found = self.source.next()?;
        }
        Ok(())
    }

    /// The message that came last.
    pub(crate) fn present(&mut self) -> Option<(Arc<RecordedChannel>, Message<'_>)> {
        let found = self.found.as_ref()?;
        let Found { header, channel, .. } = found;
        let recorded = self.channels.entry(header.channel_id).or_insert_with(|| Arc::new(recorded(channel)));
        let message = Message {
            arrival_ns: header.log_time,
            stamp_ns: header.publish_time,
            epoch: channel.epoch().unwrap_or_default(),
            sequence: header.sequence,
            data: self.source.data(found),
        };
        Some((recorded.clone(), message))
    }

    /// So many bytes are read, of so many.
    pub fn progress(&self) -> (u64, u64) {
        match &self.source {
            ReaderSource::Whole(contents) => (contents.at(), contents.file_bytes()),
            ReaderSource::Part(selected) => (selected.at(), selected.file_bytes()),
            ReaderSource::InTime(its) => (its.batch.read_bytes, its.file_bytes),
        }
    }

    /// Whether the end was reached, and the file was closed there. What is [selected](Reader::select) always is of a
    /// closed one.
    pub fn is_closed(&self) -> bool {
        match &self.source {
            ReaderSource::Whole(contents) => contents.ending() == Some(Ending::Closed),
            ReaderSource::Part(_) => true,
            ReaderSource::InTime(its) => its.plan.is_closed(),
        }
    }
}

impl ReaderSource {
    fn next(&mut self) -> Result<Option<Found>, ReadError> {
        let contents = match self {
            Self::Whole(contents) => contents,
            Self::Part(selected) => return selected.next(),
            Self::InTime(its) => return its.next(),
        };
        while let Some(item) = contents.next()? {
            match item {
                Item::Message(found) => return Ok(Some(found)),
                Item::Damaged(at, what) => return Err(contents.damaged(at, what)),
                Item::Metadata(_) | Item::Attachment(_) => {}
            }
        }
        Ok(None)
    }

    fn data(&self, found: &Found) -> &[u8] {
        match self {
            Self::Whole(contents) => contents.data(found),
            Self::Part(selected) => selected.data(found),
            Self::InTime(its) => found.data_in(&its.batch.data),
        }
    }
}

/// As it is told to users.
pub(crate) fn recorded(channel: &Definition) -> RecordedChannel {
    let text = |key: &str| channel.texts.get(key).map(|text| text.as_str().into()).unwrap_or_default();
    RecordedChannel {
        topic: channel.topic.as_str().into(),
        name: text(key::NAME),
        item: text(key::ITEM),
        ty: channel.schema.ty().cloned(),
        message_encoding: channel.message_encoding.as_str().into(),
        schema_encoding: channel.schema.encoding.as_str().into(),
        texts: channel.texts.clone(),
    }
}

/// Whether a file has its index and its end, without reading more. If not, its writer was killed or still writes.
///
/// # Errors
/// When it is no MCAP file, or its index is damaged.
pub fn is_closed(path: &Path) -> Result<bool, ReadError> {
    match Index::read(&mut Frames::open(path)?) {
        Ok(_) => Ok(true),
        Err(ReadError::NotClosed { .. }) => Ok(false),
        Err(error) => Err(error),
    }
}
