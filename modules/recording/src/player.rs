//! The course of a replay: which message is due, and until when there is none.
//!
//! ```text
//!  files, in order ─▶ chosen messages ─▶ Begin ─▶ Message, Wait, Message, … ─▶ Begin ─▶ … ─▶ End
//!                                          │             ▲                       │
//!                                          ▼             │ time now              ▼
//!                                   time of a node, which passes slower, faster or not at all, and steps here
//! ```

use crate::batch::Message;
use crate::error::ReadError;
use crate::format::{MESSAGE_OVERHEAD_BYTES, metadata, session_key};
use crate::read::contents::{Contents, Item};
use crate::reader::{Reader, RecordedChannel};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// So much is passed over at once of channels that are not played.
const PASSED_BYTES_MAX: usize = 256 << 10;

/// What a player has to say next.
#[derive(Debug)]
pub enum Cue<'a> {
    /// Time steps, to this one: at the beginning, behind a seek, where it stepped while it was recorded, and where
    /// another recording begins.
    Begin {
        /// When the next message arrived, in nanoseconds of the recorded system time.
        system_ns: u64,
        /// Of that time, as it was recorded.
        epoch: u64,
    },
    /// This message is due.
    Message(Arc<RecordedChannel>, Message<'a>),
    /// The next one is due at this time, not before.
    Wait {
        /// In nanoseconds of the recorded system time.
        until_ns: u64,
    },
    /// It passes over messages that are not played: poll again soon.
    Busy,
    /// There is no further one.
    End,
}

/// Plays recordings: in their order, as far apart as they came. It has no clock: the time is told, so it may pass at
/// any pace, or stand. A thread reads ahead some megabytes, so that a message is not late for its chunk.
///
/// ```
/// # use rohrpost_recording::{ChannelSpec, Message, Options, Session, Writer};
/// # use rohrpost_schema::Type;
/// use rohrpost_recording::{Cue, Player};
///
/// # let folder = tempfile::tempdir()?;
/// # let mut writer = Writer::start(Options::new(folder.path(), "base"), Session::default())?;
/// # let spec = ChannelSpec { name: "motor.0", item: "speed", ty: &Type::U8, texts: Default::default() };
/// # let speed = writer.channel(&spec)?;
/// # for (number, arrival_ns) in [(0, 1000), (1, 1500)] {
/// #     writer.write(speed, &Message { arrival_ns, stamp_ns: 10, epoch: 1, sequence: number, data: &[7] })?;
/// # }
/// # writer.finish().1?;
/// let mut player = Player::new(vec![folder.path().join("base-0001.mcap")], |channel| channel.name == "motor.0");
/// assert!(matches!(player.poll(0)?, Cue::Begin { system_ns: 1000, .. }));
/// assert!(matches!(player.poll(1000)?, Cue::Message(_, Message { sequence: 0, .. })));
/// assert!(matches!(player.poll(1200)?, Cue::Wait { until_ns: 1500 }));
/// assert!(matches!(player.poll(1500)?, Cue::Message(_, Message { sequence: 1, .. })));
/// assert!(matches!(player.poll(1500)?, Cue::End));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Player {
    files: Vec<PathBuf>,
    plays: Box<dyn Fn(&RecordedChannel) -> bool + Send>,
    /// The file that is read, and how many were before it.
    reader: Option<Reader>,
    ended: usize,
    /// The number of the file at which it, or a recording, began: only that one plays what it repeats of earlier ones.
    began: usize,
    /// The reader's message is not played yet.
    is_ahead: bool,
    /// Which recording the file is of, if it says so.
    recording: Option<String>,
    /// No message of the file was played yet.
    is_file_new: bool,
    /// It is of another recording than the file before.
    is_other: bool,
    /// Of the time that passes now.
    epoch: Option<u64>,
}

impl Player {
    /// At the beginning of these files, which are played one after the other. Epochs go on from file to file of one
    /// recording; where another one begins, so does time. Channels that are not chosen are left out, and so is what a
    /// file repeats of those before it.
    pub fn new(files: Vec<PathBuf>, plays: impl Fn(&RecordedChannel) -> bool + Send + 'static) -> Self {
        Self {
            files,
            plays: Box::new(plays),
            reader: None,
            ended: 0,
            began: 1,
            is_ahead: false,
            recording: None,
            is_file_new: false,
            is_other: false,
            epoch: None,
        }
    }

