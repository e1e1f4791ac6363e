//! The course of a replay: which message is due, and until when there is none.
//!
//! ```text
//!  files, in order ─▶ chosen messages ─▶ Begin ─▶ Message, Wait, Message, … ─▶ Begin ─▶ … ─▶ End
//!                                          │             ▲                       │
//!                                          ▼             │ time now              ▼
//!                                   time of a node, which passes slower, faster or not at all, and steps here
//! ```

use crate::batch::Message;
use crate::error::{Damage, ReadError};
use crate::format::{MESSAGE_OVERHEAD_BYTES, metadata, session_key};
use crate::newest::KEPT_BYTES_MAX;
use crate::read::before::{EarlierMessage, EarlierMessages, PartStart, newest_before};
use crate::read::contents::{Contents, Item};
use crate::read::definitions::Definition;
use crate::reader::{Reader, RecordedChannel, recorded};
use rohrpost_schema::plain::ForeignText;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
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
        /// When the next message arrived, in nanoseconds of the recorded system time; behind a seek the time that was
        /// sought, if anything came before it.
        system_ns: u64,
        /// Of that time, as it was recorded.
        epoch: u64,
    },
    /// This message is due. One that is [repeated](RecordedChannel::is_repeated) is older than the place where it is
    /// played: the newest one of its channel there.
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
    /// The number of the first file of this recording.
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
    /// What came before the place that was sought, and is to be played first; the one that is played.
    older: VecDeque<OlderMessage>,
    shown: Option<OlderMessage>,
    /// What was wrong where older messages were searched for.
    failed: Option<ReadError>,
    /// The last message of each topic that was played: what a file repeats may be that.
    last: BTreeMap<ForeignText, MessageIdentity>,
}

/// Epoch, number and stamp of a message.
type MessageIdentity = (u64, u32, u64);

/// A message from before the place where it is played.
struct OlderMessage {
    channel: Arc<RecordedChannel>,
    /// When it is due.
    arrival_ns: u64,
    stamp_ns: u64,
    epoch: u64,
    sequence: u32,
    data: Vec<u8>,
}

impl OlderMessage {
    fn message(&self) -> Message<'_> {
        let Self { arrival_ns, stamp_ns, epoch, sequence, .. } = *self;
        Message { arrival_ns, stamp_ns, epoch, sequence, data: &self.data }
    }
}

