//! Messages of a file, one after the other, as replay needs them.

use crate::batch::Message;
use crate::error::ReadError;
use crate::format::key;
use crate::read::contents::{Contents, Ending, Found, Item};
use crate::read::definitions::Definition;
use crate::read::frames::Frames;
use crate::read::index::Index;
use rohrpost_schema::Type;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// A channel, as a file describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedChannel {
    /// Name and item.
    pub topic: String,
    /// What published: `laser.0`; empty in files of other programs.
    pub name: String,
    /// What it published: `scan`.
    pub item: String,
    /// Its type, if it is one of ours.
    pub ty: Option<Type>,
    /// `postcard` in our files.
    pub message_encoding: String,
    /// What else was said when it was recorded.
    pub texts: BTreeMap<String, String>,
}

/// Reads a file from its beginning, with one chunk in memory. It need not be closed, but undamaged so far.
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
    contents: Contents,
    channels: BTreeMap<u16, Arc<RecordedChannel>>,
    found: Option<Found>,
    /// The message that was found is still to be read.
    is_ahead: bool,
}

impl Reader {
    /// At the first message.
    ///
    /// # Errors
    /// When it is no MCAP file.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Ok(Self { contents: Contents::open(path)?, channels: BTreeMap::new(), found: None, is_ahead: false })
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
    /// stepped back, that is the first such message in the order of the file. False if there is none.
    ///
    /// # Errors
    /// As of [`Self::next`].
    pub fn seek(&mut self, arrival_ns: u64) -> Result<bool, ReadError> {
        self.contents = self.contents.from_first_chunk(|chunk| chunk.message_end_time >= arrival_ns)?;
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

    /// Goes to the next message, unless a search has gone there already.
    pub(crate) fn advance(&mut self) -> Result<(), ReadError> {
        if std::mem::take(&mut self.is_ahead) {
            return Ok(());
        }
        self.found = None;
        while let Some(item) = self.contents.next()? {
            match item {
                Item::Message(found) => {
                    self.found = Some(found);
                    break;
                }
                Item::Damaged(at, what) => return Err(self.contents.damaged(at, what)),
                Item::Metadata(_) => {}
            }
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
            data: self.contents.data(found),
        };
        Some((recorded.clone(), message))
    }

    /// Whether the end was reached, and the file was closed there.
    pub fn is_closed(&self) -> bool {
        self.contents.ending() == Some(Ending::Closed)
    }
}

fn recorded(channel: &Definition) -> RecordedChannel {
    let text = |key: &str| channel.texts.get(key).cloned().unwrap_or_default();
    RecordedChannel {
        topic: channel.topic.clone(),
        name: text(key::NAME),
        item: text(key::ITEM),
        ty: channel.schema.ty(),
        message_encoding: channel.message_encoding.clone(),
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