    /// What comes next, `now_ns` in the time of the last [`Cue::Begin`].
    ///
    /// A message of an earlier epoch than that of the time is due at once: streams learn of a step one after the other.
    ///
    /// # Errors
    /// When a file cannot be read, or is damaged here. Then it goes on behind that, or with the next file.
    pub fn poll(&mut self, now_ns: u64) -> Result<Cue<'_>, ReadError> {
        if !self.is_ahead {
            match self.advance()? {
                Advanced::ToMessage => self.is_ahead = true,
                Advanced::Busy => return Ok(Cue::Busy),
                Advanced::ToEnd => return Ok(Cue::End),
            }
        }
        let Some((channel, message)) = self.reader.as_mut().and_then(Reader::present) else { return Ok(Cue::End) };
        // Files of older versions do not say of which recording they are; then a smaller epoch tells.
        let is_anew = self.is_file_new && (self.is_other || self.epoch.is_some_and(|epoch| message.epoch < epoch));
        self.is_file_new = false;
        if is_anew || self.epoch.is_none_or(|epoch| message.epoch > epoch) {
            self.epoch = Some(message.epoch);
            return Ok(Cue::Begin { system_ns: message.arrival_ns, epoch: message.epoch });
        }
        if self.epoch == Some(message.epoch) && message.arrival_ns > now_ns {
            return Ok(Cue::Wait { until_ns: message.arrival_ns });
        }
        self.is_ahead = false;
        Ok(Cue::Message(channel, message))
    }

    /// Goes to the first message that arrived at this time or later, in the order of the files; with 0 to the
    /// beginning. Time begins anew there. False if there is none: then it is at the end.
    ///
    /// # Errors
    /// When a file cannot be read, or is damaged where it was searched.
    pub fn seek(&mut self, arrival_ns: u64) -> Result<bool, ReadError> {
        (self.reader, self.is_ahead, self.epoch, self.ended) = (None, false, None, 0);
        while self.open_next()? {
            self.began = self.ended;
            if let Some(reader) = &mut self.reader
                && reader.seek(arrival_ns)?
            {
                reader.read_ahead()?;
                return Ok(true);
            }
        }
        self.reader = None;
        Ok(false)
    }

    /// Opens the next file; false if there is none.
    fn open_next(&mut self) -> Result<bool, ReadError> {
        let Some(path) = self.files.get(self.ended) else { return Ok(false) };
        self.ended += 1;
        self.reader = None;
        let reader = Reader::to_play(path)?;
        let recording = recording_of(path);
        self.is_other = matches!((&self.recording, &recording), (Some(before), Some(now)) if before != now);
        if self.is_other {
            self.began = self.ended;
        }
        (self.reader, self.recording, self.is_file_new) = (Some(reader), recording, true);
        Ok(true)
    }

    /// Goes to the next message that is to be played. Not further than a call may take.
    fn advance(&mut self) -> Result<Advanced, ReadError> {
        let mut passed = 0;
        loop {
            let Some(reader) = &mut self.reader else {
                if !self.open_next()? {
                    return Ok(Advanced::ToEnd);
                }
                self.reader.as_mut().map_or(Ok(()), Reader::read_ahead)?;
                continue;
            };
            if passed > PASSED_BYTES_MAX {
                return Ok(Advanced::Busy);
            }
            reader.advance()?;
            let is_first = self.ended == self.began;
            match reader.present() {
                Some((channel, _)) if (is_first || !channel.is_repeated()) && (self.plays)(&channel) => {
                    return Ok(Advanced::ToMessage);
                }
                Some((_, message)) => passed += message.data.len() + MESSAGE_OVERHEAD_BYTES,
                None => self.reader = None,
            }
        }
    }
}

/// Where reading has come to.
enum Advanced {
    ToMessage,
    Busy,
    ToEnd,
}

/// Which recording a file is of. What is wrong with the file is told where it is read.
fn recording_of(path: &Path) -> Option<String> {
    let mut contents = Contents::open(path).ok()?;
    while let Ok(Some(Item::Metadata(mut its))) = contents.next() {
        if its.name == metadata::SESSION && contents.heeds(&its) {
            return its.metadata.remove(session_key::RECORDING);
        }
    }
    None
}