impl Player {
    /// At the beginning of these files, which are played one after the other. Epochs go on from file to file of one
    /// recording; where another one begins, so does time. Channels that are not chosen are left out, and so is what a
    /// file repeats if it was played.
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
            older: VecDeque::new(),
            shown: None,
            failed: None,
            last: BTreeMap::new(),
        }
    }

    /// What comes next, `now_ns` in the time of the last [`Cue::Begin`].
    ///
    /// A message of an earlier epoch than that of the time is due at once: streams learn of a step one after the other.
    ///
    /// # Errors
    /// When a file cannot be read, or is damaged here. Then it goes on behind that, or with the next file.
    pub fn poll(&mut self, now_ns: u64) -> Result<Cue<'_>, ReadError> {
        self.failed.take().map_or(Ok(()), Err)?;
        if let Some(older) = self.older.front().filter(|older| self.epoch.is_none_or(|now| older.epoch > now)) {
            self.epoch = Some(older.epoch);
            return Ok(Cue::Begin { system_ns: older.arrival_ns, epoch: older.epoch });
        }
        let Some(older) = self.older.pop_front() else { return self.poll_file(now_ns) };
        let older = self.shown.insert(older);
        note(&mut self.last, &older.channel, &older.message());
        Ok(Cue::Message(older.channel.clone(), older.message()))
    }

    /// What is next in the files.
    fn poll_file(&mut self, now_ns: u64) -> Result<Cue<'_>, ReadError> {
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
        note(&mut self.last, &channel, &message);
        Ok(Cue::Message(channel, message))
    }

    /// Goes to the first message that arrived at this time or later, in the order of the files; with 0 to the
    /// beginning. Time begins anew there, and [older](Self::has_older) messages come first: of each channel that is
    /// played the newest one of its recording, in these files, from before. False if there is no message at this time
    /// or later: then it is at the end.
    ///
    /// # Errors
    /// When a file cannot be read, or is damaged where it was searched. What is wrong where older messages are
    /// searched for is the error of the next [`Self::poll`].
    pub fn seek(&mut self, arrival_ns: u64) -> Result<bool, ReadError> {
        (self.reader, self.is_ahead, self.epoch, self.ended, self.began) = (None, false, None, 0, 1);
        (self.recording, self.failed) = (None, None);
        self.older.clear();
        self.last.clear();
        while self.open_next()? {
            let Some(reader) = &mut self.reader else { continue };
            match reader.seek(arrival_ns) {
                Ok(true) => {
                    reader.read_ahead()?;
                    self.find_older(arrival_ns);
                    return Ok(true);
                }
                // A file that was not closed ends before.
                Ok(false) | Err(ReadError::Damaged { what: Damage::Cut, .. }) => {}
                Err(error) => return Err(error),
            }
        }
        self.reader = None;
        Ok(false)
    }

    /// Whether the next message is older than the place where it is played.
    pub fn has_older(&self) -> bool {
        !self.older.is_empty()
    }

    /// Takes what the file repeats here, and looks for the rest in what came before, as far as its recording goes back.
    fn find_older(&mut self, from_ns: u64) {
        let present = |player: &mut Self| {
            let (_, message) = player.reader.as_mut().and_then(Reader::present)?;
            Some((message.epoch, message.arrival_ns))
        };
        let mut due_ns = present(self).map_or(from_ns, |(_, arrival_ns)| arrival_ns);
        let mut bytes = self.take_repeated();
        let start = PartStart { epoch: present(self).map(|(epoch, _)| epoch), from_ns };
        let mut topics: BTreeSet<ForeignText> = self.older.iter().map(|its| its.channel.topic.clone()).collect();
        for number in (self.began..=self.ended).rev() {
            let start = if number == self.ended { start } else { PartStart::END };
            let is_wanted = |channel: &Definition| {
                let channel = recorded(channel);
                !topics.contains(&channel.topic) && (self.plays)(&channel)
            };
            let found = newest_before(&self.files[number - 1], &is_wanted, start, KEPT_BYTES_MAX - bytes);
            let EarlierMessages { messages, bytes: more, unread } = found.unwrap_or_else(EarlierMessages::none);
            bytes += more;
            if let Some(unread) = unread {
                self.failed.get_or_insert(unread);
            }
            if !messages.is_empty() {
                due_ns = from_ns;
            }
            for EarlierMessage { channel, header, data } in messages {
                let (epoch, channel) = (channel.epoch().unwrap_or_default(), Arc::new(recorded(&channel)));
                topics.insert(channel.topic.clone());
                let (stamp_ns, sequence) = (header.publish_time, header.sequence);
                self.older.push_back(OlderMessage { channel, arrival_ns: 0, stamp_ns, epoch, sequence, data });
            }
        }
        self.older.iter_mut().for_each(|its| its.arrival_ns = due_ns);
        self.older.make_contiguous().sort_by_key(|its| (its.epoch, its.stamp_ns));
        self.is_file_new &= self.older.is_empty();
    }

    /// Goes behind what the file repeats here, or to what is wrong with it; bytes of what is taken of that.
    fn take_repeated(&mut self) -> usize {
        let Some(reader) = &mut self.reader else { return 0 };
        let mut bytes = 0;
        loop {
            self.failed = reader.advance().err();
            let Some((channel, message)) = reader.present() else { return bytes };
            let is_played = (self.plays)(&channel);
            if !channel.is_repeated() || bytes + message.data.len() > KEPT_BYTES_MAX {
                self.is_ahead = is_played;
                return bytes;
            }
            if is_played {
                bytes += message.data.len();
                let Message { arrival_ns, stamp_ns, epoch, sequence, data } = message;
                let data = data.to_vec();
                self.older.push_back(OlderMessage { channel, arrival_ns, stamp_ns, epoch, sequence, data });
            }
        }
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
            self.last.clear();
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
            match reader.present() {
                Some((channel, message)) if (self.plays)(&channel) && !was_played(&self.last, &channel, &message) => {
                    return Ok(Advanced::ToMessage);
                }
                Some((_, message)) => passed += message.data.len() + MESSAGE_OVERHEAD_BYTES,
                None => self.reader = None,
            }
        }
    }
}

/// Whether a file repeats here what was played last.
fn was_played(last: &BTreeMap<ForeignText, MessageIdentity>, channel: &RecordedChannel, message: &Message<'_>) -> bool {
    channel.is_repeated() && last.get(&channel.topic) == Some(&identity(message))
}

fn note(last: &mut BTreeMap<ForeignText, MessageIdentity>, channel: &RecordedChannel, message: &Message<'_>) {
    match last.get_mut(&channel.topic) {
        Some(known) => *known = identity(message),
        None => drop(last.insert(channel.topic.clone(), identity(message))),
    }
}

fn identity(message: &Message<'_>) -> MessageIdentity {
    (message.epoch, message.sequence, message.stamp_ns)
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
