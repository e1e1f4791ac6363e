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
use crate::reader::{Reader, RecordedChannel};
use std::path::PathBuf;
use std::sync::Arc;

/// What a player has to say next.
#[derive(Debug)]
pub enum Cue<'a> {
    /// Time steps, to this one: at the beginning, behind a seek, and where it stepped while it was recorded.
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
    /// There is no further one.
    End,
}

/// Plays recordings: in their order, as far apart as they came. It has no clock: the time is told, so it may pass at
/// any pace, or stand.
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
    /// The number of the file at which it began: only that one plays what it repeats of earlier ones.
    began: usize,
    /// The reader's message is not played yet.
    is_ahead: bool,
    /// Of the time that passes now.
    epoch: Option<u64>,
}

impl Player {
    /// At the beginning of these files, which are played one after the other. They are those of one recording, in which
    /// epochs go on from file to file. Channels that are not chosen are left out, and so is what a file repeats of
    /// those before it.
    pub fn new(files: Vec<PathBuf>, plays: impl Fn(&RecordedChannel) -> bool + Send + 'static) -> Self {
        Self { files, plays: Box::new(plays), reader: None, ended: 0, began: 1, is_ahead: false, epoch: None }
    }

    /// What comes next, `now_ns` in the time of the last [`Cue::Begin`].
    ///
    /// A message of an earlier epoch than that of the time is due at once: streams learn of a step one after the other.
    ///
    /// # Errors
    /// When a file cannot be read, or is damaged here. Then it goes on behind that, or with the next file.
    pub fn poll(&mut self, now_ns: u64) -> Result<Cue<'_>, ReadError> {
        if !self.is_ahead {
            self.is_ahead = self.advance()?;
        }
        let present = self.reader.as_mut().filter(|_| self.is_ahead).and_then(Reader::present);
        let Some((channel, message)) = present else { return Ok(Cue::End) };
        if self.epoch.is_none_or(|epoch| message.epoch > epoch) {
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
        (self.reader, self.is_ahead, self.epoch) = (None, false, None);
        for (at, path) in self.files.iter().enumerate() {
            (self.ended, self.began) = (at + 1, at + 1);
            let mut reader = Reader::open(path)?;
            if reader.seek(arrival_ns)? {
                self.reader = Some(reader);
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Goes to the next message that is to be played. False at the end.
    fn advance(&mut self) -> Result<bool, ReadError> {
        loop {
            let Some(reader) = &mut self.reader else {
                let Some(path) = self.files.get(self.ended) else { return Ok(false) };
                self.ended += 1;
                self.reader = Some(Reader::open(path)?);
                continue;
            };
            reader.advance()?;
            let is_first = self.ended == self.began;
            match reader.present() {
                Some((channel, _)) if (is_first || !channel.is_repeated()) && (self.plays)(&channel) => {
                    return Ok(true);
                }
                Some(_) => {}
                None => self.reader = None,
            }
        }
    }
}
